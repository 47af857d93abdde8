"""YAML from untrusted files: text, lists and maps only, no tags, no aliases, small and shallow.

Every scalar stays the text that was written, so a serial number 000123 or a `no` keeps its form;
who needs a number converts it and says so.
"""

from __future__ import annotations

from typing import Any

import yaml

from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, decoded, is_text

_MAX_BYTES = 2**17
_MAX_DEPTH = 12
_PLAIN_TAGS = frozenset(
    f"tag:yaml.org,2002:{kind}"
    for kind in ("str", "int", "float", "bool", "null", "timestamp", "seq", "map")
)
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
Plain = Any
"""str, list of Plain, or dict from str to Plain."""


def load_plain(data: bytes, what: str) -> Plain:
    """The document as texts, lists and maps; None if it is empty. Raises CaptureError.

    Parameters
    ----------
    data
        Content of the file.
    what
        Its name, for messages.

    Returns
    -------
    object
        None for an empty document.

    Raises
    ------
    CaptureError
        It is too large or deep, has tags, aliases or several documents, or is no YAML.

    """
    if len(data) > _MAX_BYTES:
        raise _bad(what, f"is larger than {_MAX_BYTES} bytes")
    try:
        text = decoded(data, "utf-8-sig")
        _check_events(text, what)
        node = yaml.compose(text, Loader=_LOADER)
    except ParseError as fault:
        raise _bad(what, str(fault)) from None
    except yaml.YAMLError as fault:
        place = getattr(fault, "problem_mark", None)
        line = f" in line {place.line + 1}" if place else ""
        raise _bad(what, f"is no YAML{line}: {getattr(fault, 'problem', fault)}") from None
    return None if node is None else _plain(node, what)


def _bad(what: str, message: str) -> CaptureError:
    return CaptureError("bad_yaml", f"{what} {message}", "write plain `key: value` lines")


def _check_events(text: str, what: str) -> None:
    """Stop at depth, aliases and second documents before anything is built."""
    depth = documents = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            raise _bad(what, "uses an alias")
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > _MAX_DEPTH:
            raise _bad(what, f"nests deeper than {_MAX_DEPTH}")
        if documents > 1:
            raise _bad(what, "holds more than one document")


def _plain(node: Any, what: str) -> Plain:
    if node.tag not in _PLAIN_TAGS:
        raise _bad(what, f"uses the tag {node.tag}")
    if isinstance(node, yaml.ScalarNode):
        if not is_text(node.value):
            raise _bad(what, "holds half of a surrogate pair, which is no text")
        return "" if node.tag.endswith(":null") else node.value
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, what) for item in node.value]
    values: dict[str, Plain] = {}
    for key, value in node.value:
        name = _plain(key, what)
        if not isinstance(name, str):
            raise _bad(what, "has a key that is no text")
        if name in values:
            raise _bad(what, f"has the key {name!r} twice")
        values[name] = _plain(value, what)
    return values
