"""Whether two means are the same for practical purposes: two one-sided tests.

That a difference is not significant shows nothing; few motors or loud instruments do that too.
Reference: D. J. Schuirmann, J. Pharmacokinet. Biopharm. 15 (1987) 657.
"""

from __future__ import annotations

from scipy.special import stdtr, stdtrit

from pipeline.records.lot_constant import Equivalence


def equivalence(
    difference: float, se: float, dof: float, margin: float, alpha: float
) -> Equivalence:
    """`equivalent` where the 1 − 2 alpha interval of the difference lies within ± margin [unit].

    p is the larger of the two one-sided p values. `different`: the interval lies wholly beyond
    one of the margins. Raises ValueError for a margin that is not positive.
    """
    if margin <= 0.0:
        raise ValueError("a margin of sameness is positive")
    dof = min(dof, 1e9)
    half = float(stdtrit(dof, 1.0 - alpha)) * se
    low, high = difference - half, difference + half
    distance = margin - abs(difference)
    p_value = float(stdtr(dof, -distance / se)) if se > 0.0 else 0.0 if distance > 0.0 else 1.0
    if p_value < alpha:
        status = "equivalent"
    elif low > margin or high < -margin:
        status = "different"
    else:
        status = "undecided"
    return Equivalence(status, margin, low, high, p_value, dof)  # type: ignore[arg-type]


NOT_EVALUATED = Equivalence("not_evaluated", None, None, None, None, None)
