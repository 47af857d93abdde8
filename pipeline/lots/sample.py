"""Datasheets as samples of one constant: values at one temperature, with station and capture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.lot_constant import Side

NO_LOT = "(no lot)"
SLACK_K = 0.5
# What a constant scales with, and so which temperature its datasheet must state.
WINDING = ("r_phase_ohm", "r_ll_ohm")
MAGNET = (
    "psi_pm_wb",
    "ke_phase_peak_v_s_rad",
    "ke_ll_peak_v_s_rad",
    "ke_ll_rms_v_s_rad",
    "ke_ll_peak_v_krpm",
    "kv_ll_peak_rpm_v",
    "kt_peak_nm_a",
    "kt_rms_nm_a",
    "kt_from_ke_nm_a",
)
PLACES: Mapping[str, tuple[str, str]] = {
    **dict.fromkeys(WINDING, ("temp_winding_degc", "temp_coeff_copper_1_k")),
    **dict.fromkeys(MAGNET, ("temp_magnet_degc", "temp_coeff_magnet_1_k")),
}
INVERSE = ("kv_ll_peak_rpm_v",)


@dataclass(frozen=True, slots=True)
class Member:
    """One datasheet version in a comparison; `when` orders lots: the first capture's start.

    `side` None is a version that is there for its station or its repetition alone.
    """

    sheet: Datasheet
    side: Side | None
    when: str

    @property
    def lot(self) -> str:
        """The lot's name."""
        return self.sheet.lot or NO_LOT


@dataclass(frozen=True, slots=True)
class Value:
    """The value of one motor at the reference temperature.

    Attributes
    ----------
    motor_id, lot, side
        The motor.
    station, stations
        Stations of its captures, joined and one by one; None where none is stated.
    value, u, u_a
        Value, combined and type A standard uncertainty [unit].
    shared
        Signed type B contributions by source [unit].
    captures, inputs
        Paths and digests of the captures that it rests on.

    """

    motor_id: str
    lot: str
    side: Side | None
    station: str | None
    stations: tuple[str, ...]
    value: float
    u: float
    u_a: float
    shared: Mapping[str, float]
    captures: tuple[str, ...]
    inputs: frozenset[str]


def values_of(name: str, members: Iterable[Member]) -> tuple[list[Value], list[str]]:
    """The values of a constant at 25 degC, and why a datasheet that should have one has none.

    Parameters
    ----------
    name
        Of the constant.
    members
        Datasheets.

    Returns
    -------
    values
        One a datasheet that has it; a stated constant is none.
    missing
        `motor: reason`, one each of the others.

    Notes
    -----
    Copper and magnets: x(25) = x(T)/(1 + α (T − 25)), α of the motor itself, or copper's 1/259.5 K
    for a resistance. A magnet's constant without α counts within `SLACK_K` of 25 degC only.

    """
    values, missing = [], []
    for member in members:
        estimate = member.sheet.constants.get(name)
        if estimate is None or estimate.value is None or estimate.status == "stated":
            note = "no estimate" if estimate is None else estimate.note or "stated, not measured"
            missing.append(f"{member.sheet.motor_id}: {note}")
            continue
        factor, trouble = _to_reference(name, estimate, member.sheet)
        if trouble:
            missing.append(f"{member.sheet.motor_id}: {trouble}")
            continue
        values.append(_value(member, estimate, factor))
    return values, missing


def _value(member: Member, estimate: Estimate, factor: float) -> Value:
    own = [c for c in member.sheet.captures if c.path in estimate.captures]
    used = own or list(member.sheet.captures)
    stations = tuple(sorted({c.station for c in used if c.station}))
    return Value(
        motor_id=member.sheet.motor_id,
        lot=member.lot,
        side=member.side,
        station="+".join(stations) or None,
        stations=stations,
        value=estimate.number * factor,
        u=estimate.u * factor,
        u_a=estimate.u_a * factor,
        shared={part.source: part.u * factor for part in estimate.budget if part.kind == "B"},
        captures=tuple(estimate.captures),
        inputs=frozenset(c.sha256 for c in used),
    )


def _to_reference(name: str, estimate: Estimate, sheet: Datasheet) -> tuple[float, str]:
    """The factor that brings a value to 25 °C, and why there is none.

    Copper and magnets: x(25) = x(T)/(1 + α (T − 25)), α of the motor itself or copper's.
    """
    place, coefficient = PLACES.get(name, ("", ""))
    if not place:
        return 1.0, ""
    stated = estimate.at.get(place)
    if not isinstance(stated, (int, float)):
        return 1.0, f"{name} states no {place}, and is compared at one temperature only"
    excess = float(stated) - REFERENCE_DEGC
    if excess == 0.0:
        return 1.0, ""
    known = sheet.constants.get(coefficient)
    alpha = known.number if known is not None and known.known else None
    if alpha is None and name in WINDING:
        alpha = COPPER_COEFFICIENT_25_1_K
    if alpha is None:
        if abs(excess) < SLACK_K:
            return 1.0, ""
        return 1.0, f"{name} holds at {stated:g} degC, and {coefficient} is not known"
    warm = 1.0 + alpha * excess
    return (warm if name in INVERSE else 1.0 / warm), ""


def independent(values: Sequence[Value]) -> list[Value]:
    """The values that rest on captures of their own.

    Parameters
    ----------
    values
        In order; of those that share a capture, the first is kept.

    """
    used: set[tuple[str, str]] = set()
    kept = []
    for one in values:
        keys = {(one.motor_id, digest) for digest in one.inputs}
        if not keys & used:
            kept.append(one)
            used |= keys
    return kept


def lots_in_order(members: Iterable[Member]) -> list[tuple[str, str]]:
    """Lots in the order of their first start.

    Parameters
    ----------
    members
        Datasheets.

    Returns
    -------
    list of (lot, start)
        Start as in `Member.when`.

    """
    first: dict[str, str] = {}
    for member in members:
        first[member.lot] = min(first.get(member.lot, member.when), member.when)
    return sorted(first.items(), key=lambda item: (item[1], item[0]))
