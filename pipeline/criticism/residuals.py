"""Recorded less predicted signals of one segment, sample by sample, in the sensors' own units.

Voltages are compared in the rotor frame, per sample period, without differentiating anything
but the flux linkage and the angle, and those under the smooth windows of `numerics.projection`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.criticism.effect import Array, Complex, Machine, Operating, Recorded, Values
from pipeline.criticism.model import Model, Pieces, air_gap_torque, evaluate, values_of
from pipeline.criticism.segments import Segment, slow_orders
from pipeline.criticism.traces import smoothed

_SPEED_S = 0.002
_TURN_RAD = 0.7
_FINEST = 48
_ANGLE_ROUNDS = 2
RIPPLES = ("ripple_edge", "ripple_shift", "ripple_torque")


def residual(
    segment: Segment, model: Model, values: Values, recorded: Mapping[str, Array] | None = None
) -> Array:
    """Recorded less predicted [C, n] of every channel of a segment."""
    signals = segment.recorded if recorded is None else recorded
    x = operate(segment, signals, model, values)
    pieces = evaluate(model, x, values)
    return measured(segment, signals, model, values) - predicted(segment, x, pieces, model, values)


def operate(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Operating:
    """True currents, angle and speed [n] of a segment, the sensor effects taken out."""
    if segment.kind in ("terminal", "lcr", "flux_map"):
        return _operate_still(segment, signals, model, values)
    theta, omega, freq = _motion(segment, signals, model)
    current = np.zeros(theta.size, dtype=complex)
    if segment.kind == "dq":
        current = _true_current(_recorded(segment, signals, model), model, values)
    x = _operating(segment, signals, model, values, current, theta, omega, freq)
    if not any(effect.angle is not None for effect in model.effects):
        return x
    error = np.zeros(theta.size)
    for _ in range(_ANGLE_ROUNDS):
        nearer = replace(x, theta_rad=theta - error / model.machine.pole_pairs)
        error = _angle_error(nearer, model, values)
    true = theta - error / model.machine.pole_pairs
    omega = _speed(true, segment.ts_s, theta.size // segment.size)
    return _operating(
        segment, signals, model, values, current * np.exp(1j * error), true, omega, freq
    )


def _motion(
    segment: Segment, signals: Mapping[str, Array], model: Model
) -> tuple[Array, Array, Array]:
    """Angle, speed and electrical frequency [n·m]; m times finer where the shaft turns so far a
    sample that a torque's order would be missed.
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
    if segment.kind != "shaft" or segment.test == "cogging":
        return 1
    highest = max(*slow_orders(machine), 1)
    turn = float(np.abs(np.diff(segment.recorded["theta_mech_rad"])).max())
    return min(max(int(np.ceil(highest * turn / _TURN_RAD)), 1), _FINEST)


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
    return Operating(
        machine=model.machine,
        base=values,
        id_a=current.real,
        iq_a=current.imag,
        eps_rad=model.machine.pole_pairs * theta,
        theta_rad=theta,
        omega_rad_s=omega,
        winding_k=_warmth(segment, signals, "temp_winding_degc", theta.size, values),
        magnet_k=_warmth(segment, signals, "temp_magnet_degc", theta.size, values),
        travel_rad=_travel(signals, theta.size),
        inverter=segment.kind == "dq",
        ts_s=segment.ts_s,
        freq_hz=freq,
        held=segment.test == "torque_map",
    )


def _warmth(
    segment: Segment, signals: Mapping[str, Array], name: str, size: int, values: Values
) -> Array:
    if name not in signals:
        return np.full(size, segment.fixed["ambient_k"])
    return signals[name] - 25.0 - values["offset_temp_k"]


def _travel(signals: Mapping[str, Array], size: int) -> Array:
    since = signals.get("travel_rad")
    return np.full(size, np.inf) if since is None or since.size != size else since


def _recorded(segment: Segment, signals: Mapping[str, Array], model: Model) -> Recorded:
    theta = signals["theta_mech_rad"]
    eps = model.machine.pole_pairs * theta
    return Recorded(
        i_a=signals["id_a"] + 1j * signals["iq_a"],
        torque_nm=signals.get("torque_shaft_nm", np.zeros(theta.size)),
        eps_rad=eps,
        omega_e_rad_s=np.gradient(eps, segment.ts_s),
        ts_s=segment.ts_s,
        inverter=True,
        instrument=segment.instrument,
    )


def _true_current(recorded: Recorded, model: Model, values: Values) -> Complex:
    recorded = replace(recorded, i_a=recorded.i_a / (1.0 + values["gain_current"]))
    for effect in model.effects:
        if effect.current is not None:
            q = values_of(effect, model.machine, values)
            recorded = replace(recorded, i_a=effect.current(recorded, q))
    return recorded.i_a


def _angle_error(x: Operating, model: Model, values: Values) -> Array:
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
        current = _true_current(bench, model, values) * np.exp(-1j * eps)
        freq = zero
    elif segment.kind == "lcr":
        eps, current = np.radians(signals["theta_elec_deg"]), np.zeros(n, dtype=complex)
        freq = signals.get("freq_hz", zero)
    else:
        eps, freq = zero, zero
        current = signals["id_a"] + 1j * signals["iq_a"]
        table = Recorded(current, zero, eps, zero, segment.ts_s, False, segment.instrument)
        current = _true_current(table, model, values)
    x = _operating(segment, signals, model, values, current, zero, zero, freq)
    return replace(x, eps_rad=eps)


def measured(segment: Segment, signals: Mapping[str, Array], model: Model, values: Values) -> Array:
    """Recorded signals [C, n] of the channels; only the torque is corrected, for its sensor's
    dynamics, and the open-circuit line voltages are turned into the rotor frame.
    """
    if segment.kind == "open":
        v = _open_voltage(signals, model, values)
        return np.stack([v.real, v.imag])
    rows = []
    for channel in segment.channels:
        if channel == "omega_mech_rad_s":
            rows.append(np.zeros(segment.size))
        elif channel == "torque_shaft_nm":
            rows.append(_true_load(segment, signals, model, values))
        else:
            rows.append(signals[channel])
    return np.stack(rows)


def _open_voltage(signals: Mapping[str, Array], model: Model, values: Values) -> Complex:
    lines = {name: signals[name] for name in ("vab_v", "vbc_v", "vca_v") if name in signals}
    if len(lines) == 3:
        mean = sum(lines.values()) / 3.0
        lines = {name: line - mean for name, line in lines.items()}
    ab = lines.get("vab_v")
    bc = lines.get("vbc_v")
    if ab is None:
        ab = -lines["vbc_v"] - lines["vca_v"]
    if bc is None:
        bc = -lines["vab_v"] - lines["vca_v"]
    # a = (2 ab + bc)/3 and b - c = bc with a + b + c = 0
    stationary = (2 * ab + bc) / 3.0 + 1j * bc / math.sqrt(3)
    eps = model.machine.pole_pairs * signals["theta_mech_rad"] - values["bench_angle_rad"]
    voltage: Complex = stationary * np.exp(-1j * eps)
    return voltage


def _true_load(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Array:
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
    if segment.kind == "lcr":
        return _predict_lcr(segment, x, model, values)
    if segment.kind == "flux_map":
        # a flux linkage is a voltage's integral: the voltmeter's gain is in it
        psi = _recorded_voltage(pieces.psi_wb, segment, x, model, values)
        return np.stack([psi.real, psi.imag])
    rows: list[Array] = []
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
    if segment.kind == "dq" and values["ripple_torque"]:
        shaft = shaft + _late_torque(x, pieces, segment.ts_s, values)
    finer = x.theta_rad.size // segment.size
    if finer > 1:
        shaft = _averaged(shaft, finer)
    acceleration = _second_difference(x.theta_rad[::finer], segment.ts_s)
    if segment.channels[-1] == "omega_mech_rad_s":
        # in the angle sensor's units: a torque's noise floor would shrink with the inertia
        return shaft / values["j_kgm2"] - acceleration
    shaft = shaft - values["j_kgm2"] * acceleration
    if segment.channels[-1] == "torque_shaft_nm":
        for effect in model.effects:
            if effect.shaft is not None:
                shaft = effect.shaft(shaft, values_of(effect, model.machine, values))
        shaft = shaft * (1.0 + values["gain_torque"])
    return shaft


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
    eps = x.machine.pole_pairs * x.theta_rad
    held = segment.timing == "held" and segment.kind == "dq"
    difference = _forward if held else _central
    psi, drop = pieces.psi_wb, pieces.drop_v
    slope, omega = difference(psi, period), difference(eps, period)
    if held:
        psi, drop = _ahead(psi), _ahead(drop)
    turn = x.machine.pole_pairs * x.omega_rad_s * period
    averaged = segment.timing != "instant" and segment.kind == "dq"
    shrink = np.sinc(turn / (2 * math.pi)) if averaged else 1.0
    voltage: Complex = drop + slope + 1j * omega * psi
    if segment.kind == "dq" and any(values[name] for name in RIPPLES[:2]):
        shrink = shrink - values["ripple_edge"] * turn**2
        lag = values["ripple_shift"] * 1j * psi * np.gradient(turn) / period
        return shrink * voltage - lag
    return shrink * voltage


def _late_torque(x: Operating, pieces: Pieces, period: float, values: Values) -> Array:
    """Torque [N·m] of what the current moves in a part of a sample period [n]."""
    moved = values["ripple_torque"] * period * _central(x.i_a, period)
    torque: Array = 1.5 * x.machine.pole_pairs * (np.conj(pieces.psi_wb) * moved).imag
    return torque


def _stationary_voltage(segment: Segment, x: Operating, pieces: Pieces) -> Complex:
    turn = np.exp(1j * x.eps_rad)
    voltage: Complex = (pieces.drop_v + _central(pieces.psi_wb, segment.ts_s)) * turn
    return voltage


def _recorded_voltage(
    voltage: Complex, segment: Segment, x: Operating, model: Model, values: Values
) -> Complex:
    for effect in model.effects:
        if effect.voltage is not None:
            q = values_of(effect, model.machine, values)
            voltage = effect.voltage(voltage, x, q, segment.instrument)
    if segment.kind in ("dq", "open") and any(e.angle is not None for e in model.effects):
        voltage = voltage * np.exp(-1j * _angle_error(x, model, values))
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
