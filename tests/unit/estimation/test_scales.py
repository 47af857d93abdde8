"""What another scale of the columns does to every estimator: dimensions, gains, order, copies.

An instrument's gain is a scale of its columns. So what a budget says of it is what a fit of the
scaled columns gives, and the dimension of a constant says how it goes with volts and amperes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.registry import estimators
from pipeline.physics.glossary import COLUMNS, CONSTANTS
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import truth
from tests.recovery.cases_electrical import LONG_HEAT, RESISTANCE, SPINS
from tests.recovery.cases_mechanical import COASTS, COGGING_MOTOR, DRIVES, MAP, TURNS
from tests.recovery.simulated import MOTOR, Plan, recorded
from tests.unit.estimation.signals import known_value

STEPS: Plan = tuple(
    (f"step_{angle:g}", "current_step", {"theta_elec_deg": angle, "samples_tau": 12.0})
    for angle in (-30.0, 60.0)
)
PLANS: dict[str, Plan] = {
    "current_step": STEPS,
    "open_circuit": SPINS,
    "resistance": RESISTANCE,
    "soak": RESISTANCE,
    "lcr": (("lcr", "lcr", {"pairs": ("ab", "bc", "ca")}),),
    "hand_turn": (("hand_turn", "hand_turn", {}), ("other", "hand_turn", {"with_angle": False})),
    "heat_run": LONG_HEAT,
    "thermal": LONG_HEAT,
    "spin_down": COASTS,
    "torque_map": MAP,
    "inductance_rated": MAP,
    "torque_table": (("torque_table", "torque_table", {}),),
    "flux_map": (("flux_map", "flux_map", {}),),
    "cogging": TURNS,
    "holding_current": (("holding_current", "holding_current", {}),),
    "drive_voltage": (("drive_0", "drive", {"voltage_timing": "held"}),),
    "q_inductance": (("drive_0", "drive", {"voltage_timing": "held"}),),
    "inertia": DRIVES,
}
FEW = [
    pytest.param(one, marks=pytest.mark.slow if one in ("current_step", "torque_map") else ())
    for one in PLANS
]
"""For properties that hang on how captures are read; these two take as long as all others."""
ESTIMATORS = {one.name: one for one in estimators()}
U = 1e-3
KEYS = ("u_rel_voltage", "u_rel_current", "u_rel_torque")
# Of a unit: powers of volt and ampere, with N·m = V·A·s and kg·m² = V·A·s³.
POWERS = {
    "V": (1, 0), "Wb": (1, 0), "A": (0, 1), "ohm": (1, -1), "H": (1, -1), "N": (1, 1),
    "kg": (1, 1), "W": (1, 1), "J": (1, 1),
}  # fmt: skip


def dimension(unit: str) -> tuple[float, float]:
    """Powers of volt and ampere in a unit of the glossary."""
    total = np.zeros(2)
    for place, part in enumerate(unit.split("/")):
        share = 0.5 if part.startswith("sqrt(") else 1.0
        for factor in part.removeprefix("sqrt(").rstrip(")").split("·"):
            name, power = (factor[:-1], 2.0) if factor.endswith("²") else (factor, 1.0)
            sign = 1.0 if place == 0 else -1.0
            total += sign * share * power * np.array(POWERS.get(name, (0, 0)))
    return float(total[0]), float(total[1])


def test_dimensions() -> None:
    assert dimension("N·m/sqrt(W)") == (0.5, 0.5)
    assert dimension("V·s/rad") == (1.0, 0.0)
    assert dimension("kg·m²") == (1.0, 1.0)
    assert dimension("H") == dimension("ohm") == (1.0, -1.0)
    assert dimension("K/W") == (-1.0, -1.0)
    assert dimension("rpm/V") == (-1.0, 0.0)
    assert dimension("1/K") == dimension("degC") == (0.0, 0.0)


@cache
def campaign(name: str) -> Campaign:
    """The captures of an estimator, with gains of U and thermometers without an offset."""
    motor = COGGING_MOTOR if name in ("cogging", "holding_current") else MOTOR
    made, _ = recorded(PLANS[name], 5, motor)
    gains = {**dict.fromkeys(KEYS, U), "u_temp_degc": 0.0, "u_rel_clock": 0.0}
    return Campaign(
        made.motor_id,
        tuple(replace(c, meta=replace(c.meta, **gains)) for c in made.captures),
    )


@cache
def known(name: str) -> Constants:
    """What the estimator uses, as true of the motor and free of doubt."""
    true = truth(MOTOR)["constants"]
    uses = [n for n in ESTIMATORS[name].uses if true.get(n) is not None]
    return Constants(tuple(known_value(n, true[n], unit=CONSTANTS[n].unit) for n in uses))


def scaled(made: Campaign, factors: Mapping[str, float]) -> Campaign:
    """The campaign with each column, and the DC link, times the factor of its unit."""

    def table(one: pl.DataFrame) -> pl.DataFrame:
        units = {n: COLUMNS[n].unit for n in one.columns if n in COLUMNS}
        return one.with_columns(
            **{n: pl.col(n) * factors[unit] for n, unit in units.items() if unit in factors}
        )

    return Campaign(
        made.motor_id,
        tuple(
            replace(
                c,
                meta=replace(c.meta, vdc_v=c.meta.vdc_v and c.meta.vdc_v * factors.get("V", 1.0)),
                tables=tuple(table(t) for t in c.tables),
            )
            for c in made.captures
        ),
    )


def fitted(name: str, made: Campaign, given: Constants | None = None, volts: float = 1.0) -> Fit:
    """What the estimator finds; options in volts are as large as the machine."""
    one: Estimator = ESTIMATORS[name]
    options = {k: v * volts if k.endswith("_v") else v for k, v in one.options.items()}
    return one.fit(made, known(name) if given is None else given, options)


@cache
def plain_fit(name: str) -> Fit:
    """What it finds in the captures as they are."""
    return fitted(name, campaign(name))


def by_source(estimate: Estimate) -> dict[str, float]:
    """Signed contribution of each source."""
    total: dict[str, float] = {}
    for part in estimate.budget:
        total[part.source] = total.get(part.source, 0.0) + part.u
    return total


VOLTS, AMPS = 4.0, 2.0


def factor_of(unit: str) -> float:
    volts, amps = dimension(unit)
    return float(VOLTS**volts * AMPS**amps)


def of_condition(name: str) -> float:
    """The factor of a condition, whose unit ends its name."""
    units = {"a": "A", "v": "V", "h": "H", "nm": "N·m", "ohm": "ohm"}
    return factor_of(units.get(name.rsplit("_", 1)[-1], "1"))


@pytest.mark.parametrize("name", PLANS)
def test_no_result_depends_on_the_size_of_the_machine(name: str) -> None:
    """Volts times four, amperes times two: every number goes with its dimension, and so does its u.

    Powers of two are exact in binary, so that nothing but a number with a hidden dimension differs.
    """
    units = {t.unit for t in COLUMNS.values()}
    factors = {unit: factor_of(unit) for unit in units if dimension(unit) != (0.0, 0.0)}
    given = Constants(
        tuple(replace(e, value=e.number * factor_of(e.unit)) for e in known(name).estimates)
    )
    plain = plain_fit(name)
    larger = fitted(name, scaled(campaign(name), factors), given, VOLTS)
    for one, other in zip(plain.estimates, larger.estimates, strict=True):
        assert (one.name, one.status) == (other.name, other.status)
        if not one.known:
            continue
        times = factor_of(one.unit)
        assert other.number == pytest.approx(times * one.number, rel=1e-6), one.name
        expected = {s: times * u for s, u in by_source(one).items()}
        size = 1e-6 * times * one.u
        assert by_source(other) == pytest.approx(expected, rel=1e-4, abs=size), one.name
        assert other.dof == pytest.approx(one.dof, rel=1e-4), one.name
        assert other.captures == one.captures
        held = {k: v * of_condition(k) for k, v in one.at.items()}
        assert other.at == pytest.approx(held, rel=1e-4)
    for one, other in zip(plain.evidence, larger.evidence, strict=True):
        terms = COLUMNS | CONSTANTS
        x, y = (
            factor_of(terms[n].unit) if n in terms else math.nan for n in (one.x_name, one.y_name)
        )
        for a, b in zip(one.series, other.series, strict=True):
            for times, p, q in (
                (x, a.x, b.x),
                (y, a.measured, b.measured),
                (y, a.fitted, b.fitted),
            ):
                if math.isfinite(times):
                    size = 1e-6 * times * float(np.abs(p).max(initial=0.0))
                    assert q == pytest.approx(times * p, rel=1e-4, abs=size), one.title


GAINS = {"voltage": ("V", "Wb"), "current": ("A",), "torque": ("N·m",)}


@pytest.mark.parametrize("name", PLANS)
def test_a_budget_says_what_a_gain_does(name: str) -> None:
    """All readings of an instrument larger by its standard uncertainty: the shift is its part."""
    plain = {e.name: e for e in plain_fit(name).estimates if e.known}
    for gain, units in GAINS.items():
        factors = dict.fromkeys(units, 1.0 + U)
        moved = {e.name: e for e in fitted(name, scaled(campaign(name), factors)).estimates}
        for one in plain.values():
            other = moved[one.name]
            assert other.known, one.name
            parts = {s: u for s, u in by_source(one).items() if s.split("@")[0].startswith(gain)}
            said = sum(parts.values())
            shift = other.number - one.number
            # second order of U, and what a choice of rows may move within the scatter
            room = 0.03 * abs(said) + 3.0 * U * U * abs(one.number)
            assert shift == pytest.approx(said, abs=room), (one.name, gain)


WARM = ("resistance", "open_circuit", "torque_map", "heat_run", "inertia", "hand_turn")


@pytest.mark.parametrize("name", WARM)
def test_a_budget_says_what_a_thermometer_does(name: str) -> None:
    """All temperatures higher by a standard uncertainty of 0.2 K."""
    offset, made = 0.2, campaign(name)
    made = Campaign(
        made.motor_id,
        tuple(replace(c, meta=replace(c.meta, u_temp_degc=offset)) for c in made.captures),
    )

    def warmer(table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(pl.col("^temp_.*_degc$") + offset)

    hot = Campaign(
        made.motor_id,
        tuple(replace(c, tables=tuple(warmer(t) for t in c.tables)) for c in made.captures),
    )
    for one, other in zip(fitted(name, made).estimates, fitted(name, hot).estimates, strict=True):
        if one.known:
            said = sum(u for s, u in by_source(one).items() if s.startswith("temperature"))
            room = 0.05 * abs(said) + 1e-5 * abs(one.number)
            assert other.number - one.number == pytest.approx(said, abs=room), one.name


@pytest.mark.parametrize("name", FEW)
def test_the_order_of_captures_changes_nothing(name: str) -> None:
    made = campaign(name)
    turned = Campaign(made.motor_id, made.captures[::-1])
    for one, other in zip(plain_fit(name).estimates, fitted(name, turned).estimates, strict=True):
        assert other.value == pytest.approx(one.value, rel=1e-6)
        if one.known:
            assert other.u == pytest.approx(one.u, rel=1e-3), one.name
            assert sorted(other.captures) == sorted(one.captures)


CLOCKED = [name for name in PLANS if name != "lcr"]


@pytest.mark.parametrize("name", CLOCKED)
def test_a_constant_goes_with_the_power_of_the_clock_that_is_said(name: str) -> None:
    """A clock fast by a share g makes times longer and speeds lower by it."""
    said, made = ESTIMATORS[name].clock_powers, campaign(name)
    fast = scaled(made, {"s": 1.0 + U, "rad/s": 1.0 / (1.0 + U)})
    for one, other in zip(plain_fit(name).estimates, fitted(name, fast).estimates, strict=True):
        if not one.known:
            continue
        expected = one.number * (1.0 + U) ** said.get(one.name, 0)
        assert other.number == pytest.approx(expected, abs=0.05 * U * abs(one.number)), one.name


def alike(one: Estimate, other: Estimate) -> None:
    """The same number, within a thousandth of its uncertainty, and as well known."""
    assert (one.name, one.status) == (other.name, other.status)
    if one.known:
        assert other.number == pytest.approx(one.number, rel=1e-9, abs=1e-3 * one.u), one.name
        assert other.u == pytest.approx(one.u, rel=1e-3), one.name


@pytest.mark.parametrize("name", FEW)
def test_no_result_depends_on_when_a_clock_began(name: str) -> None:
    """Two hours, which doubles hold to a part in 1e12 of a second."""
    made = campaign(name)
    late = tuple(
        replace(
            c,
            tables=tuple(
                t.with_columns(pl.col("t_s") + 7200.0) if "t_s" in t.columns else t
                for t in c.tables
            ),
        )
        for c in made.captures
    )
    plain, other = plain_fit(name), fitted(name, replace(made, captures=late))
    for one, two in zip(plain.estimates, other.estimates, strict=True):
        alike(one, two)


# A row of these is a measurement of its own.
TABLES = {"flux_map", "lcr", "torque_table", "holding_current"}


@pytest.mark.parametrize("end", ["first", pytest.param("last", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", sorted(set(PLANS) - TABLES))
def test_a_capture_that_cannot_be_used_keeps_no_other_from_it(name: str, end: str) -> None:
    """Three of its rows, before or after the others."""
    made = campaign(name)
    for whole in {c.meta.test: c for c in made.captures}.values():
        brief = replace(
            whole,
            path="0" if end == "first" else "z",
            sha256="f" * 64,
            tables=tuple(t.head(3) for t in whole.tables),
        )
        beside = (brief, *made.captures) if end == "first" else (*made.captures, brief)
        plain, other = plain_fit(name), fitted(name, replace(made, captures=beside))
        for one, two in zip(plain.estimates, other.estimates, strict=True):
            alike(one, two)
