"""Slow turns at zero current: the orders a turn of their torque, and how the shaft shakes there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.policy import policy
from pipeline.numerics.orders import OrderLine, find_orders, phase_modulated
from pipeline.numerics.turns import Turn, largest_order, spectrum, whole_turns
from pipeline.physics.mechanics import cogging_order
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate


def torque_turns(captures: Sequence[Capture]) -> list[Turn]:
    """The whole turns [N·m] of captures of slow turns; rows without an angle are left out.

    Parameters
    ----------
    captures
        With `theta_mech_rad` and `torque_shaft_nm`.

    """
    turns: list[Turn] = []
    for capture in captures:
        columns = capture.finite("theta_mech_rad", "torque_shaft_nm", needed=("theta_mech_rad",))
        turns += whole_turns(columns["theta_mech_rad"], columns["torque_shaft_nm"])
    return turns


def leading_order(campaign: Campaign, known: Constants) -> int | None:
    """The leading cogging order of the slow turns of a campaign; None where they show none.

    Parameters
    ----------
    campaign
        All captures of one motor. Without slow turns it is that of its slots and poles.
    known
        Constants found so far, for the pole pairs.

    """
    turns = torque_turns(slow_turns(campaign))
    if len(turns) < 2:
        slots, pairs = slots_and_pole_pairs(known, campaign)
        return cogging_order(slots, pairs) if slots and pairs else None
    limits = policy().cogging
    _, lines = find_orders(turns, largest_order(turns, limits.highest_order), limits.level)
    cogging, _ = part_orders(past_doubt(lines, known, campaign)[0], known, campaign)
    return cogging[0].order if cogging else None


def slow_turns(campaign: Campaign) -> list[Capture]:
    """The cogging tests of a campaign that have an angle and a torque."""
    return [c for c in campaign.of("cogging") if c.has("theta_mech_rad", "torque_shaft_nm")]


def of_still_shaft(
    lines: Sequence[OrderLine], captures: Sequence[Capture], inertia: Estimate | None
) -> list[OrderLine]:
    """Orders of the torque as they would be on a shaft that turns evenly.

    Parameters
    ----------
    lines
        Orders of the recorded torque, as coefficients of it.
    captures
        The slow turns, with their clock.
    inertia
        `j_rotor_kgm2`; None where it is not known, and then they stay as they are.

    Returns
    -------
    list of OrderLine
        With J times the acceleration of each order added: between rotor and load a transducer
        shows the torque less that. The uncertainties of J and of the acceleration join in.

    Notes
    -----
    A load that gives way shakes with the rotor. With an inertia J_l of its own it leaves a share
    J_l/(J + J_l) of the torque to see above the resonance of the two.

    """
    turns = [turn for capture in captures for turn in _acceleration_turns(capture)]
    if inertia is None or len(turns) < 2 or not lines:
        return list(lines)
    highest = max(line.order for line in lines)
    coefficients = spectrum(turns, highest).coefficients
    mean = coefficients.mean(axis=0)
    scatter = np.sqrt(np.sum(np.abs(coefficients - mean) ** 2, axis=0) / (len(turns) - 1))
    u_mean = scatter / np.sqrt(2.0 * len(turns))
    return [_moved(line, inertia, complex(mean[line.order - 1]), float(u_mean[line.order - 1]))
            for line in lines]  # fmt: skip


def _moved(
    line: OrderLine, inertia: Estimate, acceleration: complex, u_acceleration: float
) -> OrderLine:
    """A line with J times an acceleration [rad/s²] added."""
    parts = line.u, inertia.number * u_acceleration, inertia.u * abs(acceleration)
    return replace(
        line,
        coefficient=line.coefficient + inertia.number * acceleration,
        u=float(np.linalg.norm(parts)),
    )


def _acceleration_turns(capture: Capture) -> list[Turn]:
    """The whole turns of the angle's second difference [rad/s²]; none without a clock."""
    if not capture.has("t_s"):
        return []
    time, theta = capture.finite("t_s", "theta_mech_rad").values()
    return whole_turns(theta, _second_difference(time, theta)) if time.size > 2 else []


def _second_difference(time_s: Array, theta_rad: Array) -> Array:
    """Acceleration [n, rad/s²] by three rows each; NaN at both ends and beside lost rows."""
    step = np.diff(time_s)
    even = np.maximum(step[1:], step[:-1]) < 1.5 * float(np.median(step))
    pace = np.diff(theta_rad) / np.where(step > 0.0, step, np.inf)
    bend = np.full(time_s.size, np.nan)
    bend[1:-1] = np.where(even, np.diff(pace) / (0.5 * (step[1:] + step[:-1])), np.nan)
    return bend


def past_doubt(
    lines: Sequence[OrderLine], known: Constants, campaign: Campaign
) -> tuple[list[OrderLine], list[OrderLine]]:
    """Parts the orders that count from unexplained ones, which chance may have made.

    Parameters
    ----------
    lines
        Orders found, the strongest first.
    known
        Constants found so far.
    campaign
        Its nameplate, where the pole pairs are not known.

    Returns
    -------
    counting, unexplained
        Neither unbalance nor teeth nor poles nor sidebands of an encoder make the unexplained
        ones, and their p is not below `cogging.stranger_level`. The slots of three phases are a
        multiple of three. Where no pole pairs are known, all orders count.

    Notes
    -----
    Of a thousand orders that are tested at 0.01, one motor in a hundred has a false one, and a
    fleet has many motors.

    """
    slots, pairs = slots_and_pole_pairs(known, campaign)
    if not lines or not pairs:
        return list(lines), []
    teeth, sides = (slots or 3, pairs), phase_modulated(lines, lines[0].order)
    counting = [
        line
        for line in lines
        if line.p_value < policy().cogging.stranger_level
        or line.order <= 2
        or line in sides
        or any(line.order % order == 0 for order in teeth)
    ]
    return counting, [line for line in lines if line not in counting]


def part_orders(
    lines: Sequence[OrderLine], known: Constants, campaign: Campaign
) -> tuple[list[OrderLine], list[OrderLine]]:
    """Parts the orders that teeth and magnets can make from those of a shaft that is not true.

    Parameters
    ----------
    lines
        All orders found.
    known
        Constants found so far.
    campaign
        Its nameplate, where the pole pairs are not known.

    Returns
    -------
    cogging, slow
        Orders 1 and 2 are slow except in a motor of one or two pole pairs or slots: unbalance, a
        bent shaft and an eccentric coupling make them in any motor.

    """
    slots_and_poles = {*slots_and_pole_pairs(known, campaign)} - {None}
    slow = [line for line in lines if line.order <= 2 and not slots_and_poles & {1, line.order}]
    return [line for line in lines if line not in slow], slow


def slots_and_pole_pairs(known: Constants, campaign: Campaign) -> tuple[int | None, int | None]:
    """Slots by the nameplate, and pole pairs as measured, else by the nameplate.

    Parameters
    ----------
    known
        Constants so far.
    campaign
        Captures of the motor.

    """
    slots = campaign.nameplate("slots")
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    return slots if isinstance(slots, int) else None, pairs
