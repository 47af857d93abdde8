"""The frame of every page: templates that escape whatever a capture claims to be called."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"


def render(template: str, **values: Any) -> str:
    """HTML text of a template; a value that the template names and that is not given is an error.

    The indentation of the templates is not part of it.

    Parameters
    ----------
    template
        File name of the template.
    values
        Object or mapping that the template reads.

    """
    text = _environment().get_template(template).render(**values)
    return re.sub(r"\s*\n\s*", "\n", text)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )
