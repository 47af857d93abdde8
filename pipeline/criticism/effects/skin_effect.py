"""Alternating-current resistance of the winding."""

from __future__ import annotations

from pipeline.criticism.effect import Complex, Effect, Operating, Parameter, Values


def _drop(x: Operating, q: Values) -> Complex:
    relative = x.freq_hz / x.machine.scales["freq_hz"]
    rise = q["rise"] * relative**2 / (1.0 + (relative / q["knee"]) ** 2)
    if not x.inverter:
        rise = q["meter_rise"] * (x.freq_hz > 0.0).astype(float)
    drop: Complex = x.base["r_ohm"] * rise * x.i_a
    return drop


EFFECT = Effect(
    name="skin_effect",
    words="resistance R (1 + rise s²/(1 + (s/knee)²)), s = f/f_max, f the electrical frequency; "
    "an LCR meter at its own, higher frequency reads R (1 + meter_rise)",
    signature="resistance that grows with electrical speed, whatever the temperature",
    tests=("torque_map", "drive", "lcr"),
    experiment="current steps at the highest speed and at a tenth of it",
    reference="Dowell, Proc. IEE 113 (1966), effects of eddy currents in windings",
    parameters=(
        Parameter("rise", "1", 0.2, 0.01, low=0.0, high=5.0),
        Parameter("meter_rise", "1", 0.2, 0.02, low=0.0, high=50.0, at_least="rise"),
        Parameter("knee", "1", 3.0, 0.0, low=0.3, high=1000.0, scan=(1000.0, 3.0)),
    ),
    signals=("vd_v", "vq_v"),
    rivals={"current_delay": "current steps at standstill and at speed"},
    drop=_drop,
)
