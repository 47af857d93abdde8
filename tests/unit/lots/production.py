"""A production line in numbers: datasheets of lots, stations and motors with known spreads."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.lots.regression import Samples
from pipeline.lots.sample import Member
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import CaptureReference, Datasheet
from pipeline.records.estimate import Estimate, Order
from pipeline.records.limits import ConstantLimits, Limits
from pipeline.records.lot_constant import Side
from pipeline.records.lot_regression import Group
from pipeline.records.uncertainty import type_a, type_b

NAMES = (
    "r_phase_ohm",
    "ld_h",
    "lq_h",
    "psi_pm_wb",
    "kt_peak_nm_a",
    "j_rotor_kgm2",
    "torque_coulomb_nm",
    "b_visc_nm_s_rad",
    "cogging_peak_nm",
    "rth_winding_k_w",
    "resistance_imbalance",
    "temp_coeff_copper_1_k",
)
NOMINAL = 1.0
SIGMA = 0.01
AT = {"temp_winding_degc": 25.0, "temp_magnet_degc": 25.0}


def limits(names: Sequence[str] = NAMES, **options: object) -> Limits:
    """Limits that name constants only: no tolerance, no margin."""
    constants = tuple(ConstantLimits(name) for name in names)
    return Limits("test", "0" * 64, (), constants, **options)  # type: ignore[arg-type]


def sheet(
    motor_id: str,
    lot: str | None,
    station: str | None,
    values: Mapping[str, float],
    *,
    u: float = 1e-4,
    u_gain: float = 0.0,
    orders: Sequence[Order] = (),
    run: int = 0,
    at: Mapping[str, float] | None = None,
    code: str = "0.1.0+aaaaaaaaaaaa",
    motor_type: str = "gimbal",
) -> Datasheet:
    """A datasheet of these values; `run` parts measurements of one motor."""
    digest = hashlib.sha256(f"{motor_id} {station} {run}".encode()).hexdigest()
    version = hashlib.sha256(f"{digest} {code} {sorted(values.items())}".encode()).hexdigest()
    path = f"{motor_id}/test_{run}.mcap"
    constants = {
        name: Estimate(
            name,
            value,
            CONSTANTS[name].unit,
            "measured",
            "test",
            type_a(f"scatter:{name}", u) + type_b(f"voltage@{station or 'unknown'}", u_gain),
            AT if at is None else at,
            (path,),
        )
        for name, value in values.items()
    }
    if orders:
        size = max(order.amplitude for order in orders)
        constants["cogging_amplitude_nm"] = Estimate(
            "cogging_amplitude_nm", size, "N·m", "measured", "cogging", captures=(path,),
            orders=tuple(orders),
        )  # fmt: skip
    return Datasheet(
        motor_id, motor_type, lot, version, "provisional", (),
        (CaptureReference(path, digest, "resistance", "verified", station),),
        "c" * 64, code, constants, (), (),
    )  # fmt: skip


def lot(
    rng: np.random.Generator,
    name: str,
    *,
    motors: int = 30,
    station: str | None = "S1",
    lot_sd: float = 0.2,
    shift: float = 0.0,
    bias: float = 0.0,
    names: Sequence[str] = NAMES,
    shifted: str | None = None,
) -> list[Datasheet]:
    """One lot; `lot_sd`, `shift` and `bias` in standard deviations between motors."""
    centre = {n: rng.normal(0.0, lot_sd) for n in names}
    sheets = []
    for k in range(motors):
        draws = {n: centre[n] + rng.standard_normal() + bias for n in names}
        if shifted is not None:
            draws[shifted] += shift
        values = {n: NOMINAL + SIGMA * draw for n, draw in draws.items()}
        sheets.append(sheet(f"{name}-{k}", name, station, values))
    return sheets


def members(sheets: Sequence[Datasheet], side: Side | None, day: int = 1) -> list[Member]:
    """Members of a side; lots take their order in time from `day`."""
    return [Member(one, side, f"2026-01-{day:02d}T08:00:00+00:00") for one in sheets]


def group(side: Side, found: Sequence[Member]) -> Group:
    """What a selector would say of these."""
    lots = tuple(dict.fromkeys(member.lot for member in found))
    return Group(side, f"lot:{','.join(lots)}", len(found), lots, (), ("gimbal",), (), (), ())


def samples(
    base: Sequence[Sequence[Datasheet]],
    candidate: Sequence[Datasheet],
    repeats: Sequence[Datasheet] = (),
    golden: Sequence[str] = (),
) -> Samples:
    """Baseline lots in order of time and a candidate lot after them."""
    before = [m for day, one in enumerate(base, 1) for m in members(one, "baseline", day)]
    after = members(candidate, "candidate", len(base) + 1)
    again = members(repeats, None)
    return Samples(
        group("baseline", before),
        group("candidate", after),
        (*before, *after),
        tuple(again),
        tuple(member for member in again if member.sheet.motor_id in golden),
    )
