"""The numbers of a motor datasheet for people: rows with intervals, conditions, blanks, losses."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.notation import Reading, quantity, reading, scale_for
from pipeline.records.performance import Blank, Derived, MapCell, Operation, Performance
from pipeline.views.constants import sentence

RPM = 9.549296585513721
LOSS_POINTS = 4
EXACT = 1e-6
"""Half an interval over the value below which a number is a condition and has none."""


@dataclass(frozen=True, slots=True)
class NumberRow:
    """One number: words, reading with half its 95 % interval, rpm beside rad/s, how it came."""

    words: str
    reading: Reading
    also: str
    formula: str
    convention: str


@dataclass(frozen=True, slots=True)
class LossRow:
    """One operating point with its losses by place, every text ready to be shown."""

    speed: str
    torque: str
    out: str
    copper: str
    rotation: str
    inverter: str
    efficiency: str


@dataclass(frozen=True, slots=True)
class PerformanceView:
    """`conditions` are what it holds at as (name, value, where from); `losses` some points of the
    map from the least to the most power.
    """

    rows: tuple[NumberRow, ...]
    conditions: tuple[tuple[str, str, str], ...]
    losses: tuple[LossRow, ...]
    blanks: tuple[Blank, ...]
    notes: tuple[str, ...]


def performance_view(performance: Performance) -> PerformanceView:
    """The view of a motor's performance.

    Parameters
    ----------
    performance
        The performance of the motor.

    """
    return PerformanceView(
        tuple(_row(one) for one in performance.numbers),
        () if performance.operation is None else _conditions(performance.operation),
        tuple(_loss(cell) for cell in _spread(performance.cells)),
        performance.blanks,
        performance.notes,
    )


def _row(one: Derived) -> NumberRow:
    half = 0.5 * (one.high - one.low)
    u = 0.5 * half if half > EXACT * abs(one.value) else 0.0
    shown = reading(one.value, u, one.unit)
    if not u:
        plain = scale_for(abs(one.value), one.unit)
        shown = Reading(f"{plain.shown(one.value):.4g}", "", plain.unit, plain.exponent)
    also = f"{one.value * RPM:.0f} rpm" if one.unit == "rad/s" else ""
    return NumberRow(sentence(one.words), shown, also, one.formula, one.convention)


def _conditions(one: Operation) -> tuple[tuple[str, str, str], ...]:
    stated = [
        ("DC bus voltage", quantity(one.vdc_v, "V", 3), "vdc_v"),
        ("share of it that is used", f"{one.voltage_share:g}", "voltage_share"),
        ("current limit, phase peak", quantity(one.current_a, "A", 3), "current_a"),
        ("winding, peak curve", quantity(one.temp_winding_degc, "degC", 3), "temp_winding_degc"),
        ("magnet, peak curve", quantity(one.temp_magnet_degc, "degC", 3), "temp_magnet_degc"),
        ("ambient", quantity(one.temp_ambient_degc, "degC", 3), "temp_ambient_degc"),
        ("winding's limit", quantity(one.temp_limit_degc, "degC", 3), "temp_limit_degc"),
    ]
    return tuple((words, value, one.origin.get(name, "stated")) for words, value, name in stated)


def _spread(cells: tuple[MapCell, ...]) -> list[MapCell]:
    """A few points from the least to the most shaft power."""
    ordered = sorted(cells, key=lambda c: c.omega_mech_rad_s * c.torque_shaft_nm)
    if len(ordered) <= LOSS_POINTS:
        return ordered
    return [ordered[round(k * (len(ordered) - 1) / (LOSS_POINTS - 1))] for k in range(LOSS_POINTS)]


def _loss(cell: MapCell) -> LossRow:
    percent = reading(100.0 * cell.efficiency, 25.0 * (cell.high - cell.low), "%")
    return LossRow(
        f"{cell.omega_mech_rad_s * RPM:.0f} rpm",
        quantity(cell.torque_shaft_nm, "N·m", 3),
        quantity(cell.torque_shaft_nm * cell.omega_mech_rad_s, "W", 3),
        quantity(cell.copper_w, "W", 3),
        quantity(cell.rotation_w, "W", 3),
        "" if cell.inverter_w is None else quantity(cell.inverter_w, "W", 3),
        percent.text(),
    )
