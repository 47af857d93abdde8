"""Drag of the air."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    speed = x.omega_rad_s / x.machine.scales["speed_rad_s"]
    return q["drag_nm"] * speed * np.abs(speed)


EFFECT = Effect(
    name="windage",
    words="drag c ω |ω|, given at the highest speed",
    signature="drag that curves upwards with speed",
    tests=("spin_down", "drive"),
    experiment="a spin-down from the highest speed",
    headline="air drag of {drag_nm} at the highest speed",
    reference="Vrancik, NASA TN D-4849 (1968), windage power loss in alternators",
    parameters=(Parameter("drag_nm", "N·m", 0.01, 0.0005, "torque_nm", low=0.0, high=1.0),),
    alternatives={"iron_eddy": "a wider speed range"},
    torque=_torque,
)
