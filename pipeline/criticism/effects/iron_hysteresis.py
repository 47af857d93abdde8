"""Hysteresis of the iron, as the drag it makes and the current that feeds it."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Complex, Effect, Operating, Parameter, Values
from pipeline.criticism.machine.iron import PARALLEL, loss_current


def _torque(x: Operating, q: Values) -> Array:
    flux = np.abs(x.flux_wb / x.base["psi_wb"]) ** (1.0 + q["steeper"])
    return q["drag_nm"] * np.sign(x.omega_rad_s) * flux


def _parallel(x: Operating, q: Values) -> Complex:
    return loss_current(x, _torque(x, q), q["parallel"])


EFFECT = Effect(
    name="iron_hysteresis",
    words="drag proportional to sign(ω) |ψ|^(1 + steeper), given at the magnet's flux; "
    "parallel: a current beside the one that magnetises feeds it",
    signature="torque lost with direction, and with the flux",
    tests=("torque_map",),
    experiment="a torque map with d current; a slow turn without the magnet",
    headline="hysteresis of the iron, a drag of {drag_nm}",
    in_friction=True,
    reference="Bertotti, IEEE Trans. Magn. 24 (1988), general properties of power losses; the "
    "exponent: Steinmetz, Trans. AIEE 9 (1892)",
    parameters=(
        Parameter("drag_nm", "N·m", 0.01, 0.002, "torque_nm", low=0.0, high=1.0),
        Parameter("steeper", "1", 0.6, 0.0, low=0.0, high=1.2, scan=(0.0,), optional=1),
        PARALLEL,
    ),
    signals=("torque_shaft_nm",),
    alternatives={
        "coulomb_friction": "an open-circuit comparison against a rotor without magnet",
        "load_dependent_friction": "d current without torque: it changes the flux only",
    },
    torque=_torque,
    parallel=_parallel,
)
