"""A shaft in two parts: motor and far inertia, with a twist between them.

The coupling passes S = T − drags − (1 − f) J θ″ on to the far part, f its share of the inertia.
The far angle is θ less the twist, so that with a load at the far end

    T_load = S − f J (θ″ − twist″) = [T − drags − J θ″] + f J twist″,

while a dynamometer that holds the far end, or a transducer in the coupling, reads S itself,
[T − drags − J θ″] + f J θ″. Motor angle and load are recorded; the twist is a function of S, of a spring or of a spring
behind a gap: what `closer` tells from whole logs. A coasting shaft passes on next to nothing.

References: [1] Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000); [2] Nordin & Gutman, Automatica 38
(2002), backlash as a dead zone of the twist; [3] Savitzky & Golay, Anal. Chem. 36 (1964).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from pipeline.criticism.effect import Array, Operating, Told, Values, Whole
from pipeline.criticism.twist import Shaft, law_of_twist

_WIDTH_S = 0.004
_MOST = 23
_LEAST = 7
_DEGREE = 4
_SURE = 3.5
_FEW = 6
_NO_GAP_RAD = 2e-4


def passed_on(x: Operating, share: float) -> Array:
    """Torque S [n] that the motor's side passes on [N·m], drags left out, which change slowly.

    `share` of the inertia is at the far end. Quartics over 4 ms [3] keep the encoder's rounding,
    twice differenced, out of it and leave a resonance of some 100 Hz as it is.
    """
    near = (1.0 - share) * x.base["j_kgm2"]
    torque: Array = _smooth(x.torque_nm, x.ts_s, 0) - near * _smooth(x.theta_rad, x.ts_s, 2)
    return torque


def far_drag(x: Operating, share: float, between: bool, twist_rad: Callable[[], Array]) -> Array:
    """What a far inertia takes from the shaft torque [n] beyond a rigid shaft's [N·m].

    `between`: the transducer stands between the two parts, and reads S whatever holds the far end.
    """
    if not x.inverter:
        return np.zeros(np.shape(x.omega_rad_s))
    far = share * x.base["j_kgm2"]
    if not (x.held or between):
        return -far * _smooth(twist_rad(), x.ts_s, 2)
    acceleration = np.zeros(x.theta_rad.size)
    acceleration[1:-1] = np.diff(x.theta_rad, 2) / x.ts_s**2
    return -far * acceleration


def closer(wholes: Sequence[Whole], q: Values) -> Told | None:
    """Backlash or compliance, from drive logs in which the torque changes its sign.

    It is a gap where it is surely one, and more than what the spring gives at the torque that is
    passed on; a spring where such a gap is surely not there.
    """
    between, share = q["between"] > 0.0, q["share"]
    if share <= 0.0 or not wholes:
        return None
    law = law_of_twist(_shaft(one, between, share) for one in wholes)
    if law is None or law.windows < _FEW:
        return None
    part = 1.0 if between else share
    gap, u_gap = law.gap_rad / part, law.u_gap_rad / part
    torque = wholes[0].x.machine.scales["torque_nm"] / part
    values = {"twist_rad": (torque * law.softness, torque * law.u_softness)}
    if law.softness < _SURE * law.u_softness:
        values.clear()
    matters = max(_NO_GAP_RAD, law.softness / part * law.torque_nm)
    if gap > max(matters, _SURE * u_gap):
        return Told("backlash", {**values, "gap_rad": (gap, u_gap)})
    return Told("compliance", values) if gap + _SURE * u_gap < matters else None


def _shaft(one: Whole, between: bool, share: float) -> Shaft:
    """What a log tells of the coupling: its torque itself, or the momentum of both parts."""
    x, inertia = one.x, one.x.base["j_kgm2"]
    driving = x.torque_nm - one.drag_nm
    u_both = math.hypot(one.u_shaft_nm, one.u_air_gap_nm)
    return Shaft(
        x.ts_s,
        x.theta_rad,
        one.shaft_nm if between else driving,
        one.shaft_nm if between else driving - one.shaft_nm,
        0.0 if between else (1.0 - share) * inertia,
        share * inertia if between else inertia,
        one.u_theta_rad,
        one.u_shaft_nm if between else u_both,
        one.good,
    )


def _smooth(signal: Array, period_s: float, derivative: int) -> Array:
    """A signal [n] or its derivative by a local quartic; zero where it has no room."""
    width = max(min(2 * round(_WIDTH_S / period_s / 2) + 1, _MOST), _LEAST)
    found = np.zeros(signal.size)
    if signal.size < width:
        return found
    half = width // 2
    inner = np.convolve(signal, _quartic(width, derivative), mode="valid")
    found[half : signal.size - half] = inner / period_s**derivative
    return found


@cache
def _quartic(width: int, derivative: int) -> Array:
    """Weights [width], last sample first, of a local quartic's derivative at its middle [3]."""
    at = np.arange(width) - width // 2
    rows: Array = np.linalg.pinv(np.vander(at, _DEGREE + 1, increasing=True).astype(float))
    weights: Array = math.factorial(derivative) * rows[derivative][::-1]
    return weights
