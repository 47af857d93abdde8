"""Error of a torque per ampere at standstill from the angle at which the rotor is held."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.estimation.electrical.operating_points import Point
from pipeline.estimation.policy import policy
from pipeline.records.capture import Array
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Contribution

SOURCE = "assumed:locked_angle"
# Pairs of back-EMF harmonics that make torque ripple of the same order, 6 or 12 a cycle. A winding
# that is sold as sinusoidal keeps the lower ones to a few per cent of the fundamental.
RIPPLES = {
    6: ("bemf_harmonic_5", "bemf_harmonic_7"),
    12: ("bemf_harmonic_11", "bemf_harmonic_13"),
}
HARMONICS = tuple(name for pair in RIPPLES.values() for name in pair)


def angle_doubt(
    points: Sequence[Point], kt_nm_a: float, pole_pairs: int | None, known: Constants
) -> tuple[Contribution, ...]:
    """Standard uncertainty of Kt [N·m/A] by torque ripple, which turning averages out; () if so.

    Harmonics h5 and h7 of the back-EMF make the torque of a steady current ripple by up to
    (h5 + h7) cos(6 p theta + phi), phi unknown: a standard uncertainty of (h5 + h7)/sqrt(2) at one
    angle, and so h11 and h13 with 12. Points at several angles cancel as the mean of
    exp(6 j p theta) does, those of a turning shaft count as 0. References: Jahns and Soong, IEEE
    Trans. Ind. Electron. 43(2), 1996 (torque ripple); JCGM 101:2008, 6.4.6 (a cosine of unknown
    phase).

    Parameters
    ----------
    points
        That the torque constant rests on.
    kt_nm_a
        The torque constant [N·m/A].
    pole_pairs
        None where not known.
    known
        Constants found so far: harmonics of the back-EMF.

    Returns
    -------
    tuple of Contribution
        [N·m/A]; empty where all points turn.

    """
    angles = np.array([p.angle_rad for p in points if p.standing])
    if not angles.size:
        return ()
    u = ripple_share(angles, pole_pairs, known) * abs(kt_nm_a) * angles.size / len(points)
    return (Contribution(SOURCE, u, "B"),)


def ripple_share(angles_rad: Array, pole_pairs: int | None, known: Constants) -> float:
    """Relative standard uncertainty of a torque constant over these mechanical angles [n, rad].

    Angles that are not known (NaN), and any angle without pole pairs, cancel nothing.

    Parameters
    ----------
    angles_rad : array [n], rad
        Mechanical angles at which the rotor was held.
    pole_pairs
        None where not known.
    known
        Constants found so far: harmonics of the back-EMF.

    Returns
    -------
    float
        [1].

    """
    alone = pole_pairs is None or not np.all(np.isfinite(angles_rad))
    parts, usual = [], {6: policy().ripple.usual_6, 12: policy().ripple.usual_12}
    for order, names in RIPPLES.items():
        inductances = [known.best(name) for name in names]
        ripple = sum(usual[order] if one is None else one.number for one in inductances)
        share = 1.0 if alone else abs(np.mean(np.exp(1j * order * (pole_pairs or 1) * angles_rad)))
        parts.append(float(ripple * share) / np.sqrt(2.0))
    return float(np.hypot(*parts))


def standstill_words(points: Sequence[Point], used: Sequence[Point]) -> str:
    """What becomes of operating points at standstill, in words.

    Parameters
    ----------
    points
        The points that a fit uses.
    used
        All points that there are.

    Returns
    -------
    str
        Empty where no point stands still.

    """
    count = sum(p.standing for p in used)
    if not count:
        return ""
    if not any(p.standing for p in points):
        return f"{count} points at standstill left out"
    return (
        f"{count} points at standstill: torque ripple is that of their angle, and static friction "
        "cannot be separated from torque"
    )
