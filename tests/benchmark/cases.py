"""A case: one sealed campaign, what is true of it, and what a right answer is."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

from pipeline.io.storage.publish import canonical_json
from pipeline.simulator.design import Motor
from tests.benchmark.bench import STEMS, station

Values = dict[str, float]

OUTSIDE_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "eddy_brake": ("omega_mech_rad_s",),
    "tight_spot": ("theta_mech_rad",),
    "warm_grease": ("temp_winding_degc", "omega_mech_rad_s"),
    "contact": ("iq_a",),
    "trapezoid": ("theta_elec_rad", "theta_mech_rad"),
    "hot_spot": ("temp_winding_degc", "temp_magnet_degc"),
}
"""What each term outside the library depends on; any of them is a right answer."""


@dataclass(frozen=True, slots=True)
class Case:
    """One sealed campaign: how it is made, what is true of it, and what a right answer is.

    `truth` names what is hidden. `accepted` gives for each of them the effects that these
    captures cannot part from it; `nothing` where they show no trace of it at all. `sizes` are in
    the simulator's units, `of_typical` in typical sizes. `allowed` are names that are no mistake.
    """

    family: str
    line: str
    number: int
    motor: str
    model: str
    seed: int
    keep: tuple[str, ...] = STEMS
    effects: Mapping[str, Values] = field(default_factory=dict)
    outside: str | None = None
    outside_size: float = 0.0
    corruption: str = "clean"
    truth: tuple[str, ...] = ()
    accepted: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    nothing: bool = False
    of_typical: float = 0.0
    allowed: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """The case as plain data."""
        return asdict(self)

    @property
    def key(self) -> str:
        """Name of the case: 16 hex digits of a digest of its content."""
        return hashlib.sha256(canonical_json(self.document())).hexdigest()[:16]

    @property
    def station_key(self) -> str:
        """8 hex digits of a digest of the station that the case is recorded at."""
        return _station_key(self.motor)

    def hidden_motor(self) -> Motor:
        """The motor with everything that is hidden in it."""
        from pipeline.simulator.outside import with_unknown

        motor = station(self.motor).motor.having(**self.effects)
        if self.outside is None:
            return motor
        return with_unknown(motor, self.outside, self.outside_size)


@cache
def _station_key(motor: str) -> str:
    place = station(motor)
    plan = [[stem, test, dict(how)] for stem, test, how in place.plan]
    document = [repr(place.motor), asdict(place.bench), plan]
    words = json.dumps(document, sort_keys=True, default=list)
    return hashlib.sha256(words.encode()).hexdigest()[:8]


def case_from(document: Mapping[str, Any]) -> Case:
    """The case of a document that `Case.document` wrote."""
    values = dict(document)
    for name in ("keep", "truth", "allowed"):
        values[name] = tuple(values[name])
    values["accepted"] = {key: tuple(found) for key, found in values["accepted"].items()}
    return Case(**values)
