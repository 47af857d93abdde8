"""Alternating current in the winding: it meets more resistance, and less inductance."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any

import numpy as np

from pipeline.criticism.effect import Array, Complex, Effect, Operating, Parameter, Values
from pipeline.criticism.operating import Flags


def _stepped(x: Operating) -> Flags:
    """Whether a bench steps the current at each sample [n], at standstill."""
    return (x.omega_rad_s == 0.0) & (not x.inverter) & (x.freq_hz == 0.0)


def _above(x: Operating) -> Flags:
    """Whether a meter's frequency is above any of the machine's, at each sample [n]."""
    at_rest = (x.omega_rad_s == 0.0) & (not x.inverter)
    return at_rest & (x.freq_hz > x.machine.scales["freq_hz"])


def _square(x: Operating) -> Array:
    """Square [n] of the frequency over the machine's highest."""
    return (x.freq_hz / x.machine.scales["freq_hz"]) ** 2


def _late_s(x: Operating, q: Values) -> float:
    """Time that the field needs to move into the conductors [s]: √bend/ω_max."""
    return math.sqrt(q["bend"]) / (2.0 * math.pi * x.machine.scales["freq_hz"])


def _inner_h(x: Operating, q: Values) -> float:
    """Inductance of the field inside the conductors [H]: the resistance that stands beside it,
    R rise (1 + bend)/bend, times the time that it is late by. Nothing without a bend.
    """
    if not (q["inner"] and q["bend"]):
        return 0.0
    beside = x.base["r_ohm"] * q["rise"] * (1.0 + q["bend"]) / q["bend"]
    return q["inner"] * beside * _late_s(x, q)


def _coenergy(x: Operating, q: Values) -> Any:
    bent = q["bend"] * _square(x)
    share = _inner_h(x, q) * np.where(_stepped(x), 1.0, bent / (1.0 + bent))
    return -0.5 * share * (x.id_a * x.id_a + x.iq_a * x.iq_a)


def _drop(x: Operating, q: Values) -> Complex:
    square = _square(x)
    rise = q["rise"] * square * (1.0 + q["bend"]) / (1.0 + q["bend"] * square)
    rise = np.where(_above(x), q["meter_rise"], rise)
    drop: Complex = x.base["r_ohm"] * rise * x.i_a
    if _inner_h(x, q) and _stepped(x).all():
        drop = drop + _in_a_step(x, q)
    return drop


def _in_a_step(x: Operating, q: Values) -> Complex:
    """Voltage [n, V] while the field moves into the conductors: L_i di/dt, late by τ = √bend/ω_max
    as the current in a resistance beside L_i is, straight lines from sample to sample.
    """
    late = _late_s(x, q)
    decay = math.exp(-x.ts_s / late)
    new = 1.0 - (1.0 - decay) * late / x.ts_s
    current = np.asarray(x.i_a)
    moves = new * current[1:] + (1.0 - decay - new) * current[:-1]
    inwards = accumulate(moves.tolist(), lambda now, move: decay * now + move, initial=current[0])
    inside = np.fromiter(inwards, dtype=np.complex128, count=current.size)
    return _inner_h(x, q) / late * (current - inside)


EFFECT = Effect(
    name="skin_effect",
    words="resistance R (1 + rise s² (1 + bend)/(1 + bend s²)), s = f/f_max of the electrical "
    "frequency; where inner, inductance L - L_i bend s²/(1 + bend s²) with L_i = "
    "R rise (1 + bend)/(√bend 2π f_max), and in a step the field inside the conductors comes late "
    "by √bend/(2π f_max); an LCR meter at its own, higher frequency reads R (1 + meter_rise) and "
    "L - L_i",
    signature="resistance that grows with electrical speed, whatever the temperature",
    tests=("torque_map", "drive", "lcr"),
    experiment="current steps at the highest speed and at a tenth of it",
    headline=(
        "resistance that grows with frequency, by {rise %} at the highest speed",
        "resistance that grows with frequency, by {meter_rise %} at the meter's",
    ),
    reference="Dowell, Proc. IEE 113 (1966), effects of eddy currents in windings; Foster, Bell "
    "Syst. Tech. J. 3 (1924), a reactance theorem",
    parameters=(
        Parameter("rise", "1", 0.2, 0.01, low=0.0, high=5.0),
        Parameter("meter_rise", "1", 0.2, 0.02, low=0.0, high=50.0, at_least="rise"),
        Parameter("inner", "1", 1.0, 0.0, low=0.0, high=1.0, scan=(0.0, 1.0), choice=True),
        Parameter("bend", "1", 0.3, 0.0, low=0.0, high=11.0, scan=(0.0, 1.0)),
    ),
    signals=("vd_v", "vq_v"),
    alternatives={"current_delay": "current steps at standstill and at speed"},
    coenergy=_coenergy,
    drop=_drop,
)
