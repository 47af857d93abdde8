"""From cases of a world to campaigns, as the reader would hand them on; many cases at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from types import ModuleType

from pipeline.records.capture import Campaign
from pipeline.simulator.effects import parameters
from tests.benchmark.sealing import MOTOR_TYPE, captures
from tests.benchmark.worlds.case import WorldCase
from tests.benchmark.worlds.lanes import Array, Lane, run
from tests.benchmark.worlds.programmes import (
    PWM_HZ,
    Campaigner,
    Hidden,
    lanes_of,
    recordings,
)

WORLDS: Mapping[str, str] = {
    "motulator": "motulator",
    "mujoco": "mujoco",
    "gym": "gym-electric-motor",
    "maker": "",
    "drawn": "",
}
"""Worlds, and the package that each needs; none where the plant is this project's simulator."""

AT_ONCE = 40
"""Cases that are recorded together: a lane costs little beside a batch, and some memory."""


class Recorder:
    """Campaigns of cases one by one, recorded in batches as they are asked for."""

    def __init__(self, due: Sequence[WorldCase]) -> None:
        self.due, self.ready = list(due), {}

    def __call__(self, case: WorldCase) -> Campaign:
        if case.key not in self.ready:
            batch, self.due = self.due[:AT_ONCE], self.due[AT_ONCE:]
            made = campaigns(batch)
            self.ready = {one.key: found for one, found in zip(batch, made, strict=True)}
        return self.ready.pop(case.key)


def world(name: str) -> ModuleType:
    """The module of a world; ImportError where its package is not installed."""
    return import_module(f"tests.benchmark.worlds.with_{name}")


def campaigns(cases: Sequence[WorldCase]) -> list[Campaign]:
    """The campaigns of cases of one world, in their order."""
    place = world(cases[0].world)
    if not WORLDS[cases[0].world]:
        return [place.campaign(case) for case in cases]
    plants = [_plant(place, case) for case in cases]
    people = [Campaigner(p, c.programme, c.seed) for p, c in zip(plants, cases, strict=True)]
    sessions = [one.sessions() for one in people]
    axes = place.Plant.axes
    # drives of even numbers log their voltages in the one frame, of odd numbers in the other
    lanes = [
        lanes_of(s, c.programme, axes, axes == "dq" and c.seed % 2 == 0)
        for s, c in zip(sessions, cases, strict=True)
    ]
    rows = _driven(place, plants, lanes)
    found = []
    for case, plant, own, logged in zip(cases, plants, sessions, rows, strict=True):
        made = recordings(plant, case.programme, own, logged)
        found.append(Campaign(plant.motor.motor_id, captures(made)))
    return found


def _plant(place: ModuleType, case: WorldCase):  # type: ignore[no-untyped-def]
    """The plant with its sensor faults in the nameplate's effects and the rest in itself."""
    bare = replace(place.motor(case.seed), motor_id=f"M{case.key[:10]}", motor_type=MOTOR_TYPE)
    faults, inside = {}, {}
    for name, share in case.effects.items():
        if name in place.SENSOR_EFFECTS:
            faults[name] = share * parameters(name, bare)["size"]
        else:
            inside[name] = share * place.TYPICAL[name](bare)
    return place.Plant(bare.having(**faults), Hidden(inside))


def _driven(
    place: ModuleType, plants: Sequence[object], lanes: Sequence[Mapping[str, Lane]]
) -> list[dict[str, Array]]:
    """Rows of every lane of every case; lanes of one kind of model run together."""
    rows: list[dict[str, Array]] = [{} for _ in lanes]
    kinds: dict[object, list[tuple[int, str]]] = {}
    for k, own in enumerate(lanes):
        for stem in own:
            kinds.setdefault(place.kind(plants[k]), []).append((k, stem))
    for members in kinds.values():
        batch = [lanes[k][stem] for k, stem in members]
        stepper = place.Converted(batch, [plants[k].hidden for k, _ in members])  # type: ignore[attr-defined]
        for (k, stem), found in zip(members, run(stepper, batch, 1.0 / PWM_HZ), strict=True):
            rows[k][stem] = found
    return rows
