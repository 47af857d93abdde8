"""The conditions that a constant holds at, in as few words as they need."""

from __future__ import annotations

from pipeline.physics.glossary import suffix_of, unit_of
from pipeline.physics.notation import plain, scale_for
from pipeline.records.estimate import Conditions
from pipeline.views.names import quantity_words

_LOW, _HIGH = "low", "high"


def conditions(at: Conditions) -> str:
    """Conditions in order of their names; `X_low_UNIT` with `X_high_UNIT` is one range.

    Parameters
    ----------
    at
        Conditions by name [unit of the name].

    """
    texts = []
    for key in sorted(at, key=_without_end):
        end, partner = _end(key), at.get(_partner(key))
        if end == _HIGH and isinstance(partner, int | float):
            continue
        value = at[key]
        if end == _LOW and isinstance(value, int | float) and isinstance(partner, int | float):
            texts.append(f"{_words(_without_end(key))} {_range(value, partner, unit_of(key))}")
        else:
            texts.append(f"{_words(key)} {_value(value, unit_of(key))}")
    return ", ".join(texts)


def _words(key: str) -> str:
    words = quantity_words(key).replace("_", "")
    first, _, rest = words.partition(" ")
    return rest if first == "temperature" and rest else words


def _value(value: float | int | str, unit: str) -> str:
    if isinstance(value, str):
        return value
    scale = scale_for(value, unit)
    return f"{plain(scale.shown(value), 4)} {scale.unit}".strip()


def _range(low: float, high: float, unit: str) -> str:
    scale = scale_for(max(abs(low), abs(high)), unit)
    first, last = plain(scale.shown(low), 4), plain(scale.shown(high), 4)
    return f"{first} to {last} {scale.unit}".strip()


def _stem(key: str) -> list[str]:
    suffix = suffix_of(key)
    return (key[: -len(suffix) - 1] if suffix else key).split("_")


def _end(key: str) -> str:
    last = _stem(key)[-1]
    return last if last in {_LOW, _HIGH} else ""


def _without_end(key: str) -> str:
    stem = _stem(key)
    return "_".join([*(stem[:-1] if _end(key) else stem), *filter(None, [suffix_of(key)])])


def _partner(key: str) -> str:
    other = {_LOW: _HIGH, _HIGH: _LOW}.get(_end(key))
    if other is None:
        return ""
    return "_".join([*_stem(key)[:-1], other, *filter(None, [suffix_of(key)])])
