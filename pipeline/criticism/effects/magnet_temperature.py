"""Magnet flux that follows the magnet temperature."""

from __future__ import annotations

from typing import Any

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    return x.base["psi_wb"] * q["alpha_1_k"] * x.magnet_k * x.id_a


EFFECT = Effect(
    name="magnet_temperature",
    words="magnet flux ψ (1 + α (T_m − 25 °C))",
    signature="voltage error proportional to speed, torque error to i_q, times magnet warmth",
    tests=("open_circuit", "drive"),
    experiment="an open-circuit spin with the rotor 30 K warmer",
    headline="a magnet whose flux changes by {alpha_1_k %} a kelvin",
    reference="IEC 60404-8-1: reversible coefficients of magnet materials",
    # Sintered NdFeB loses 0.09 to 0.12 % a kelvin, SmCo less than half of that, ferrite 0.2 %.
    parameters=(
        Parameter("alpha_1_k", "1/K", 0.001, 5e-5, low=-0.01, high=0.002, usual=(-0.0011, 4e-4)),
    ),
    signals=("temp_magnet_degc",),
    coenergy=_coenergy,
)
