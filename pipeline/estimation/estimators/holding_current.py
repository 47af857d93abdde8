"""Cogging orders from the current that holds a rotor still at many angles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimators.cogging import mean_speed_rad_s, name_orders, spectrum_bars
from pipeline.estimation.mechanical.slow_turns import part_orders, past_doubt, slots_and_pole_pairs
from pipeline.estimation.mechanical.torque_constant import USES, torque_constant
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    current_source,
    instrument_uncertainties,
    unstated_note,
)
from pipeline.numerics.bootstrap import block_bootstrap, block_length
from pipeline.numerics.harmonics import harmonic_design
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.order_waveform import half_peak_to_peak, waveform
from pipeline.numerics.orders import OrderLine, detection_limit, find_orders
from pipeline.numerics.turns import Spectrum, Turn, even_positions, largest_order, whole_turns
from pipeline.physics.glossary import Term
from pipeline.physics.mechanics import cogging_order
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution, propagate

RESIDUAL = Term(
    "holding_residual_a",
    "A",
    "rms of holding current that the cogging orders leave in sectors they were not fitted to",
    "constant",
    0.0,
    5e3,
)
AMPLITUDE = Term(
    "cogging_amplitude_a", "A", "amplitude of the strongest cogging order, as q current",
    "constant", 0.0, 5e3,
)  # fmt: skip
FRICTION = Term(
    "holding_friction_a", "A",
    "q current against friction of slow motion: half of what both senses of arrival differ by",
    "constant", -5e3, 5e3,
)  # fmt: skip
FRICTION_NM = Term(
    "holding_friction_nm", "N·m", "friction of slow motion, Kt times its current",
    "constant", -1e4, 1e4,
)  # fmt: skip
OFFSET = Term(
    "holding_offset_a", "A",
    "mean q current of both senses: a constant load over Kt, and the zero of the current sensor",
    "constant", -5e3, 5e3,
)  # fmt: skip
TERMS = (RESIDUAL, AMPLITUDE, FRICTION, FRICTION_NM, OFFSET)
TORQUES = ("cogging_amplitude_nm", "cogging_peak_nm")
COGGING = ("cogging_order", AMPLITUDE.name, *TORQUES)
COULOMB = "torque_coulomb_nm"
BY_SENSE = (FRICTION.name, FRICTION_NM.name, COULOMB, OFFSET.name)
GIVES = (*COGGING, *BY_SENSE, RESIDUAL.name)
METHOD = Method("holding_current", TERMS)
AT_REST = "assumed:friction_at_rest"
EXPERIMENT = (
    "hold the rotor at many angles over a whole turn, once forward and once backward, "
    "logging theta_mech_rad and iq_a"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Orders of i_q(theta) that both directions share; times Kt they are cogging torque.

    Notes
    -----
    Kt i_q = Σ_k Re(c_k e^{j k θ}) ± T_s at rest, T_s what static friction carries; so orders are
    sure, and amplitudes as good as friction repeats. The test is that of numerics.orders.

    """
    captures = [c for c in campaign.of("holding_current") if c.has("theta_mech_rad", "iq_a")]
    turns: list[Turn] = []
    for capture in captures:
        columns = capture.finite("theta_mech_rad", "iq_a", needed=("theta_mech_rad",))
        turns += whole_turns(columns["theta_mech_rad"], columns["iq_a"])
    highest = largest_order(turns, int(options["highest_order"]))
    if len(turns) < 2 or highest < 1:
        note = f"{len(turns)} whole turns recorded; {EXPERIMENT}"
        return METHOD.nothing(GIVES, note)
    spec, present = find_orders(turns, highest, options["level"])
    positions = even_positions(turns)
    # of few positions an order looks like another, which no slots or poles need make
    counting = present if positions else past_doubt(present, known, campaign)[0]
    lines, slow = part_orders(counting, known, campaign)
    residuals = held_out_residual(turns, [line.order for line in [*lines, *slow]])
    rms_a = None if residuals is None else float(np.sqrt(np.mean(residuals**2)))
    waves = _Waves(captures, spec, lines, positions, rms_a)
    estimates = _cogging(waves, known, campaign)
    if residuals is None or rms_a is None:
        note = f"angles do not cover the turn densely enough to hold sectors out; {EXPERIMENT}"
        residual = METHOD.missing(RESIDUAL.name, note)
    else:
        before = float(np.std(np.concatenate([turn.value for turn in turns])))
        note = f"{before:.3g} A before any order is taken off; half of the turn's sectors held out"
        parts = [METHOD.scatter(RESIDUAL.name, _u_rms(residuals)), *_gains(captures, rms_a)]
        notes = (note, unstated_note(captures, ("current",)))
        residual = METHOD.measured(RESIDUAL.name, rms_a, parts, captures, notes=notes)
    friction = _friction(captures, turns, spec, [*lines, *slow], known)
    return Fit((*estimates, *friction, residual), _evidence(turns, spec, lines))


def _friction(
    captures: Sequence[Capture],
    turns: Sequence[Turn],
    spec: Spectrum,
    lines: Sequence[OrderLine],
    known: Constants,
) -> tuple[Estimate, ...]:
    """What the mean current of whole turns is by sense: friction, and what does not turn with it.

    i = ±T_f/Kt + T_0/Kt + i_0. Of friction that differs by sense and of a constant load both senses
    show the same sum, so that half of the difference and the mean are all there is to know.
    """
    if len(set(spec.senses.tolist())) < 2:
        note = f"turns of one sense alone; {EXPERIMENT}"
        return tuple(METHOD.missing(name, note) for name in BY_SENSE)
    sides = [_mean_of(turns, spec, lines, sense) for sense in (1, -1)]
    (ahead, u_ahead), (back, u_back) = sides
    u, dof = 0.5 * float(np.hypot(u_ahead, u_back)), float(max(len(turns) - 2, 1))
    notes = (
        f"{ahead:.3g} A forward, {back:.3g} A backward over {len(turns)} turns",
        unstated_note(captures, ("current",)),
    )
    half, middle = 0.5 * (ahead - back), 0.5 * (ahead + back)
    read = (METHOD.scatter(FRICTION.name, u, dof), *_gains(captures, half))
    friction = METHOD.measured(FRICTION.name, half, read, captures, notes=notes)
    both = (METHOD.scatter(OFFSET.name, u, dof), *_gains(captures, middle))
    offset = METHOD.measured(OFFSET.name, middle, both, captures, notes=notes)
    kt = torque_constant(known)
    if kt is None:
        why = f"{half:.3g} ± {u:.2g} A; a torque constant is missing"
        torques = [METHOD.missing(name, why) for name in (FRICTION_NM.name, COULOMB)]
        return friction, *torques, offset
    parts = propagate([(half, kt.budget), (kt.number, read)])
    torque = METHOD.measured(FRICTION_NM.name, half * kt.number, parts, captures, notes=notes)
    left = np.concatenate([_left(turns, spec, lines, n) for n in range(len(turns))])
    # as of one standard deviation: a single row where the motion turns does not count for all
    within = math.erf(math.sqrt(0.5))
    scatter_nm = abs(kt.number) * float(np.quantile(np.abs(left), within))
    return friction, torque, _coulomb(captures, torque, scatter_nm), offset


def _coulomb(captures: Sequence[Capture], torque: Estimate, scatter_nm: float) -> Estimate:
    """Dry friction, by the `torque` of slow motion that both senses of arrival differ by.

    What a rotor at rest leans on is at most the friction of its motion. What it leans on less, by
    the chance of each arrival, shows as scatter from angle to angle, which is in the uncertainty
    whole; what it leans on less at every angle alike does not show, and the note says so.
    """
    if torque.number < -3.0 * torque.u:
        note = "the current is against the motion; check its sign, or that of theta_mech_rad"
        return METHOD.missing(COULOMB, note)
    at_rest = Contribution(AT_REST, scatter_nm, "B")
    words = (
        "friction of slow motion, with Stribeck's excess in it; less than that if the rotor came "
        "to rest at every angle with a part of it unused"
    )
    notes = (words, torque.note)
    parts = [*torque.budget, at_rest]
    drag = METHOD.measured(COULOMB, torque.number, parts, captures, notes=notes)
    speed = mean_speed_rad_s(captures)
    return drag if not speed else replace(drag, at={"omega_mech_rad_s": speed})


def _mean_of(
    turns: Sequence[Turn], spec: Spectrum, lines: Sequence[OrderLine], sense: int
) -> tuple[float, float]:
    """Mean current of the turns of one sense and its standard uncertainty [A].

    By what the orders leave in a turn, with its correlation; and by what turns scatter, where there
    are several. The larger counts.
    """
    places = [n for n, turn in enumerate(turns) if turn.sense == sense]
    means, within = spec.means[places], []
    for n in places:
        residuals = _left(turns, spec, lines, n)
        within.append(float(np.var(residuals)) * autocorrelation_time(residuals) / residuals.size)
    u = float(np.sqrt(np.sum(within))) / len(places)
    if len(places) > 1:
        u = max(u, float(np.std(means, ddof=1)) / float(np.sqrt(len(places))))
    return float(np.mean(means)), u


def _left(turns: Sequence[Turn], spec: Spectrum, lines: Sequence[OrderLine], n: int) -> Array:
    """What the orders leave of the n-th turn's current [A]."""
    return turns[n].value - spec.means[n] - waveform(lines, turns[n].theta_rad)


def _gains(captures: Sequence[Capture], amps: float) -> tuple[Contribution, ...]:
    """What the gains of the current readings make of a current [A]: each its captures' share."""
    sources = [current_source(capture.meta) for capture in captures]
    return tuple(
        Contribution(source, amps * u * sources.count(source) / len(sources), "B")
        for source, u in instrument_uncertainties(captures, ("current",)).items()
    )


def _u_rms(residual: Array) -> float:
    """Standard uncertainty of the rms, with the residual's correlation."""
    draws = block_bootstrap(
        lambda part: np.sqrt(np.mean(part**2, keepdims=True)),
        residual,
        block_length(residual),
        policy().cogging.replicates,
        np.random.default_rng(0),
    )
    return float(np.std(draws, ddof=1))


def held_out_residual(turns: Sequence[Turn], orders: Sequence[int]) -> Array | None:
    """The current [n, A] left in sectors of the turn that the fit did not see; None if too few.

    The turn is cut into `cogging.sectors` (a prime); the orders, with one offset a direction, are
    fitted to those whose number is a square modulo the prime and judged on the others, then the
    other way round. That pattern has a flat spectrum, so it starves no order of its phases.
    Reference: Schroeder, Number Theory in Science and Communication, 15.

    Parameters
    ----------
    turns
        Whole turns: angle [rad] and holding current [A].
    orders
        A mechanical turn, which are fitted.

    """
    angle = np.concatenate([turn.theta_rad for turn in turns])
    value = np.concatenate([turn.value for turn in turns])
    sense = np.concatenate([np.full(turn.value.size, float(turn.sense)) for turn in turns])
    design = np.column_stack([harmonic_design(angle, list(orders)), sense])
    sectors = policy().cogging.sectors
    squared = np.isin(np.arange(sectors), np.arange(sectors) ** 2 % sectors).astype(np.int64)
    number = np.floor(np.mod(angle, TURN_RAD) * (sectors / TURN_RAD)).astype(np.int64)
    sector = squared[np.minimum(number, sectors - 1)]
    residuals = np.zeros(value.size)
    for part in (0, 1):
        fitted, held_out = sector == part, sector != part
        if np.count_nonzero(fitted) < 4 * design.shape[1]:
            return None
        model = linear_fit(design[fitted], value[fitted])
        residuals[held_out] = value[held_out] - design[held_out] @ model.coefficients
    return residuals


@dataclass(frozen=True, slots=True)
class _Waves:
    """The q current over angle: its spectrum, the orders that stand out, the number of even
    `positions` that it was held at, and what is left in held-out sectors [A rms].
    """

    captures: Sequence[Capture]
    spectrum: Spectrum
    lines: Sequence[OrderLine]
    positions: int | None
    rms_a: float | None


def _cogging(waves: _Waves, known: Constants, campaign: Campaign) -> tuple[Estimate, ...]:
    names, captures, lines = COGGING, waves.captures, waves.lines
    if not lines:
        limit = detection_limit(waves.spectrum)
        note = f"no order found; an amplitude above {limit:.2g} A would have been"
        return tuple(METHOD.absent(n, note) for n in names)
    note = f"A by order: {name_orders(lines, known, campaign)}"
    if waves.rms_a is not None:
        note += f"; {waves.rms_a:.3g} A rms left in held-out sectors"
    leading, alias = _true_order(lines[0].order, waves.positions, known, campaign)
    note += alias
    order = METHOD.measured(names[0], leading, captures=captures, notes=note)
    order = replace(order, bounds=(1.0, float(waves.spectrum.orders[-1])))
    read = (
        METHOD.scatter(names[1], lines[0].u, lines[0].dof),
        *_gains(captures, lines[0].amplitude),
    )
    amps_of = METHOD.measured(names[1], lines[0].amplitude, read, captures, notes=note)
    kt = torque_constant(known)
    if kt is None:
        why = f"{lines[0].amplitude:.4g} A of order {lines[0].order}; a torque constant is missing"
        return (order, amps_of, *(METHOD.missing(n, why) for n in TORQUES))
    peak, u_peak = half_peak_to_peak(lines)
    sizes = {TORQUES[0]: (lines[0].amplitude, lines[0].u)}
    if not alias:
        sizes[TORQUES[1]] = peak, u_peak
    torques, notes = [], (note, unstated_note(captures, ("current",)))
    for name, (amps, u) in sizes.items():
        read = (METHOD.scatter(name, u, lines[0].dof), *_gains(captures, amps))
        parts = propagate([(amps, kt.budget), (kt.number, read)])
        torques.append(METHOD.measured(name, amps * kt.number, parts, captures, notes=notes))
    if alias:
        why = f"{waves.positions} positions do not show the wave between them; {EXPERIMENT}"
        torques.append(METHOD.missing(TORQUES[1], why))
    return (order, amps_of, *torques)


def _true_order(
    order: int, positions: int | None, known: Constants, campaign: Campaign
) -> tuple[int, str]:
    """The order behind one seen on even positions, and a note where it could be another.

    On n positions the orders k and m n ± k look alike; the one that slots and poles make is taken
    if there is exactly one of them.
    """
    slots, pairs = slots_and_pole_pairs(known, campaign)
    if positions is None or slots is None or pairs is None:
        return order, ""
    fundamental = cogging_order(slots, pairs)
    alike = [order, *(m * positions + s * order for m in (1, 2, 3) for s in (-1, 1))]
    fits = [k for k in alike if k % fundamental == 0]
    if order % fundamental == 0 or len(fits) != 1:
        return order, ""
    return fits[0], f"; {positions} even positions show order {fits[0]} as {order}: hold at more"


def _evidence(
    turns: Sequence[Turn], spec: Spectrum, lines: Sequence[OrderLine]
) -> tuple[Evidence, ...]:
    series = []
    for index, turn in enumerate(turns):
        keep = slice(None, None, -(-turn.value.size // 2000))
        angle = np.mod(turn.theta_rad[keep], TURN_RAD)
        order = np.argsort(angle, kind="stable")
        angle = angle[order]
        label = "forward" if turn.sense > 0 else "backward"
        fitted = spec.means[index] + waveform(lines, angle)
        series.append(Series(f"{label} {index + 1}", angle, turn.value[keep][order], fitted))
    bars, title = spectrum_bars(spec, 1000), "Holding current over one turn"
    return (
        METHOD.plot(title, ("theta_mech_rad", "iq_a"), "scatter", series),
        METHOD.plot("Holding-current spectrum", ("cogging_order", "iq_a"), "bars", (bars,)),
    )


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("holding_current",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", *USES),
    either=USES,
    aids=("pole_pairs",),
    rank=20,
    terms=TERMS,
    options={"highest_order": 1000.0, "level": 0.01},
)
