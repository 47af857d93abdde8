"""Resistance and inductance between terminals, of a wye and of a delta.

Resistance and inductance are wye equivalents. The electrical angle θ is 0 with d on phase a.

Reference: J. R. Hendershot, T. J. E. Miller, Design of Brushless Permanent-Magnet Machines, 2010.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SALIENT_FROM = 1.1
"""Least L_q/L_d of a rotor that is called salient [1]."""
PAIR_AXES_RAD: dict[str, float] = {
    "ab": -math.pi / 6.0,
    "bc": math.pi / 2.0,
    "ca": 7.0 * math.pi / 6.0,
}
"""Electrical angle of the axis of a pair of terminals, from that of phase a."""


def phase_from_line(line: float) -> float:
    """Wye-equivalent phase resistance or inductance from terminal to terminal.

    Parameters
    ----------
    line
        X_ll [ohm or H]. For an inductance, the mean over the rotor's angle.

    Returns
    -------
    float
        X_ll / 2 in the same unit, for either winding: a delta of 1.5 X_ll a winding also reads
        X_ll.

    """
    return line / 2.0


def line_from_phase(phase: float) -> float:
    """Terminal-to-terminal resistance or inductance of a wye-equivalent phase.

    Parameters
    ----------
    phase
        X [ohm or H].

    Returns
    -------
    float
        2 X in the same unit.

    """
    return 2.0 * phase


def delta_from_wye(phase: float) -> float:
    """Resistance or inductance of the winding of a balanced delta from its wye equivalent.

    Parameters
    ----------
    phase
        X [ohm or H].

    Returns
    -------
    float
        3 X in the same unit.

    """
    return 3.0 * phase


def wye_from_delta(winding: float) -> float:
    """Wye-equivalent phase resistance or inductance of the winding of a balanced delta.

    Parameters
    ----------
    winding
        X [ohm or H].

    Returns
    -------
    float
        X / 3 in the same unit.

    """
    return winding / 3.0


class Phases(NamedTuple):
    """One value a phase or a pair: a, b, c, or ab, bc, ca."""

    a: float
    b: float
    c: float


def phase_resistances_ohm(rab_ohm: float, rbc_ohm: float, rca_ohm: float) -> Phases:
    """Wye-equivalent phase resistances from three line-to-line ones, balanced or not.

    Parameters
    ----------
    rab_ohm, rbc_ohm, rca_ohm
        Between two terminals, the third open [ohm].

    Returns
    -------
    Phases
        a, b, c [ohm].

    Notes
    -----
    R_a = (R_ab + R_ca − R_bc)/2 and its turns; exact for a delta too, being its star equivalent.

    Examples
    --------
    >>> phase_resistances_ohm(3.0, 5.0, 4.0)
    Phases(a=1.0, b=2.0, c=3.0)

    """
    return Phases(
        (rab_ohm + rca_ohm - rbc_ohm) / 2.0,
        (rab_ohm + rbc_ohm - rca_ohm) / 2.0,
        (rbc_ohm + rca_ohm - rab_ohm) / 2.0,
    )


def line_resistances_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Line-to-line resistances from the phases of a wye.

    Parameters
    ----------
    ra_ohm, rb_ohm, rc_ohm
        Phases.

    Returns
    -------
    Phases
        ab, bc and ca [ohm].

    """
    return Phases(ra_ohm + rb_ohm, rb_ohm + rc_ohm, rc_ohm + ra_ohm)


def delta_windings_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Windings of the delta that a wye is equivalent to (Kennelly's theorem).

    Parameters
    ----------
    ra_ohm, rb_ohm, rc_ohm
        Phases of the wye [ohm], above zero.

    Returns
    -------
    Phases
        Windings ab, bc, ca [ohm].

    Notes
    -----
    R_ab = (R_a R_b + R_b R_c + R_c R_a)/R_c and its turns.

    Examples
    --------
    >>> delta_windings_ohm(1.0, 1.0, 1.0)
    Phases(a=3.0, b=3.0, c=3.0)

    """
    total = ra_ohm * rb_ohm + rb_ohm * rc_ohm + rc_ohm * ra_ohm
    return Phases(total / rc_ohm, total / ra_ohm, total / rb_ohm)


def terminal_inductance_h(
    ld_h: float, lq_h: float, theta_elec_rad: ArrayLike, pair: str = "ab"
) -> Array:
    """Inductance between two terminals, the third open, at electrical angles.

    Parameters
    ----------
    ld_h, lq_h
        Inductances of the axes [H].
    theta_elec_rad
        Electrical angle of d from phase a [n, rad].
    pair
        ab, bc or ca.

    Returns
    -------
    array [n, H]

    Raises
    ------
    KeyError
        There is no such pair.

    Notes
    -----
    L = (L_d + L_q) + (L_d − L_q) cos 2(θ − θ_pair) with θ_pair = −30° (ab), 90° (bc), 210° (ca),
    the direction of the pair's current: 2 L_d where d lies on it, 2 L_q a quarter turn from there.

    References
    ----------
    Hendershot and Miller, Design of Brushless Permanent-Magnet Machines, 2010.

    Examples
    --------
    >>> float(terminal_inductance_h(1e-3, 2e-3, -math.pi / 6.0))
    0.002

    """
    swing = np.cos(2.0 * (np.asarray(theta_elec_rad, dtype=np.float64) - PAIR_AXES_RAD[pair]))
    return (ld_h + lq_h) + (ld_h - lq_h) * swing


class UnalignedInductances(NamedTuple):
    """Axis inductances [H] without knowing which is d, and where the low one lies [rad, mod π]."""

    low_h: float
    high_h: float
    theta_low_rad: float


def unaligned_inductances_h(lab_h: float, lbc_h: float, lca_h: float) -> UnalignedInductances:
    """Both axis inductances from all three pairs at one unknown rotor angle.

    Parameters
    ----------
    lab_h, lbc_h, lca_h
        Between two terminals, the third open, the rotor at one angle throughout [H].

    Returns
    -------
    UnalignedInductances
        With interior magnets the low one is L_d and `theta_low_rad` the electrical angle of d, up
        to half a turn; which is which needs the back-EMF or an alignment.

    Notes
    -----
    L = (m ∓ A)/2 with m the mean of the pairs and A = √(⅔ Σ(L_pair − m)²).

    References
    ----------
    Hendershot and Miller, Design of Brushless Permanent-Magnet Machines, 2010.

    """
    read = dict(zip(("ab", "bc", "ca"), (lab_h, lbc_h, lca_h), strict=True))
    mean = (lab_h + lbc_h + lca_h) / 3.0
    # The pairs lie 120° apart, so their mean drops out of both sums.
    cosine = sum(v * math.cos(2.0 * PAIR_AXES_RAD[k]) for k, v in read.items()) / 1.5
    sine = sum(v * math.sin(2.0 * PAIR_AXES_RAD[k]) for k, v in read.items()) / 1.5
    swing = math.hypot(cosine, sine)
    theta_low = math.atan2(-sine, -cosine) / 2.0 % math.pi
    return UnalignedInductances((mean - swing) / 2.0, (mean + swing) / 2.0, theta_low)


def saliency_words(ratio: float, u: float = 0.0) -> str:
    """What L_q/L_d says of the rotor, in words.

    Parameters
    ----------
    ratio
        L_q over L_d [1].
    u
        Its standard uncertainty [1].

    Returns
    -------
    str
        Surface magnets where the ratio is within 10 % or 2 u of 1, whichever is more.

    """
    margin = max(SALIENT_FROM - 1.0, 2.0 * u)
    if ratio > 1.0 + margin:
        return "interior magnets, salient"
    if ratio < 1.0 - margin:
        return "L_d above L_q: d and q exchanged, or a flux-intensifying rotor"
    return "surface magnets, not salient"
