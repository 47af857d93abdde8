"""Cogging orders and creep friction from a slow turn at zero current, both ways."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from pipeline.estimation.mechanical.slow_turns import (
    of_still_shaft,
    part_orders,
    past_doubt,
    slots_and_pole_pairs,
    slow_turns,
    torque_turns,
)
from pipeline.estimation.method import Method
from pipeline.estimation.policy import DEFAULT, policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import instrument_uncertainties, unstated_note
from pipeline.numerics.order_waveform import half_peak_to_peak, waveform
from pipeline.numerics.orders import OrderLine, detection_limit, find_orders, phase_modulated
from pipeline.numerics.turns import Spectrum, Turn, largest_order, noise_power
from pipeline.physics.mechanics import cogging_order
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, Order
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

METHOD = Method("cogging")
COGGING = ("cogging_order", "cogging_amplitude_nm", "cogging_peak_nm")
GIVES = (*COGGING, "torque_coulomb_nm")
AIDS = ("pole_pairs", "coast_coulomb_rad_s2", "coast_viscous_1_s", "j_rotor_kgm2")
EXPERIMENT = (
    "record a cogging test: zero current, at least one slow whole turn each way, with "
    "theta_mech_rad and torque_shaft_nm"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Orders of T(theta) that repeat from turn to turn, and the drag that changes with direction.

    Notes
    -----
    T_shaft = T_0 - T_c sign(ω) - Σ_k Re(c_k e^{j k θ})

    The coefficients c_k are those of each whole turn (numerics.orders); an order is there where
    its mean over the turns stands out of what they scatter. The mean over both directions holds
    the cogging, half their difference the friction. Where the inertia is known, what the shaft
    itself shakes at an order is added (`slow_turns.of_still_shaft`).

    References
    ----------
    Zhu and Howe, IEEE Trans. Energy Convers. 15(4), 2000, 407, doi:10.1109/60.900501 (which orders
    a motor makes).

    """
    captures = slow_turns(campaign)
    turns = torque_turns(captures)
    if len(turns) < 2:
        note = f"{len(turns)} whole turns recorded; {EXPERIMENT}"
        return METHOD.nothing(GIVES, note)
    highest = largest_order(turns, int(options["highest_order"]))
    spec, lines = find_orders(turns, highest, options["level"])
    counting, unexplained = past_doubt(lines, known, campaign)
    counting = of_still_shaft(counting, captures, known.best("j_rotor_kgm2"))
    by_cause = *part_orders(counting, known, campaign), unexplained
    estimates = _cogging(captures, spec, by_cause, known, campaign, options)
    friction = _friction(captures, turns, spec, known)
    top, by_coast = _top_speed_rad_s(campaign), _coast_known(known)
    creep = mean_speed_rad_s(captures)
    estimates += (friction if by_coast else _with_viscous_doubt(friction, creep, top),)
    return Fit(estimates, _evidence(turns, spec, by_cause[0]))


def peak_orders(
    lines: Sequence[OrderLine], spec: Spectrum, teeth: Sequence[int], sides: Sequence[OrderLine]
) -> list[OrderLine]:
    """The orders that the peak is made of: what the motor can make, and others past doubt.

    Parameters
    ----------
    lines
        Orders found, the leading one first.
    spec
        Their spectrum.
    teeth
        Slots and poles a turn, as far as they are known.
    sides
        Sidebands of the encoder.

    Returns
    -------
    list of OrderLine
        Multiples of the leading order, of `teeth` and the encoder's sidebands as found; others only
        where p < `cogging.stranger_level`; and the second and third multiple of the leading order,
        found or not.

    Notes
    -----
    Over a turn the crest of any further order meets that of the others somewhere, so a false one
    adds its whole height. The second and third multiple bend the crests of every real motor, and as
    measured they are unbiased.

    """
    leading = lines[0].order
    known = [leading, *teeth]
    selected = [
        line
        for line in lines
        if line in sides
        or line.p_value < policy().cogging.stranger_level
        or any(line.order % order == 0 for order in known)
    ]
    orders = {line.order for line in selected}
    local, _, dof = noise_power(spec)
    for order in (2 * leading, 3 * leading):
        if order not in orders and order <= int(spec.orders[-1]):
            mean = complex(spec.coefficients[:, order - 1].mean())
            u = float(np.sqrt(local[order - 1] / (2.0 * spec.turns)))
            selected.append(OrderLine(order, mean, u, dof, 1.0))
    return selected


def _teeth(known: Constants, campaign: Campaign) -> list[int]:
    """Slots and poles a turn, as far as they are known."""
    slots, pairs = slots_and_pole_pairs(known, campaign)
    return [n for n in (slots or 0, 2 * (pairs or 0)) if n > 1]


def name_orders(lines: Sequence[OrderLine], known: Constants, campaign: Campaign) -> str:
    """What each order found says of the motor, in words."""
    slots, pairs = slots_and_pole_pairs(known, campaign)
    both = [(cogging_order(slots, pairs), " (LCM of slots and poles)")] if slots and pairs else []
    causes = [*both, (slots, " (slots)"), (2 * (pairs or 0), " (poles)"), (pairs, " (pole pairs)")]
    words = []
    for line in lines[:8]:
        why = next((why for order, why in causes if order and line.order % order == 0), "")
        words.append(f"{line.order}{why}: {line.amplitude:.3g}")
    return ", ".join(words)


def _cogging(
    captures: Sequence[Capture],
    spec: Spectrum,
    by_cause: tuple[Sequence[OrderLine], Sequence[OrderLine], Sequence[OrderLine]],
    known: Constants,
    campaign: Campaign,
    options: Mapping[str, float],
) -> tuple[Estimate, ...]:
    lines, slow, unexplained = by_cause
    also = f"; also {name_orders(slow, known, campaign)} N·m, of unbalance or coupling" * bool(slow)
    if unexplained:
        also += f"; left out: {name_orders(unexplained, known, campaign)} N·m, which no slots or "
        also += "poles make and chance may"
    tested = f"{spec.orders.size} orders tested over {spec.turns} turns at {options['level']:g}"
    if not lines:
        limit = detection_limit(spec, options["level"])
        note = f"no cogging found; an amplitude above {limit:.2g} N·m would have been; {tested}"
        return tuple(METHOD.absent(n, note + also) for n in COGGING)
    leading = lines[0]
    sides = phase_modulated(lines, leading.order)
    amplitude = float(np.sqrt(sum(line.amplitude**2 for line in [leading, *sides])))
    note = f"N·m by order: {name_orders(lines, known, campaign)}; {tested}{also}"
    if known.best("j_rotor_kgm2") is not None:
        note += "; with J times the shaft's own acceleration at each order, where it has a clock"
    if sides:
        note += "; sidebands are those of an eccentric encoder and counted to the amplitude"
    peak, u_peak = half_peak_to_peak(peak_orders(lines, spec, _teeth(known, campaign), sides))
    note = "; ".join(filter(None, (note, unstated_note(captures, ("torque",)))))
    dof = min(line.dof for line in lines)
    order = METHOD.measured("cogging_order", leading.order, captures=captures, notes=note)
    return (
        replace(order, bounds=(1.0, float(spec.orders[-1]))),
        replace(
            _torque("cogging_amplitude_nm", amplitude, leading.u, leading.dof, captures, note),
            orders=_published(lines),
        ),
        _torque("cogging_peak_nm", peak, u_peak, dof, captures, note),
    )  # fmt: skip


def _published(lines: Sequence[OrderLine]) -> tuple[Order, ...]:
    """The orders found, by order."""
    return tuple(
        Order(line.order, line.amplitude, line.u, float(np.angle(line.coefficient)))
        for line in sorted(lines, key=lambda line: line.order)
    )


def _torque(
    name: str,
    value: float,
    u: float,
    dof: float,
    captures: Sequence[Capture],
    note: str,
) -> Estimate:
    parts = [METHOD.scatter(name, u, dof)]
    gains = instrument_uncertainties(captures, ("torque",))
    parts += [Contribution(source, value * gain, "B") for source, gain in gains.items()]
    return METHOD.measured(name, value, parts, captures, notes=note)


def _friction(
    captures: Sequence[Capture], turns: Sequence[Turn], spec: Spectrum, known: Constants
) -> Estimate:
    name = "torque_coulomb_nm"
    forward, backward = spec.means[spec.senses > 0], spec.means[spec.senses < 0]
    if forward.size == 0 or backward.size == 0:
        note = "one sense of rotation only; record the slow turn the other way as well"
        return METHOD.missing(name, note)
    value = float(backward.mean() - forward.mean()) / 2.0
    variance, dof = _variance_of_mean(spec, forward, backward)
    u = float(np.sqrt(variance * (1.0 / forward.size + 1.0 / backward.size)) / 2.0)
    if value < -3.0 * u:
        note = "the shaft torque drives the motion; check the sign of torque_shaft_nm"
        return METHOD.missing(name, note)
    zero = float(backward.mean() + forward.mean()) / 2.0
    speed = mean_speed_rad_s(captures)
    share, words = _viscous_share(speed, known)
    value, u = value * (1.0 - share), u * (1.0 - share)
    note = (
        f"drag at creep speed, with Stribeck's excess in it{words}; transducer zero {zero:.2g} N·m "
        f"parted by direction; {len(turns)} turns"
    )
    torque = _torque(name, value, u, dof, captures, note)
    return torque if speed is None else replace(torque, at={"omega_mech_rad_s": speed})


def _with_viscous_doubt(friction: Estimate, creep: float | None, top: float) -> Estimate:
    """Dry friction at a creep speed [rad/s] with an allowance for the viscous part.

    Viscous drag at the highest speed `top` [rad/s] is between nothing and `viscous_at_top` times
    the dry one, and in proportion to speed below.
    """
    if not friction.known or creep is None or top <= creep:
        return friction
    most = policy().cogging.viscous_at_top * creep / top * friction.number
    part = Contribution("assumed:viscous_share", most / np.sqrt(3.0), "B")
    return replace(friction, budget=(*friction.budget, part))


def _top_speed_rad_s(campaign: Campaign) -> float:
    """Highest speed that captures of a campaign have; 0 of none."""
    name = "omega_mech_rad_s"
    speeds = [capture.arrays(name)[name] for capture in campaign.captures if capture.has(name)]
    return max((float(np.nanmax(np.abs(s))) for s in speeds if np.isfinite(s).any()), default=0.0)


def _coast_known(known: Constants) -> bool:
    """Whether a coast parts viscous from dry friction."""
    coulomb, viscous = known.best("coast_coulomb_rad_s2"), known.best("coast_viscous_1_s")
    return coulomb is not None and viscous is not None and coulomb.number > 0.0


def _viscous_share(speed_rad_s: float | None, known: Constants) -> tuple[float, str]:
    """Share of the drag at this speed that is viscous, by the coast-down's ratio B/T_c."""
    coulomb, viscous = known.best("coast_coulomb_rad_s2"), known.best("coast_viscous_1_s")
    if speed_rad_s is None or coulomb is None or viscous is None or not _coast_known(known):
        return 0.0, " and the viscous part"
    slope = max(viscous.number, 0.0) * speed_rad_s
    return slope / (coulomb.number + slope), ", the viscous part taken off by the coast-down"


def _variance_of_mean(spec: Spectrum, forward: Array, backward: Array) -> tuple[float, float]:
    """Variance of one turn's mean and its dof: the noise at the lowest orders, or the means' own.

    A mean is the coefficient of order 0, whose noise is a quarter of E|c|² next to it.
    """
    local, _, dof = noise_power(spec)
    predicted = float(local[0]) / 4.0
    free = forward.size + backward.size - 2
    if free > 0:
        squares = np.sum((forward - forward.mean()) ** 2) + np.sum(
            (backward - backward.mean()) ** 2
        )
        power = float(squares) / free
        if (
            predicted == 0.0
            or fdtrc(free, dof, power / predicted) < policy().cogging.friction_level
        ):
            return power, float(free)
    return predicted, dof


def mean_speed_rad_s(captures: Sequence[Capture]) -> float | None:
    """Mean speed of slow turns, either sense; None where no angle gives it.

    Parameters
    ----------
    captures
        With or without `t_s` and `theta_mech_rad`; rows without an angle are left out.

    Returns
    -------
    float or None
        [rad/s]. The path is summed over a few hundred points, so that the angle's noise does not
        lengthen it.

    """
    speeds = []
    for capture in captures:
        if not capture.has("t_s", "theta_mech_rad"):
            continue
        t, theta = capture.finite("t_s", "theta_mech_rad").values()
        every = max(1, t.size // 500)
        t, theta = t[::every], theta[::every]
        if t.size > 1:
            speeds.append(float(np.sum(np.abs(np.diff(theta))) / (t[-1] - t[0])))
    return float(np.mean(speeds)) if speeds else None


def _evidence(
    turns: Sequence[Turn], spec: Spectrum, lines: Sequence[OrderLine]
) -> tuple[Evidence, ...]:
    bins = 1800
    series = []
    for sense, label in ((1, "forward"), (-1, "backward")):
        of_sense = [turn for turn in turns if turn.sense == sense]
        if not of_sense:
            continue
        angle = np.concatenate([np.mod(turn.theta_rad, TURN_RAD) for turn in of_sense])
        torque = np.concatenate([turn.value for turn in of_sense])
        index = np.minimum((angle * (bins / TURN_RAD)).astype(np.int64), bins - 1)
        count = np.bincount(index, minlength=bins)
        at = np.flatnonzero(count)
        mean = np.bincount(index, weights=torque, minlength=bins)[at] / count[at]
        where = (at.astype(np.float64) + 0.5) * (TURN_RAD / bins)
        level = float(np.mean(spec.means[spec.senses == sense]))
        series.append(Series(label, where, mean, level + waveform(lines, where)))
    shown = min(2000, max(4 * max((n.order for n in lines), default=0), 200))
    return (
        METHOD.plot(
            "Zero-current torque over one turn", ("theta_mech_rad", "torque_shaft_nm"), "line",
            series, "half the gap between the directions is friction",
        ),
        METHOD.plot(
            "Cogging spectrum", ("cogging_order", "cogging_amplitude_nm"), "bars",
            (spectrum_bars(spec, shown),), "mean over turns and directions",
        ),
    )  # fmt: skip


def spectrum_bars(spec: Spectrum, most: int) -> Series:
    """The mean amplitude of each order a turn, the first `most` of them."""
    heights = np.abs(spec.coefficients.mean(axis=0))[:most]
    return Series("orders", spec.orders[:most].astype(float), heights, np.array([]))


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("cogging",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=AIDS,
    aids=AIDS,
    rank=10,
    options={
        "highest_order": float(DEFAULT.cogging.highest_order),
        "level": DEFAULT.cogging.level,
    },
)
