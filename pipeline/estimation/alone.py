"""What each capture says by itself: the same constants, fitted to one capture at a time.

Two captures that measure a quantity alike (one test, one pair, one place of the rotor) must agree
within what each cannot know; if they do not, they are not of one motor, or an instrument changed
between them. Instruments that two captures share keep their names in the budgets, so that a gain
that both have in common parts nothing; scatter is each capture's own.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.estimation.electrical.link import largest, link_voltage_v
from pipeline.estimation.policy import changed, policy, under
from pipeline.estimation.registry import fit_all
from pipeline.records.agreement import Reading, Way
from pipeline.records.capture import Campaign, Capture
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Budget, Contribution, coverage_factor

Options = Mapping[str, Mapping[str, float]]
LOADED = ("torque_map", "drive", "heat_run")
"""Tests that warm a motor, and leave it warm."""
LINES = ("ia_a", "ib_a", "ic_a")
TEMPERATURES = ("temp_magnet_degc", "temp_winding_degc")


class Quantity(NamedTuple):
    """A quantity that constants of several methods give: value = factor * constant [unit]."""

    name: str
    unit: str
    factor: float = 1.0


# The torque constant is 1.5 p psi in the amplitude-invariant frame.
QUANTITIES: Mapping[str, Quantity] = {
    "pole_pairs": Quantity("pole_pairs", "1"),
    "ke_phase_peak_v_s_rad": Quantity("p·psi", "V·s/rad"),
    "kt_peak_nm_a": Quantity("p·psi", "V·s/rad", 1.0 / 1.5),
    "r_phase_ohm": Quantity("r_phase_ohm", "ohm"),
    "ld_h": Quantity("ld_h", "H"),
    "lq_h": Quantity("lq_h", "H"),
}


def repeated(campaign: Campaign) -> tuple[Capture, ...]:
    """The captures that another one of the campaign measures alike.

    Parameters
    ----------
    campaign
        All captures of one motor.

    Returns
    -------
    tuple of Capture
        In order of the campaign.

    """
    ways = {capture.path: _way(capture) for capture in campaign.captures}
    counts = Counter(ways.values())
    return tuple(c for c in campaign.captures if counts[ways[c.path]] > 1)


def readings(
    campaign: Campaign, captures: Iterable[Capture], options: Options
) -> tuple[Reading, ...]:
    """Each quantity that each capture determines alone; what it does not determine is left out.

    Parameters
    ----------
    campaign
        All captures of the motor, which say whether a load had warmed it.
    captures
        Those of them to read; each is fitted by itself, by every estimator that takes its test.
    options
        Of the estimators, as in `fit_all`.

    """
    with under(changed(options)):
        return _readings(campaign, captures, options)


def _readings(
    campaign: Campaign, captures: Iterable[Capture], options: Options
) -> tuple[Reading, ...]:
    readings: list[Reading] = []
    warmed = any(capture.meta.test in LOADED for capture in campaign.captures)
    for capture in captures:
        alone = Campaign(campaign.motor_id, (capture,))
        constants, _, _ = fit_all(alone, options, only=frozenset(QUANTITIES))
        for name, quantity in QUANTITIES.items():
            estimate = constants.best(name)
            if estimate is None or estimate.status != "measured" or estimate.number <= 0.0:
                continue
            reading = _reading(capture, estimate, quantity, warmed)
            if math.isfinite(reading.u_rel_model):
                readings.append(reading)
    return tuple(readings)


def _reading(capture: Capture, estimate: Estimate, quantity: Quantity, warmed: bool) -> Reading:
    return Reading(
        quantity.name,
        (estimate.method, *_way(capture)),
        capture.path,
        quantity.factor * estimate.number,
        quantity.unit,
        _own_scatter(estimate.budget, quantity.factor, capture.path),
        math.hypot(_spread(capture, quantity.name, warmed), _inverter(capture, estimate)),
    )


def _own_scatter(budget: Budget, factor: float, path: str) -> Budget:
    """The budget [unit of the quantity], scatter under the capture's name.

    Few degrees of freedom widen a part as they widen its interval, for the test counts in normal
    deviates.
    """
    parts: list[Contribution] = []
    for part in budget:
        u = factor * part.u * coverage_factor(part.dof) / coverage_factor(math.inf)
        source = f"{part.source}#{path}" if part.kind == "A" else part.source
        parts.append(replace(part, source=source, u=u, dof=math.inf))
    return tuple(parts)


def _spread(capture: Capture, quantity: str, warmed: bool) -> float:
    """The relative standard uncertainty of the method from one capture to the next [1].

    A motor that some test `warmed` may be warm in any other.
    """
    spreads = policy().capture_spread
    if quantity == "pole_pairs":
        return spreads.count
    if quantity in ("ld_h", "lq_h"):
        return spreads.inductance
    if quantity == "r_phase_ohm":
        logged = capture.has("temp_winding_degc")
        spread = (
            spreads.resistance_temperature_known
            if logged
            else spreads.resistance_temperature_unknown
        )
    elif not any(capture.has(name) for name in TEMPERATURES):
        cold = (
            spreads.flux_temperature_unpowered
            if capture.meta.ambient_degc is None
            else spreads.flux_temperature_known
        )
        spread = spreads.flux_temperature_unknown if warmed else cold
    elif capture.meta.test == "torque_map":
        spread = spreads.torque
    else:
        spread = spreads.flux_temperature_known
    return max(spread, spreads.log) if capture.meta.test == "drive" else spread


def _inverter(capture: Capture, estimate: Estimate) -> float:
    """What an inverter's unknown voltage is of a constant read from a commanded one [1].

    The voltage over that which the constant makes up at the capture's largest speed or current.
    """
    by_voltage = any(part.source.startswith("voltage_commanded@") for part in estimate.budget)
    if not by_voltage or not capture.has("vq_v"):
        return 0.0
    unknown_v = policy().capture_spread.inverter * link_voltage_v(capture)
    names = ("id_a", "iq_a") if estimate.unit == "ohm" else ("omega_mech_rad_s",)
    reach = max(largest(capture, name) for name in names)
    if not reach and estimate.unit != "ohm" and capture.has("theta_mech_rad"):
        reach = _fastest_rad_s(capture)
    return unknown_v / (estimate.number * reach) if reach else math.inf


def _fastest_rad_s(capture: Capture) -> float:
    """The speed that the angle reaches, over pieces of a hundredth of the capture [rad/s]."""
    t_s, angle = capture.finite("t_s", "theta_mech_rad", needed=("theta_mech_rad",)).values()
    step = max(1, t_s.size // 100)
    speed = np.abs(np.diff(angle[::step]) / np.diff(t_s[::step]))
    return float(np.percentile(speed, 95.0)) if speed.size else 0.0


def _way(capture: Capture) -> Way:
    """What two captures must have in common to measure alike."""
    meta = capture.meta
    place: Way = (meta.test, meta.pair or "", meta.voltage_kind or "")
    if meta.test != "current_step":
        return place
    angle = "" if meta.theta_elec_deg is None else f"{meta.theta_elec_deg % 180.0:.0f}"
    return (*place, angle, _height(capture))


def _height(capture: Capture) -> str:
    """The class of a step's largest current, a quarter wide: inductance falls with current."""
    names = [name for name in LINES if capture.has(name)]
    largest = [np.nanmax(np.abs(c), initial=0.0) for c in capture.arrays(*names).values()]
    highest = float(max(largest, default=0.0))
    return f"{round(math.log(highest) / math.log(1.25))}" if highest > 0.0 else ""
