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
    reference="IEC 60404-8-1: reversible coefficients of magnet materials",
    parameters=(Parameter("alpha_1_k", "1/K", 0.001, 0.00005, low=-0.01, high=0.002),),
    signals=("temp_magnet_degc",),
    coenergy=_coenergy,
)
