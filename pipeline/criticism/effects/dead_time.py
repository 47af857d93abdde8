"""Inverter dead time, and what its compensation leaves: by the sign of each phase current."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.effect import Array, Complex, Effect, Operating, Parameter, Values, choice
from pipeline.criticism.machine.inverter import (
    lost_shares,
    phases_of,
    swept_shares,
    turning,
    vector_of,
)

_SWITCHED = ("r_ohm", "ld_h", "lq_h")
"""Constants by which a current moves within a switching period."""
_EDGES, _MOMENTS = 1.0, 2.0
"""Choices of `ripple`."""


def _drop(x: Operating, q: Values) -> Complex:
    if not x.inverter or x.supply.measured:
        return np.zeros(x.omega_rad_s.shape, dtype=complex)
    given_v = _given(x, q) if q["given_v"] else 0.0
    whole_v = q["loss_v"] + q["given_v"]
    if q["given_v"] and x.supply.volts_v is not None:
        x = x.fed(volts_v=x.supply.volts_v + given_v)
    on: Complex = q["on_v"] / x.machine.scales["current_a"] * x.i_a
    if not (q["loss_v"] or q["given_v"]):
        return on
    rotor: Complex = whole_v * _lost(x, q, whole_v) - given_v
    return rotor + on if q["on_v"] else rotor


def _lost(x: Operating, q: Values, whole_v: float) -> Complex:
    """What is lost [n] of a voltage `whole_v` [V], in the rotor frame; once a state, whatever the
    drop of the switches is, and but for the edges whatever the voltage is.
    """
    lag_s, ripple, width_a = q["lag_s"], q["ripple"], q["width_a"]

    def lost() -> tuple[list[Any], Complex]:
        turn, phases, eps = _phases(x, lag_s)
        if ripple == _EDGES:
            shares = lost_shares(x, eps, phases, whole_v, width_a)
        elif ripple == _MOMENTS:
            shares = swept_shares(x, eps, phases, width_a)
        else:
            shares = np.tanh(phases / width_a)
        return of, vector_of(shares) * np.conj(turn)

    of = [x.eps_rad, x.omega_rad_s, x.psi_wb, x.supply.volts_v]
    numbers = (*(x.base[name] for name in _SWITCHED), lag_s, ripple, width_a)
    numbers += x.ts_s, x.supply.pwm_s, x.supply.vdc_v
    loss_v = whole_v if ripple == _EDGES else 0.0
    return x.once(x.i_a, ("lost", *map(id, of), *numbers, loss_v), lost)[1]


def _given(x: Operating, q: Values) -> Complex:
    """Voltage [n, V] that a drive adds against its dead time: by the sign of each phase current
    that it sampled a while before, in proportion to the current where that is small.
    """
    _, phases, _ = _phases(x, q["given_lag_s"])
    turn = x.once(x.eps_rad, "turning", lambda: turning(x.eps_rad))
    return q["given_v"] * vector_of(np.tanh(phases / q["ramp_a"])) * np.conj(turn)


def _phases(x: Operating, lag_s: float) -> tuple[Complex, Array, Array]:
    """Unit vector of the rotor [n], phase currents [3, n, A] and angle [n, rad], a lag before."""
    before, eps = x.i_a, x.eps_rad
    if lag_s:
        before = before - np.gradient(before) * (lag_s / x.point_s)
        eps = _lagging(x, lag_s)
    turn = x.once(eps, "turning", lambda: turning(eps))
    return turn, phases_of(before * turn), eps


def _lagging(x: Operating, lag_s: float) -> Array:
    """Electrical angle [n, rad] a lag before, at the speed of the sample."""
    omega = x.omega_rad_s

    def angle() -> tuple[Array, Array]:
        return omega, x.eps_rad - x.machine.pole_pairs * omega * lag_s

    _, before = x.once(x.eps_rad, ("lagging", lag_s, id(omega)), angle)
    return before


def _sampled(x: Operating, q: Values) -> Complex:
    """Current [n, A] by which samples exceed their mean.

    A dead time t_d = T V/V_dc makes pulses late by half of it, while a drive samples midway between
    those that it commands. The winding is shorted there, so that current falls by v/L, v = R i +
    j ω_e ψ, from the sample to that middle.
    """
    supply, l_d, l_q = x.supply, x.base["ld_h"], x.base["lq_h"]
    if not (x.inverter and q["sampled"] and supply.vdc_v and l_d and l_q):
        return np.zeros(x.omega_rad_s.shape, dtype=complex)
    early_s = 0.5 * q["sampled"] * (q["loss_v"] + q["given_v"]) * supply.pwm_s / supply.vdc_v
    volts = x.base["r_ohm"] * x.i_a + 1j * x.machine.pole_pairs * x.omega_rad_s * x.flux_wb
    fallen: Complex = early_s * volts
    return fallen.real / l_d + 1j * fallen.imag / l_q


def _torque(x: Operating, q: Values) -> Array:
    """Torque [n, N·m] that the recorded current seems to make beyond its mean's."""
    return 1.5 * x.machine.pole_pairs * (np.conj(x.flux_wb) * _sampled(x, q)).imag


EFFECT = Effect(
    name="dead_time",
    words="each phase loses (V + V_c) tanh(i/width), in the limit the sign of i, i a lag before "
    "the sample, or what the edges (ripple 1) or moments (2) of a switching period make of it, of "
    "which a compensation gives back V_c tanh(i/ramp), i its own lag before; and on_v i/i_max in "
    "its switches; current is sampled half a dead time before the middle of its pulses",
    signature="voltage offset at small current, orders 6ε, the same at every speed",
    tests=("torque_map", "drive", "heat_run"),
    experiment="steps of current from a hundredth of rated current up, at low speed",
    headline="voltage lost in the inverter, {loss_v} a phase",
    reference="Jeong & Park, IEEE Trans. Ind. Electron. 38 (1991), dead-time effect in PWM; Choi & "
    "Sul, IEEE Trans. Ind. Appl. 32 (1996), zero current clamping; Mohan, Undeland & Robbins, "
    "Power Electronics, 3rd ed. (2003), ch. 2, drop of a switch that is on",
    parameters=(
        Parameter(
            "loss_v",
            "V",
            0.01,
            0.0005,
            "voltage_v",
            low=-0.5,
            high=0.5,
            words="at a large current, less what a compensation gives back; below 0 of one that "
            "gives back too much",
        ),
        Parameter(
            "width_a", "A", 0.02, 0.0, "current_a", low=0.0003, high=0.3, scan=(0.001, 0.01, 0.05)
        ),
        # of itself it would be any resistance: it makes no effect large enough to be named
        Parameter("on_v", "V", 0.005, 0.0, "voltage_v", low=0.0, high=0.1, optional=1),
        choice(
            "ripple",
            (0.0, 1.0, 2.0),
            "as pwm_hz, vdc_v and L switch it, 1: by the current at the edges, as a dead "
            "time acts, 2: by that of each moment, as thresholds of switches do; 0: by the mean",
        ),
        Parameter(
            "sampled",
            "1",
            1.0,
            0.0,
            low=0.0,
            high=4.0,
            scan=(0.0,),
            usual=(1.0, 0.5),
            words="of half a dead time, by which a current is sampled before the middle of a pulse",
        ),
        # the edges that lose it are within half a PWM period of the sample, here one of 10 kHz
        Parameter(
            "lag_s",
            "s",
            0.25,
            0.0,
            "period_s",
            low=-1.0,
            high=1.0,
            scan=(0.0,),
            usual=(0.0, 5e-5),
        ),
        Parameter(
            "given_v",
            "V",
            0.01,
            0.0,
            "voltage_v",
            low=0.0,
            high=0.5,
            optional=2,
            words="given back by the drive's compensation, of what loss_v lacks",
        ),
        Parameter(
            "ramp_a",
            "A",
            0.02,
            0.0,
            "current_a",
            low=0.0003,
            high=0.5,
            scan=(0.03, 0.2),
            optional=2,
            words="over which the compensation changes over",
        ),
        Parameter(
            "given_lag_s",
            "s",
            0.25,
            0.0,
            "period_s",
            low=-1.0,
            high=3.0,
            scan=(0.0,),
            optional=2,
            words="from the sample that a compensation takes its sign of to where it acts",
        ),
    ),
    signals=("vd_v", "vq_v"),
    alternatives={"copper_temperature": "several currents: dead time does not grow with current"},
    drop=_drop,
    parallel=_sampled,
    torque=_torque,
)
