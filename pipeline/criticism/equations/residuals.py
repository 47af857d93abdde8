"""Recorded less predicted signals of one segment, sample by sample, in the sensors' own units.

Voltages are compared in the rotor frame, per sample period, without differentiating anything
but the flux linkage and the angle, and those under the smooth windows of `numerics.projection`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.criticism.data.segment import RECORDER, Segment
from pipeline.criticism.data.traces import LINES_V
from pipeline.criticism.effect import Array, Complex, Operating, Recorded, Values
from pipeline.criticism.equations.true_signals import (
    ahead_in,
    angle_error,
    current_slope,
    on_true_clock,
    operate,
)
from pipeline.criticism.machine.model import (
    Model,
    Pieces,
    air_gap_torque,
    clock_gain,
    evaluate,
    ripple,
    values_of,
)
from pipeline.numerics.projection import Projection
from pipeline.physics.frames import vector_of_lines

RIPPLES = ("ripple_edge", "ripple_shift")
TORQUE_RIPPLES = ("ripple_mean", "ripple_torque", "ripple_held")
"""Nuisances of the current's ripple that are in the voltage, and in the torque (`model.BASE`)."""


def residual(
    segment: Segment, model: Model, values: Values, recorded: Mapping[str, Array] | None = None
) -> Array:
    """Recorded less predicted [C, n] of every channel of a segment."""
    signals = segment.recorded if recorded is None else recorded
    x = operate(segment, signals, model, values)
    pieces = evaluate(model, x, values)
    return measured(segment, signals, model, values) - predicted(segment, x, pieces, model, values)


def over_inertia(segment: Segment, channel: str) -> bool:
    """Whether an equation is one of accelerations [rad/s²]: of a shaft that runs free."""
    coasting = channel == "omega_mech_rad_s" and segment.kind == "shaft"
    return coasting or segment.kind == "motion"


def disturbed(
    segment: Segment, weak: Projection, model: Model, values: Values, name: str, waves: Array
) -> Array:
    """What additions to one sensor, waves [K, n] in its unit, do to the weak samples
    [K, C, W, M].
    """
    here, column = residual(segment, model, values), segment.recorded[name]
    moved = ({**segment.recorded, name: column + wave} for wave in waves)
    there = [residual(segment, model, values, recorded) for recorded in moved]
    return np.stack([weak.project(one - here) for one in there])


def measured(segment: Segment, signals: Mapping[str, Array], model: Model, values: Values) -> Array:
    """Recorded signals [C, n] of the channels; only the torque is corrected, for its sensor's
    dynamics, and the open-circuit line voltages are turned into the rotor frame.
    """
    if segment.kind == "open":
        v = _open_voltage(signals, model, values)
        return np.stack([v.real, v.imag])
    rows = []
    for channel in segment.channels:
        if over_inertia(segment, channel):
            rows.append(np.zeros(segment.size))
        elif segment.kind == "standing":
            true = operate(segment, signals, model, values).i_a.imag
            rows.append(true / current_slope(segment, model, values))
        elif channel == "torque_shaft_nm":
            rows.append(_true_load(segment, signals, model, values))
        else:
            rows.append(signals[channel])
    return np.stack(rows)


def _open_voltage(signals: Mapping[str, Array], model: Model, values: Values) -> Complex:
    stationary = vector_of_lines({name: signals[name] for name in LINES_V if name in signals})
    eps = model.machine.pole_pairs * signals["theta_mech_rad"] - values["bench_angle_rad"]
    voltage: Complex = stationary * np.exp(-1j * eps)
    return voltage


def _true_load(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Array:
    segment = on_true_clock(segment, model, values)
    hooks = [e for e in model.effects if e.load is not None]
    torque = signals["torque_shaft_nm"]
    if not hooks:
        return torque
    zero = np.zeros(torque.size)
    r = Recorded(
        zero.astype(np.complex128),
        torque,
        zero,
        zero,
        segment.ts_s,
        segment.kind == "dq",
        segment.instrument,
        ahead=ahead_in(segment, signals, model.machine.pole_pairs),
    )
    for effect in hooks:
        if effect.load is not None:
            q = values_of(effect, model.machine, values)
            r = replace(r, torque_nm=effect.load(r, q))
    return r.torque_nm


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Predicted signals [C, n] of the channels from the pieces the hooks gave."""
    segment = on_true_clock(segment, model, values)
    if segment.kind == "lcr":
        return _predict_lcr(segment, x, model, values)
    if segment.kind == "flux_map":
        # a flux linkage is a voltage's integral: the voltmeter's gain is in it
        psi = _recorded_voltage(pieces.psi_wb, segment, x, model, values)
        return np.stack([psi.real, psi.imag])
    if segment.kind == "standing":
        return _holding(x, pieces, values) / current_slope(segment, model, values)
    if segment.kind == "steady":
        steady = pieces.drop_v + 1j * x.machine.pole_pairs * x.omega_rad_s * pieces.psi_wb
        return _recorded_voltage(steady, segment, x, model, values).imag[None]
    rows: list[Array] = []
    if segment.kind == "q":
        voltage = _rotor_voltage(segment, x, pieces, values)
        rows.append(_recorded_voltage(voltage, segment, x, model, values).imag)
        if len(segment.channels) > 1:
            rows.append(_recorded_speed(segment, x, model, values))
    if segment.kind in ("dq", "open"):
        voltage = _rotor_voltage(segment, x, pieces, values)
        voltage = _recorded_voltage(voltage, segment, x, model, values)
        rows += [voltage.real, voltage.imag]
    if segment.kind == "terminal":
        stationary = _stationary_voltage(segment, x, pieces)
        stationary = _recorded_voltage(stationary, segment, x, model, values)
        turn = np.exp(1j * (math.pi / 6 - segment.fixed["pair_rad"]))
        rows.append(math.sqrt(3) * (stationary * turn).real)
    if len(segment.channels) > len(rows):
        rows.append(_shaft_torque(segment, x, pieces, model, values))
    return np.stack(rows)


def _shaft_torque(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Torque at the shaft [n]: air gap less drags less inertia, as the sensor tells it [N·m].

    Of a coasting shaft the acceleration that its drags leave unexplained [rad/s²].
    """
    shaft = air_gap_torque(x, pieces.psi_wb, pieces.slope_wb) - pieces.drag_nm
    if segment.kind == "dq" and any(values[name] for name in TORQUE_RIPPLES):
        shaft = shaft + _between(segment, x, pieces, values)
    finer = x.theta_rad.size // segment.size
    if finer > 1:
        shaft = _averaged(shaft, finer)
    acceleration = _second_difference(x.theta_rad[::finer], segment.ts_s)
    if over_inertia(segment, segment.channels[-1]):
        # in the angle sensor's units: a torque's noise floor would shrink with the inertia
        # and by the recorded clock: a gain must not win by making its residual small
        stretch = 1.0 + clock_gain(RECORDER.get(segment.kind), model, values)
        return (shaft / values["j_kgm2"] - acceleration) / stretch**2
    shaft = shaft - values["j_kgm2"] * acceleration
    if segment.channels[-1] == "torque_shaft_nm":
        for effect in model.effects:
            if effect.shaft is not None:
                shaft = effect.shaft(shaft, values_of(effect, model.machine, values))
        shaft = shaft * (1.0 + values["gain_torque"])
    return shaft


def _holding(x: Operating, pieces: Pieces, values: Values) -> Array:
    """The q current [1, n] that holds the rotor against its drags: what it lacks in torque is
    made up by more of it.
    """
    torque = air_gap_torque(x, pieces.psi_wb, pieces.slope_wb) - pieces.drag_nm
    current: Array = x.i_a.imag - torque / (1.5 * x.machine.pole_pairs * values["psi_wb"])
    return current[None]


def _recorded_speed(segment: Segment, x: Operating, model: Model, values: Values) -> Array:
    """Speed [n] of the angle as a drive's own estimate tells it [rad/s]."""
    speed: Array = _central(x.theta_rad, segment.ts_s)
    for effect in model.effects:
        if effect.speed is not None:
            q = values_of(effect, model.machine, values)
            speed = effect.speed(speed, q, segment.ts_s)
    return speed


def _second_difference(theta: Array, period: float) -> Array:
    bend = np.zeros(theta.size)
    bend[1:-1] = np.diff(theta, 2) / period**2
    return bend


def _averaged(fine: Array, finer: int) -> Array:
    """Means [n] of a signal [n·m] under a triangle of two samples around each sample.

    The second difference of the angle over T² is the mean acceleration under that triangle.
    """
    ramp = np.arange(finer) / finer**2
    cells = fine.reshape(-1, finer)
    # the part of each cell that counts for its own sample, and for the next one
    own, after = cells @ (1.0 / finer - ramp), cells @ ramp
    mean: Array = own.copy()
    mean[1:] += after[:-1]
    return mean


def _central(signal: Any, period: float) -> Any:
    slope = np.zeros_like(signal)
    slope[1:-1] = (signal[2:] - signal[:-2]) / (2 * period)
    return slope


def _forward(signal: Any, period: float) -> Any:
    slope = np.zeros_like(signal)
    slope[:-1] = np.diff(signal) / period
    return slope


def _ahead(signal: Any) -> Any:
    mean = signal.copy()
    mean[:-1] = 0.5 * (signal[:-1] + signal[1:])
    return mean


def _rotor_voltage(segment: Segment, x: Operating, pieces: Pieces, values: Values) -> Complex:
    """Drop + dψ/dt + jω_e ψ [n], over what the capture's voltage samples stand for."""
    period = segment.ts_s
    held = segment.timing == "held" and segment.kind == "dq"
    difference = _forward if held else _central
    psi, drop = pieces.psi_wb, pieces.drop_v
    slope = difference(psi, period)
    if held:
        psi, drop = _ahead(psi), _ahead(drop)
    omega, turn, shrink = x.once(x.theta_rad, "pace", lambda: _pace(segment, x, difference))
    voltage: Complex = drop + slope + 1j * omega * psi
    if segment.kind == "dq" and any(values[name] for name in RIPPLES):
        shrink = shrink - values["ripple_edge"] * turn**2
        lag = values["ripple_shift"] * 1j * psi * np.gradient(turn) / period
        voltage = shrink * voltage - lag
    else:
        voltage = shrink * voltage
    return voltage


def _pace(
    segment: Segment, x: Operating, difference: Callable[[Array, float], Array]
) -> tuple[Array, Array, Any]:
    """Electrical speed [n, rad/s], what it turns in a sample period [n, rad], and what is left of
    a voltage's mean while it turns.
    """
    turn = x.machine.pole_pairs * x.omega_rad_s * segment.ts_s
    averaged = segment.timing != "instant" and segment.kind == "dq"
    shrink = np.sinc(turn / (2 * math.pi)) if averaged else 1.0
    if segment.kind == "q":
        return turn / segment.ts_s, turn, shrink
    return difference(x.machine.pole_pairs * x.theta_rad, segment.ts_s), turn, shrink


def _between(segment: Segment, x: Operating, pieces: Pieces, values: Values) -> Array:
    """Torque [n, N·m] of what current and flux do between samples.

    The current moves on for a part of a period; and while a held voltage turns, both are off their
    means. A free shaft is turned by the means; what a transducer tells of a held one is its own.
    """
    flux, current = ripple(x, values["ripple_held" if x.held else "ripple_mean"], values)
    current = values["ripple_torque"] * segment.ts_s * _central(x.i_a, segment.ts_s) - current
    moved = np.conj(pieces.psi_wb) * current - np.conj(flux) * x.i_a
    torque: Array = 1.5 * x.machine.pole_pairs * moved.imag
    return torque


def _stationary_voltage(segment: Segment, x: Operating, pieces: Pieces) -> Complex:
    turn = x.once(x.eps_rad, "turn", lambda: np.exp(1j * x.eps_rad))
    voltage: Complex = (pieces.drop_v + _central(pieces.psi_wb, segment.ts_s)) * turn
    return voltage


def _recorded_voltage(
    voltage: Complex, segment: Segment, x: Operating, model: Model, values: Values
) -> Complex:
    for effect in model.effects:
        if effect.voltage is not None:
            q = values_of(effect, model.machine, values)
            voltage = effect.voltage(voltage, x, q, segment.instrument)
    if segment.kind in ("dq", "q", "open") and any(e.angle is not None for e in model.effects):
        voltage = voltage * np.exp(-1j * angle_error(x, model, values))
    return voltage * (1.0 + values[segment.meter])


def _predict_lcr(segment: Segment, x: Operating, model: Model, values: Values) -> Array:
    """Incremental line inductance and resistance [C, n] at zero current, pair ab.

    A unit of current through ab is i = (2/√3) e^{−j(30° + ε)} in the rotor frame, and the line
    voltage is √3 Re[v e^{j(30° + ε)}].
    """
    probe = 1e-3 * x.machine.scales["current_a"]
    direction = 2 / math.sqrt(3) * np.exp(-1j * (math.pi / 6 + x.eps_rad))
    sides = []
    for sign in (1.0, -1.0):
        at = replace(x, id_a=sign * probe * direction.real, iq_a=sign * probe * direction.imag)
        sides.append(evaluate(model, at, values))
    back = math.sqrt(3) * np.exp(1j * (math.pi / 6 + x.eps_rad))
    rows = {
        "lab_h": ((sides[0].psi_wb - sides[1].psi_wb) / (2 * probe) * back).real,
        "rab_ohm": ((sides[0].drop_v - sides[1].drop_v) / (2 * probe) * back).real,
    }
    gain = 1.0 + values["gain_lcr"]
    return gain * np.stack([rows[channel] for channel in segment.channels])
