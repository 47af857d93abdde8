"""What follows from a list of events, whoever wrote it."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest

from pipeline.records.datasheet import AWAITS_APPROVAL
from pipeline.records.ledger import START, Event, faults, histories, in_force
from tests.registered import HOUR, NOON


def event(sequence: int, kind: Any, version: str, revision: int = 1, **more: Any) -> Event:
    """An event of motor `a`, one hour after another."""
    return Event(sequence, NOON + sequence * HOUR, kind, "a", version * 64, revision, **more)


def chained(*events: Event) -> list[Event]:
    found: list[Event] = []
    for one in events:
        found.append(one.linked(found[-1].chain if found else START))
    return found


def test_a_refused_datasheet_stays_refused_whatever_is_decided() -> None:
    """Even where a row says that somebody approved it."""
    events = [event(1, "publish", "f", status="refused"), event(2, "approve", "f", by="A")]
    (version,) = histories(events)["a"]
    assert version.status == "refused"
    assert in_force([version]) is None


def test_a_doubled_version_counts_once_and_by_its_first_row() -> None:
    events = [event(1, "publish", "f", lot="A"), event(2, "publish", "f", 2, lot="B")]
    (version,) = histories(events)["a"]
    assert (version.revision, version.published.lot) == (1, "A")


def test_the_newest_released_version_is_in_force() -> None:
    events = [
        event(1, "publish", "d", 1, status="released"),
        event(2, "publish", "e", 2, status="released"),
        event(3, "publish", "f", 3, status="provisional"),
    ]
    history = histories(reversed(events))["a"]
    assert [version.revision for version in history] == [1, 2, 3]
    valid = in_force(history)
    assert valid is not None
    assert valid.revision == 2


def test_only_the_approval_is_left_open() -> None:
    said = event(1, "publish", "f", reasons=(AWAITS_APPROVAL, "missing: ld_h"))
    assert histories([said])["a"][0].open_points == ("missing: ld_h",)


def test_a_sound_list_has_no_faults() -> None:
    first = event(1, "publish", "e", 1)
    assert faults(chained(first, event(2, "approve", "e"), event(3, "publish", "f", 2))) == []


@pytest.mark.parametrize(
    ("events", "said"),
    [
        (chained(event(2, "publish", "f")), "row 1 is expected"),
        (chained(event(1, "approve", "f")), "never published"),
        (chained(event(1, "publish", "f", 2)), "says revision 2, is the 1."),
        (chained(event(1, "publish", "f"), event(2, "publish", "f", 1)), "there twice"),
        ([replace(chained(event(1, "publish", "f"))[0], lot="B")], "does not follow"),
    ],
)
def test_one_fault_is_said_once(events: list[Event], said: str) -> None:
    found = faults(events)
    assert len(found) == 1
    assert said in found[0]


def test_events_are_chained() -> None:
    """The link depends on every field and on the row before."""
    event = Event(1, NOON, "publish", "a", "f" * 64, 1)
    link = event.linked("0" * 64).chain
    assert link == event.linked("0" * 64).chain
    others = [
        Event(2, NOON, "publish", "a", "f" * 64, 1),
        Event(1, NOON + timedelta(microseconds=1), "publish", "a", "f" * 64, 1),
        Event(1, NOON, "approve", "a", "f" * 64, 1),
        Event(1, NOON, "publish", "b", "f" * 64, 1),
        Event(1, NOON, "publish", "a", "e" * 64, 1),
        Event(1, NOON, "publish", "a", "f" * 64, 2),
        Event(1, NOON, "publish", "a", "f" * 64, 1, by="a"),
        Event(1, NOON, "publish", "a", "f" * 64, 1, why="a"),
        Event(1, NOON, "publish", "a", "f" * 64, 1, stations=("a",)),
    ]
    links = {other.linked("0" * 64).chain for other in others} | {event.linked(link).chain}
    assert len(links | {link}) == len(others) + 2
