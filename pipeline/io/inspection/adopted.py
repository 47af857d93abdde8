"""Maps that read a folder already, with what was answered in their metadata, as one map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from pipeline.io.maps.map_file import laid_over
from pipeline.io.storage.plain_yaml import load_plain

_HEAD = "# A source map, of {}; what was answered is under `metadata`. docs/source-maps.md.\n"


def adopted_text(places: Sequence[Path], metadata: Mapping[str, str], proposed: str) -> str:
    """One source map in YAML for the files of several.

    Parameters
    ----------
    places
        Files of the maps that are adopted.
    metadata
        What was answered; it takes the place of what those maps say.
    proposed
        The map of the other files in YAML; empty where there are none.

    Returns
    -------
    str
        The map; with `variants` where it is of more than one shape. An answered `increment_s` is
        under `time`.

    """
    shapes = [shape for place in places for shape in _shapes(place.read_bytes(), metadata)]
    if proposed:
        shapes = [*_shapes(proposed.encode(), {}), *shapes]
    document = shapes[0] if len(shapes) == 1 else {"variants": shapes}
    names = ", ".join(place.stem for place in places)
    return _HEAD.format(names) + yaml.safe_dump(document, sort_keys=False, allow_unicode=True)


def _shapes(data: bytes, answered: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    """The variants of a map, or the map alone, each whole and with the answers in it."""
    plain = load_plain(data, "the source map")
    variants = plain.pop("variants", [{}])
    for variant in variants:
        shape = laid_over(plain, variant)
        metadata = dict(answered)
        if (increment := metadata.pop("increment_s", None)) is not None:
            shape["time"] = {**(shape.get("time") or {}), "increment_s": increment}
        if metadata:
            shape["metadata"] = {**(shape.get("metadata") or {}), **metadata}
        yield shape
