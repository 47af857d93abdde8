"""Voltage, or a drive's own speed, logged later or earlier than the current: dq voltages turned by
ω_e τ.
"""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import (
    Array,
    Complex,
    Effect,
    Operating,
    Parameter,
    Values,
    between,
    choice,
)


def _voltage(v_v: Complex, x: Operating, q: Values, _: str) -> Complex:
    if not x.inverter or q["of_speed"]:
        return v_v
    turn = x.machine.pole_pairs * x.omega_rad_s * q["delay_s"]
    if x.supply.q_alone:
        # what is turned into the q axis cannot be known without the d axis
        return v_v + 1j * q["delay_s"] / x.ts_s * np.gradient(v_v.imag)
    return v_v * np.exp(1j * turn)


def _speed(omega: Array, q: Values, period: float) -> Array:
    back = q["of_speed"] * q["delay_s"] / period
    return between(omega, np.arange(omega.size, dtype=np.float64) - back) if back else omega


EFFECT = Effect(
    name="sample_delay",
    words="recorded dq voltage = true one turned by ω_e τ; of the q axis alone, v(t + τ), or a "
    "drive's own speed ω(t − τ)",
    signature="v_d error proportional to ω_e v_q, hence even in speed",
    tests=("torque_map", "drive"),
    experiment="constant speeds in both senses, at two speeds at least",
    headline="voltages or speed of the drive's log off in time by {delay_s}",
    reference="Bae & Sul, IEEE Trans. Ind. Appl. 39 (2003), time delay of digital control",
    parameters=(
        # a command is logged before it acts, a speed after it was measured
        Parameter("delay_s", "s", 0.5, 0.02, "period_s", low=-5.0, high=5.0, rare_below=0.0),
        choice(
            "of_speed",
            (0.0, 1.0),
            "1: the drive's own speed is late behind the angle, 0: the voltages are off",
        ),
    ),
    signals=("vd_v", "vq_v"),
    alternatives={
        "angle_offset": "both rotation senses: a delay is even in speed, an angle odd",
        "current_delay": "current steps at standstill",
    },
    voltage=_voltage,
    speed=_speed,
)
