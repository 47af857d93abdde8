"""Winding resistance that follows the winding temperature."""

from __future__ import annotations

from pipeline.criticism.effect import Complex, Effect, Operating, Parameter, Values


def _drop(x: Operating, q: Values) -> Complex:
    return x.base["r_ohm"] * q["alpha_1_k"] * x.winding_k * x.i_a


EFFECT = Effect(
    name="copper_temperature",
    words="resistance R (1 + α (T_w − 25 °C))",
    signature="voltage error proportional to current times winding temperature over 25 °C",
    tests=("heat_run",),
    experiment="a heat run: current on a locked rotor until the winding is 40 K warmer",
    headline="a winding whose resistance changes by {alpha_1_k %} a kelvin",
    reference="IEC 60228; conventions: 1/259.5 per kelvin at 25 °C for copper",
    # Copper and aluminium are within a few per cent of each other; alloys of heaters are not.
    parameters=(
        Parameter("alpha_1_k", "1/K", 0.0039, 2e-4, low=-0.001, high=0.01, usual=(0.003854, 1e-4)),
    ),
    signals=("temp_winding_degc",),
    alternatives={"skin_effect": "a heat run at standstill has no speed in it"},
    drop=_drop,
)
