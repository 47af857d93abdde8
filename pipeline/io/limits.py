"""Reading `conf/limits/*.yaml`: what a datasheet must hold before it is released."""

from __future__ import annotations

from pathlib import Path

import yaml

from pipeline.physics.glossary import CONSTANTS
from pipeline.records.errors import UsageError

MAX_BYTES = 1 << 20


def limits_file(folder: Path, name: str) -> Path:
    """The limits file of a name; raises UsageError where there is none."""
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    if name not in known:
        raise UsageError(f"no limits file {name!r}", f"known are {', '.join(known)}")
    return folder / f"{name}.yaml"


def required_constants(path: Path) -> tuple[str, ...]:
    """The constants that a release must hold, measured; raises UsageError for a bad file."""
    content = path.read_bytes()
    if len(content) > MAX_BYTES or content.count(b"*") > 100:
        raise UsageError(f"{path.name} is too large or too full of aliases", "shorten it")
    try:
        document = yaml.safe_load(content)
    except yaml.YAMLError as error:
        raise UsageError(f"{path.name} is no YAML: {error}", "correct it") from error
    names = document.get("required") if isinstance(document, dict) else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise UsageError(f"{path.name} needs `required:`, a list of constants", "add it")
    unknown = [name for name in names if name not in CONSTANTS]
    if unknown:
        raise UsageError(f"{path.name}: no constant {unknown[0]!r}", "see docs/glossary.md")
    return tuple(names)
