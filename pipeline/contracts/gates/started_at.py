"""A start that cannot be placed in time."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture
from pipeline.records.parse import moment

NAME = "started_at"
REMEDY = "write started_at as ISO 8601 in UTC, such as 2026-01-05T08:00:00Z"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns of a `started_at` that is not ISO 8601 with date, time and UTC; no value rests on it.

    References
    ----------
    ISO 8601-1:2019, 5.4.2 (date and time of day in UTC).

    """
    stated = capture.meta.started_at
    if stated is None or _in_utc(stated):
        return Passed()
    words = f"started_at is {stated[:60]!r}: no ISO 8601 date and time in UTC"
    return Passed(findings=(warning(capture, NAME, words, REMEDY),))


def _in_utc(stated: str) -> bool:
    instant = moment(stated)
    return instant is not None and instant.utcoffset() == timedelta(0)


GATE = Gate(NAME, tuple(TESTS), check)
