"""What counts now of a version: whatever shows it and export agree, in every state."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from pipeline.records.current_status import current_status
from pipeline.records.datasheet import AWAITS_APPROVAL, Datasheet
from pipeline.records.ledger import Event, Version, histories, in_force
from pipeline.records.model_verdict import MODEL_REASON

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
LEFT = f"{MODEL_REASON}the standard model misses vd_v"


def event(kind: str, **said: Any) -> dict[str, Any]:
    """What an event says beside its number and time; a provisional version where it publishes."""
    own = {"motor_id": "m", "version": "a", "revision": 1, "kind": kind}
    if kind == "publish":
        own |= {"status": "provisional", "reasons": (LEFT, AWAITS_APPROVAL)}
        own |= {"content_sha256": "c" * 64}
    return {**own, **said}


def events(*told: dict[str, Any]) -> list[Event]:
    return [
        Event(sequence=n, recorded_at=NOON + timedelta(hours=n), **one)
        for n, one in enumerate(told, 1)
    ]


def history(*told: dict[str, Any]) -> tuple[Version, ...]:
    return histories(events(*told))["m"]


def sheet(version: str = "a") -> Datasheet:
    why = (LEFT, AWAITS_APPROVAL)
    return Datasheet("m", None, None, version, "provisional", why, (), "", "", {}, (), ())


PUBLISH, APPROVE = event("publish"), event("approve", by="A", why="w")
REVOKE = event("revoke", by="A", why="w")
NEWER = event("publish", version="b", revision=2)
STATES = {
    "provisional": ((PUBLISH,), "a", "provisional", None),
    "approved": ((PUBLISH, APPROVE), "a", "released", 1),
    "revoked": ((PUBLISH, APPROVE, REVOKE), "a", "revoked", None),
    "approved again": ((PUBLISH, REVOKE, APPROVE), "a", "released", 1),
    "newer": ((PUBLISH, APPROVE, NEWER), "b", "provisional", 1),
    "older on the page": ((PUBLISH, APPROVE, NEWER), "a", "released", 1),
    "newer approved": (
        (PUBLISH, APPROVE, NEWER, event("approve", version="b", revision=2, by="A", why="w")),
        "b",
        "released",
        2,
    ),
}


@pytest.mark.parametrize("state", STATES)
def test_what_is_shown_and_what_is_exported_agree(state: str) -> None:
    told, version, status, exported = STATES[state]
    versions = history(*told)
    found = current_status(sheet(version), versions)
    valid = in_force(versions)
    assert found.status == status
    assert found.in_force is valid
    assert (None if valid is None else valid.revision) == exported
    assert found.version is not None
    assert found.exported == (found.version.revision == exported)
    assert found.exported <= (found.status == "released")


def test_an_approval_settles_the_wait_and_not_what_the_model_leaves() -> None:
    assert current_status(sheet(), history(PUBLISH)).why == (LEFT, AWAITS_APPROVAL)
    assert current_status(sheet(), history(PUBLISH, APPROVE)).why == (LEFT,)
    assert history(PUBLISH)[0].open_points == (), "a person may approve it"


def test_a_decision_on_other_content_is_none_on_this() -> None:
    """A version that is registered with other bytes: its approval says nothing of these."""
    versions = history(PUBLISH, APPROVE)
    assert current_status(sheet(), versions, "c" * 64).status == "released"
    found = current_status(sheet(), versions, "d" * 64)
    assert (found.status, found.version, found.decision) == ("provisional", None, None)
    assert found.in_force is versions[0]
    assert not found.exported


def test_without_a_registry_the_datasheet_speaks_for_itself() -> None:
    found = current_status(sheet())
    assert (found.status, found.why) == ("provisional", (LEFT, AWAITS_APPROVAL))
    assert (found.version, found.in_force, found.exported) == (None, None, False)
