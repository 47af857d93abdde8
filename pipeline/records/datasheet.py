"""The versioned datasheet of one motor, and the checks on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.records.capture import Integrity
from pipeline.records.estimate import Estimate
from pipeline.records.field_kinds import Extension, Name, Sha256
from pipeline.records.model_verdict import MODEL_REASON, ModelVerdict
from pipeline.records.plain_form import PlainRecord, plain_of

CheckStatus = Literal["pass", "marginal", "fail", "not_evaluated"]
DatasheetStatus = Literal["released", "provisional", "refused"]

AWAITS_APPROVAL = (
    "not approved in the registry; release=auto releases what has no other reason here"
)
"""The reason in `why` of every datasheet that is not released by itself."""


def left_to_a_person(reason: str) -> bool:
    """Whether a person may approve a datasheet in spite of a reason.

    Parameters
    ----------
    reason
        One entry of `why`.

    Returns
    -------
    bool
        True for a missing approval and for a reason about the model: constants are measured, what
        else the motor does is not. A failed check or a missing constant is never left to a person.

    """
    return reason == AWAITS_APPROVAL or reason.startswith(MODEL_REASON)


@dataclass(frozen=True, slots=True)
class Check(PlainRecord):
    """One comparison of constants that were found in different ways.

    Attributes
    ----------
    name
        Name of the rule.
    status
        `pass`, `marginal`, `fail`, or `not_evaluated` where something is missing.
    meaning
        What was compared, or what is missing, in one sentence.
    value, limit, unit
        What is judged, and the limit that it is held to; None where not evaluated.
    suspect
        The convention or capture that would explain a failure.

    """

    name: Name
    status: CheckStatus
    meaning: str
    value: float | None = None
    limit: float | None = None
    unit: Name = "1"
    suspect: str | None = None


@dataclass(frozen=True, slots=True)
class CaptureReference(PlainRecord):
    """Which file a datasheet rests on.

    `sha256` is that of its bytes, `read_sha256` that of what was read from them: columns, metadata
    and masks, after units, signs and gates. None in datasheets written before it existed.

    Attributes
    ----------
    path
        Relative to the input folder.
    sha256
        Digest of the file's bytes.
    test, station, started_at
        What the file says of itself.
    integrity
        `verified` or `unverified`.
    read_sha256
        Digest of what was read: columns, metadata and masks, after units, signs and gates. None in
        datasheets that were written before it existed.

    """

    path: Name
    sha256: Sha256
    test: Name
    integrity: Integrity
    station: Extension[str | None] = None
    started_at: Extension[str | None] = None
    read_sha256: Extension[Sha256 | None] = None


@dataclass(frozen=True, slots=True)
class Superseded(PlainRecord):
    """The revoked version of the same work whose place a datasheet takes: by whom and why."""

    version: Sha256
    by: str
    why: str


@dataclass(frozen=True, slots=True)
class Datasheet:
    """Everything known of one motor: the same inputs, configuration and code give the same bytes.

    Attributes
    ----------
    motor_id, motor_type, lot
        The motor.
    version
        Digest of captures, configuration, code and libraries.
    status
        `released`, `provisional` or `refused`.
    why
        Reasons against a release, one sentence each.
    captures
        The files that it rests on.
    config_sha256, code_version
        Digests of the settings and of the code that fitted and checked.
    constants
        The preferred estimate of each constant, or why there is none.
    alternatives
        Estimates of the same constants by other methods.
    checks
        Cross-checks.
    libraries
        Versions of Python and of the libraries that the numbers depend on.
    supersedes
        The revoked version that it replaces.
    model
        The residual test; None in datasheets of before there was one.

    """

    motor_id: str
    motor_type: str | None
    lot: str | None
    version: str
    status: DatasheetStatus
    why: tuple[str, ...]
    captures: tuple[CaptureReference, ...] = field(repr=False)
    config_sha256: str = field(repr=False)
    code_version: str = field(repr=False)
    constants: Mapping[str, Estimate] = field(repr=False)
    alternatives: tuple[Estimate, ...] = field(repr=False)
    checks: tuple[Check, ...] = field(repr=False)
    libraries: str = field(default="", repr=False)
    supersedes: Superseded | None = None
    model: ModelVerdict | None = field(default=None, repr=False)

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, schema motor-datasheet/1."""
        return {
            "schema": "motor-datasheet/1",
            "motor_id": self.motor_id,
            "motor_type": self.motor_type,
            "lot": self.lot,
            "version": self.version,
            "status": self.status,
            "why": list(self.why),
            "provenance": {
                "captures": plain_of(self.captures),
                "config_sha256": self.config_sha256,
                "code_version": self.code_version,
                "libraries": self.libraries,
            },
            "supersedes": plain_of(self.supersedes),
            "constants": {name: est.document() for name, est in sorted(self.constants.items())},
            "alternatives": [
                {"name": est.name} | est.document()
                for est in sorted(self.alternatives, key=lambda e: (e.name, e.method))
            ],
            "checks": plain_of(self.checks),
        } | ({} if self.model is None else {"model": self.model.document()})
