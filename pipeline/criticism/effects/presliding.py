"""Friction that builds up over a small angle after each reversal."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    """Drag [n, N·m] beyond dry friction, σ0 z + σ1 dz/dt − T sign(ω).

    The bristles' deflection z is θ_s times `_state`, and dz/dt = ω (1 − sign(ω) z/θ_s).
    """
    state, sense = _state(x, q["travel_rad"]), np.sign(x.omega_rad_s)
    bending = x.omega_rad_s / x.machine.scales["speed_rad_s"] * (1.0 - sense * state)
    return q["torque_nm"] * (state - sense) + q["damping_nm"] * bending


def _state(x: Operating, travel_rad: float) -> Array:
    """Dahl's friction [n] over what it tends to, −1 to 1.

    Within a run of sense s it is s (1 − c exp(−|Δθ|/θ_s)); of the run before there remains
    c_r = 2 − c_(r−1) exp(−|A_(r−1)|/θ_s), A the angle turned in that run.
    """
    if x.shaft.run is None or x.shaft.runs_rad is None:
        lack, sense = np.full(x.travel_rad.size, 2.0), np.sign(x.omega_rad_s)
    else:
        fading = np.exp(-np.abs(x.shaft.runs_rad) / travel_rad)
        lacks = [2.0]
        for factor in fading[:-1].tolist():
            lacks.append(2.0 - lacks[-1] * factor)
        lack, sense = np.array(lacks)[x.shaft.run], np.sign(x.shaft.runs_rad)[x.shaft.run]
    return sense * (1.0 - lack * np.exp(-x.travel_rad / travel_rad))


EFFECT = Effect(
    name="presliding",
    words="after a reversal drag swings over as T (1 − c exp(−|Δθ|/θ_s)), Dahl's solution, with a "
    "bristle damping (LuGre) besides, σ1 ω c exp(−|Δθ|/θ_s), σ1 given by σ1 ω at the highest speed",
    signature="hysteresis of torque against angle within a small angle of a reversal",
    tests=("drive",),
    experiment="slow reversals under load",
    headline=(
        "friction of {torque_nm} that gives like a spring over {travel_rad} after a reversal",
        "friction damped by {damping_nm} that gives like a spring over {travel_rad} after a "
        "reversal",
    ),
    reference="Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995), "
    "doi:10.1109/9.376053: bristles with a damping; without it Dahl, AIAA J. 14 (1976)",
    parameters=(
        Parameter("torque_nm", "N·m", 0.01, 0.001, "torque_nm", low=0.0, high=1.0),
        Parameter("damping_nm", "N·m", 0.1, 0.01, "torque_nm", low=0.0, high=10.0, optional=1),
        Parameter(
            "travel_rad", "rad", 0.001, 0.0001, low=1e-5, high=0.1, scan=(0.0003, 0.003, 0.03)
        ),
    ),
    alternatives={"stribeck": "a spin-down: it has no reversal"},
    torque=_torque,
)
