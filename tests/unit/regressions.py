"""A comparison of two groups of lots, as `regress` makes it: one constant moved, one did not."""

from __future__ import annotations

import numpy as np

from pipeline.records.lot_constant import (
    Bounds,
    Capability,
    Conformity,
    ConstantResult,
    EffectSize,
    Equivalence,
    LotMean,
    LotTest,
    MotorValue,
    Power,
    Side,
    Verdict,
)
from pipeline.records.lot_regression import (
    CoggingBand,
    EffectChange,
    Group,
    LimitsUsed,
    LotRegression,
    OrderLevel,
    Outlier,
)

BEFORE = ("2026-W02", "2026-W06", "2026-W10")
AFTER = ("2026-W14",)
MOTORS_A_LOT = 6
COGGING_NM = {"baseline": 0.008, "candidate": 0.014}
ORDER = 12


def make_regression() -> LotRegression:
    """Cogging rose by three quarters, the resistance stayed."""
    return LotRegression(
        mode="lots",
        verdict="fail",
        headline="cogging_amplitude_nm rose by 6.0 mN·m (75 %)",
        reasons=("cogging_amplitude_nm: beyond the baseline lots' own scatter",),
        history="sufficient",
        baseline=_group("baseline", "lot:2026-W0*", BEFORE),
        candidate=_group("candidate", "lot:2026-W14", AFTER),
        limits=LimitsUsed("default", "ab" * 32, "simple", 0.05, 3),
        constants=(
            make_constant("r_phase_ohm", "ohm", 0.42, 0.42, 0.002, "pass"),
            make_constant("cogging_amplitude_nm", "N·m", 0.008, 0.014, 0.0005, "fail"),
        ),
        effects=(
            EffectChange(
                f"cogging_order_{ORDER}",
                "datasheet",
                "fail",
                "more motors show it",
                2,
                18,
                6,
                6,
                1e-4,
                2e-4,
                0.001,
                0.014,
                "N·m",
                ("M18",),
            ),
        ),
        orders=tuple(
            OrderLevel(side, ORDER, COGGING_NM[side], 0.0005, 6, 6)
            for side in ("baseline", "candidate")
        ),
        cogging=tuple(make_band(side) for side in ("baseline", "candidate")),
        outliers=(
            Outlier(
                "M3", BEFORE[0], "baseline", "r_phase_ohm", 0.44, "ohm", 4.2, "M3/r.mcap", "4 sd"
            ),
        ),
        golden=(),
        notes=("two stations",),
    )


def make_constant(
    name: str, unit: str, before: float, after: float, spread: float, verdict: Verdict
) -> ConstantResult:
    """Motors spread around a mean a side, the same draw in every lot."""
    draw = spread * np.linspace(-1.0, 1.0, MOTORS_A_LOT)
    motors, lots = [], []
    for place, lot in enumerate((*BEFORE, *AFTER)):
        side: Side = "candidate" if lot in AFTER else "baseline"
        centre = after if side == "candidate" else before
        values = centre + draw
        motors += [
            _motor(f"M{place * MOTORS_A_LOT + n}", lot, side, v) for n, v in enumerate(values)
        ]
        lots.append(
            LotMean(
                lot,
                side,
                None,
                MOTORS_A_LOT,
                float(values.mean()),
                spread / 2.4,
                spread,
                float(values.mean()),
                before - spread,
                before + spread,
                side == "candidate" and verdict == "fail",
            )
        )
    change = after - before
    return ConstantResult(
        name,
        unit,
        name,
        verdict,
        "",
        True,
        25.0,
        tuple(motors),
        tuple(lots),
        Bounds(None, None, None, None, None, 0.0, "simple", None),
        Conformity((), "not_evaluated", None, None, None),
        LotTest("evaluated", 3, 3, 9.0, 2.0, 0.01, 0.02, verdict == "fail"),
        Equivalence("not_evaluated", None, None, None, None, None),
        EffectSize(change, spread, 2.0, 2 * spread, change / before, change / spread),
        Power("lots", None, None, None),
        Capability(None, None, None, None, 0.95),
        (),
        None,
        (),
        (),
    )


def make_band(side: Side) -> CoggingBand:
    """One order, the band as wide as an eighth of it."""
    theta = np.linspace(0.0, 2.0 * np.pi, 361)
    mean = COGGING_NM[side] * np.sin(ORDER * theta)
    width = COGGING_NM[side] / 8.0
    return CoggingBand(
        side,
        MOTORS_A_LOT,
        tuple(theta.tolist()),
        tuple(mean.tolist()),
        tuple((mean - width).tolist()),
        tuple((mean + width).tolist()),
    )


def _motor(motor_id: str, lot: str, side: Side, value: float) -> MotorValue:
    return MotorValue(
        motor_id,
        lot,
        side,
        ("bench-1",),
        value,
        1e-4,
        0.0,
        "pass",
        0.1,
        False,
        f"{motor_id}/a.mcap",
    )


def _group(side: Side, selector: str, lots: tuple[str, ...]) -> Group:
    count = MOTORS_A_LOT * len(lots)
    return Group(side, selector, count, lots, ("bench-1",), ("G52",), ("0.1.0",), (), ())
