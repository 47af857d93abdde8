"""Eddy currents in the iron, as the drag they make."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Complex, Effect, Operating, Parameter, Values
from pipeline.criticism.machine.iron import PARALLEL, loss_current


def _torque(x: Operating, q: Values) -> Array:
    flux = np.abs(x.flux_wb / x.base["psi_wb"])
    speed = x.omega_rad_s / x.machine.scales["speed_rad_s"]
    drag: Array = q["drag_nm"] * speed * flux**2
    if q["excess_nm"]:
        drag = drag + q["excess_nm"] * np.sign(speed) * np.sqrt(np.abs(speed)) * flux**1.5
    return drag


def _parallel(x: Operating, q: Values) -> Complex:
    return loss_current(x, _torque(x, q), q["parallel"])


EFFECT = Effect(
    name="iron_eddy",
    words="drag proportional to ω |ψ|², and to √ω |ψ|^1.5 by excess loss, given at the highest "
    "speed and the magnet's flux; parallel: a current "
    "beside the one that magnetises feeds it",
    signature="torque lost with speed, and with the square of the flux",
    tests=("torque_map", "spin_down"),
    experiment="a torque map at two speeds with d current; a spin-down without the magnet",
    headline=(
        "eddy currents in the iron, a drag of {drag_nm} at the highest speed",
        "excess loss in the iron, a drag of {excess_nm} at the highest speed",
    ),
    in_friction=True,
    reference="Bertotti, IEEE Trans. Magn. 24 (1988), general properties of power losses",
    parameters=(
        Parameter("drag_nm", "N·m", 0.02, 0.002, "torque_nm", low=0.0, high=1.0),
        Parameter("excess_nm", "N·m", 0.01, 0.002, "torque_nm", low=0.0, high=1.0, optional=1),
        PARALLEL,
    ),
    signals=("torque_shaft_nm",),
    alternatives={
        "windage": "a wider speed range",
        "load_dependent_friction": "d current without torque: it changes the flux only",
    },
    torque=_torque,
    parallel=_parallel,
)
