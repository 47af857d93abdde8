"""True currents, angle and speed of a segment: what the sensors said, their effects taken out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import RECORDER, Segment, slow_orders
from pipeline.criticism.data.traces import smoothed
from pipeline.criticism.effect import (
    Array,
    Complex,
    Machine,
    Operating,
    Recorded,
    Values,
    between,
)
from pipeline.criticism.machine.model import Model, clock_gain, values_of

_SPEED_S = 0.002
"""Length of the mean that makes a speed of differenced angles [s]. By judgement: shorter, and the
encoder's rounding is in drags of the speed; longer, and a reversal is blurred."""
_SAME_RAD, _PARTS, _PART_RAD = 0.2, 8, 3.0
"""What the highest order turns in a coasting sample that is as good as an instant; how many parts a
longer one is averaged over at least, and what that wave may turn in one: the steps that stand for
the triangle are wrong by a third of a percent of the wave at most."""
_FINEST, _FINEST_LOG = 48, 6
"""Parts of a sample at the most, of a coasting shaft and of a drive's log: a bound of the
cost, by judgement."""
_ANGLE_ROUNDS = 2
"""Times that an angle error is looked up at the angle it gives: each round leaves of the error its
own size times its order a turn."""
_CRAWL = 1e-9
"""Speed [rad/s] of a held rotor that creeps: it has a sense and nothing else."""


def on_true_clock(segment: Segment, model: Model, values: Values) -> Segment:
    """The segment with its true sample period in place of the recorded one."""
    gain = clock_gain(RECORDER.get(segment.kind), model, values)
    return replace(segment, ts_s=segment.ts_s / (1.0 + gain)) if gain else segment


def operate(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Operating:
    """True currents, angle and speed [n] of a segment, the sensor effects taken out."""
    segment = on_true_clock(segment, model, values)
    if segment.kind in ("terminal", "lcr", "flux_map"):
        return _operate_still(segment, signals, model, values)
    if segment.kind in ("steady", "standing"):
        return _operate_table(segment, signals, model, values)
    theta, omega, freq = _motion(segment, signals, model)
    current = np.zeros(theta.size, dtype=complex)
    if segment.kind in ("dq", "q", "motion"):
        current = _true_current(_recorded(segment, signals, model), segment.ammeter, model, values)
    if current.size < theta.size:
        at = np.arange(theta.size) * (current.size / theta.size)
        current = np.interp(at, np.arange(current.size), current)
    if segment.kind == "q" and "omega_mech_rad_s" in signals:
        omega = signals["omega_mech_rad_s"]
    x = _operating(segment, signals, model, values, current, theta, omega, freq)
    if not any(effect.angle is not None for effect in model.effects):
        return x
    error = np.zeros(theta.size)
    for _ in range(_ANGLE_ROUNDS):
        nearer = replace(x, theta_rad=theta - error / model.machine.pole_pairs)
        error = angle_error(nearer, model, values)
    turned = error / model.machine.pole_pairs
    true = theta - turned
    omega = omega - _speed(turned, segment.ts_s, theta.size // segment.size)
    current = current * np.exp(1j * error)
    return replace(
        x,
        id_a=current.real,
        iq_a=current.imag,
        eps_rad=x.eps_rad - error,
        theta_rad=true,
        omega_rad_s=omega,
    )


def _motion(
    segment: Segment, signals: Mapping[str, Array], model: Model
) -> tuple[Array, Array, Array]:
    """Angle, speed and electrical frequency [n·m]; m points a sample where the shaft turns so far
    in one that the samples alone would miss an order of the torque.
    """
    theta = signals["theta_mech_rad"]
    finer = finer_of(segment, model.machine)
    if finer > 1:
        at = np.arange(theta.size * finer) / finer
        theta = np.interp(at, np.arange(theta.size), theta)
    omega = _speed(theta, segment.ts_s, finer)
    return theta, omega, np.abs(omega) * model.machine.pole_pairs / (2 * math.pi)


def _speed(theta: Array, period: float, finer: int) -> Array:
    width = max(2 * round(_SPEED_S / period / 2) + 1, 5) * finer
    return smoothed(np.gradient(theta, period / finer), width)


def finer_of(segment: Segment, machine: Machine) -> int:
    """How many points a sample the torque of a coasting shaft is averaged over."""
    if segment.kind not in ("shaft", "motion") or segment.test == "cogging":
        return 1
    highest = max(*slow_orders(machine), 1)
    turn = highest * float(np.abs(np.diff(segment.recorded["theta_mech_rad"])).max())
    if turn < _SAME_RAD:
        return 1
    finest = _FINEST if segment.kind == "shaft" else _FINEST_LOG
    return min(max(int(np.ceil(turn / _PART_RAD)), _PARTS), finest)


def _operating(
    segment: Segment,
    signals: Mapping[str, Array],
    model: Model,
    values: Values,
    current: Complex,
    theta: Array,
    omega: Array,
    freq: Array,
) -> Operating:
    zero_rad = values["bench_angle_rad"] if segment.kind == "open" else 0.0
    return Operating(
        machine=model.machine,
        base=values,
        id_a=current.real,
        iq_a=current.imag,
        eps_rad=model.machine.pole_pairs * theta - zero_rad,
        theta_rad=theta,
        omega_rad_s=omega,
        winding_k=_warmth(segment, signals, "temp_winding_degc", theta.size, values),
        magnet_k=_warmth(segment, signals, "temp_magnet_degc", theta.size, values),
        travel_rad=_travel(signals, theta.size),
        run=_run(signals, theta.size),
        runs_rad=segment.runs_rad,
        inverter=segment.kind in ("dq", "q"),
        q_alone=segment.kind == "q",
        ts_s=segment.ts_s,
        freq_hz=freq,
        held=segment.test == "torque_map",
        finer=theta.size // segment.size,
    )


def _warmth(
    segment: Segment, signals: Mapping[str, Array], name: str, size: int, values: Values
) -> Array:
    if name not in signals:
        return np.full(size, segment.fixed["ambient_k"])
    return signals[name] - 25.0 - values["offset_temp_k"]


def _travel(signals: Mapping[str, Array], size: int) -> Array:
    since = signals.get("travel_rad")
    if since is None:
        return np.full(size, np.inf)
    known = np.isfinite(since)
    if since.size == size:
        return np.where(known, since, np.inf)
    at = np.arange(size) * since.size / size
    turned = np.interp(at, np.arange(since.size), np.where(known, since, 0.0))
    return np.where(known[at.astype(np.int64)], turned, np.inf)


def _run(signals: Mapping[str, Array], size: int) -> NDArray[np.int64]:
    run = signals.get("run")
    if run is None:
        return np.zeros(size, dtype=np.int64)
    return np.repeat(run.astype(np.int64), size // run.size)


def _recorded(segment: Segment, signals: Mapping[str, Array], model: Model) -> Recorded:
    theta = signals["theta_mech_rad"]
    eps = model.machine.pole_pairs * theta
    return Recorded(
        i_a=signals.get("id_a", np.zeros(theta.size)) + 1j * signals["iq_a"],
        torque_nm=signals.get("torque_shaft_nm", np.zeros(theta.size)),
        eps_rad=eps,
        omega_e_rad_s=np.gradient(eps, segment.ts_s),
        ts_s=segment.ts_s,
        inverter=True,
        instrument=segment.instrument,
        ahead=ahead_in(segment, signals, model.machine.pole_pairs),
    )


def ahead_in(
    segment: Segment, signals: Mapping[str, Array], pole_pairs: int
) -> Callable[[float], tuple[Complex, Array, Array]] | None:
    """What currents, torque and electrical angle are later in the whole log of a segment, less what
    they are now; None where nothing was thinned. The segment is on its true clock.
    """
    log, rows = segment.log, segment.recorded.get("t_s")
    if not log or rows is None:
        return None
    steps = np.diff(rows)
    if not (steps > 0.0).any():
        return None
    at = np.rint(rows / float(np.median(steps[steps > 0.0])))

    def ahead(delay_s: float) -> tuple[Complex, Array, Array]:
        later = at + delay_s / segment.ts_s
        change = {
            name: between(column, later) - between(column, at) for name, column in log.items()
        }
        zero = np.zeros(at.size)
        current = change.get("id_a", zero) + 1j * change.get("iq_a", zero)
        return current, change.get("torque_shaft_nm", zero), pole_pairs * change["theta_mech_rad"]

    return ahead if at.size == next(iter(signals.values())).size else None


def _true_current(recorded: Recorded, ammeter: str, model: Model, values: Values) -> Complex:
    gain = 1.0 + values[ammeter]
    ahead = recorded.ahead
    recorded = replace(recorded, i_a=recorded.i_a / gain)
    if ahead is not None:

        def scaled(delay_s: float) -> tuple[Complex, Array, Array]:
            current, torque, turned = ahead(delay_s)
            return current / gain, torque, turned

        recorded = replace(recorded, ahead=scaled)
    for effect in model.effects:
        if effect.current is not None:
            q = values_of(effect, model.machine, values)
            recorded = replace(recorded, i_a=effect.current(recorded, q))
    return recorded.i_a


def angle_error(x: Operating, model: Model, values: Values) -> Array:
    """Recorded less true electrical angle [n, rad] by the sensor effects of a model."""
    total = np.zeros(x.omega_rad_s.shape)
    for effect in model.effects:
        if effect.angle is not None:
            total = total + effect.angle(x, values_of(effect, model.machine, values))
    return total


def _operate_still(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Operating:
    n = next(iter(signals.values())).size
    zero = np.zeros(n)
    if segment.kind == "terminal":
        eps = np.full(n, segment.fixed.get("theta_elec_rad", 0.0))
        stationary = (
            2
            / math.sqrt(3)
            * signals["i_pair_a"]
            * np.exp(1j * (segment.fixed["pair_rad"] - math.pi / 6))
        )
        phase = int(segment.fixed["phase"])
        bench = Recorded(
            stationary, zero, eps, zero, segment.ts_s, False, segment.instrument, phase
        )
        current = _true_current(bench, segment.ammeter, model, values) * np.exp(-1j * eps)
        freq = zero
    elif segment.kind == "lcr":
        eps, current = np.radians(signals["theta_elec_deg"]), np.zeros(n, dtype=complex)
        freq = signals.get("freq_hz", zero)
    else:
        eps, freq = zero, zero
        current = signals["id_a"] + 1j * signals["iq_a"]
        table = Recorded(current, zero, eps, zero, segment.ts_s, False, segment.instrument)
        current = _true_current(table, segment.ammeter, model, values)
    x = _operating(segment, signals, model, values, current, zero, zero, freq)
    return replace(x, eps_rad=eps)


def _operate_table(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Operating:
    """A held rotor, which creeps the way it came, or levels of d current at steady speeds."""
    n = next(iter(signals.values())).size
    zero = np.zeros(n)
    theta = signals.get("theta_mech_rad", zero)
    omega = signals["omega_mech_rad_s"] if segment.kind == "steady" else _CRAWL * signals["sense"]
    eps = model.machine.pole_pairs * theta
    recorded = Recorded(
        signals.get("id_a", zero) + 1j * signals.get("iq_a", zero),
        zero,
        eps,
        model.machine.pole_pairs * omega,
        segment.ts_s,
        False,
        segment.instrument,
    )
    current = _true_current(recorded, segment.ammeter, model, values)
    freq = np.abs(omega) * model.machine.pole_pairs / (2 * math.pi)
    return _operating(segment, signals, model, values, current, theta, omega, freq)


def current_slope(segment: Segment, model: Model, values: Values) -> float:
    """True q ampere a recorded one.

    By it residuals of a current are told in the sensor's own units; else a gain could win by
    shrinking the residual that it is blamed for.
    """
    zero = np.zeros(4)
    nothing = Recorded(
        zero.astype(np.complex128), zero, zero, zero, segment.ts_s, False, segment.instrument
    )
    ampere = replace(nothing, i_a=np.full(4, 1j))
    moved, still = (_true_current(one, segment.ammeter, model, values) for one in (ampere, nothing))
    return float((moved - still)[0].imag)
