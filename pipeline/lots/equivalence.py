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
    """Whether a difference is practically none: two one-sided t tests.

    Parameters
    ----------
    difference
        Of the means [unit].
    se
        Its standard uncertainty [unit].
    dof
        Degrees of freedom.
    margin
        Difference that matters to nobody [unit], above zero.
    alpha
        Level of each test [1].

    Returns
    -------
    Equivalence
        `equivalent` where the 1 − 2 alpha interval of the difference lies within ± margin,
        `different` where it lies wholly beyond one of the margins, else `undecided`; p is the
        larger of the two one-sided p values.

    Raises
    ------
    ValueError
        The margin is not above zero.

    References
    ----------
    D. J. Schuirmann, J. Pharmacokinet. Biopharm. 15(6), 1987, 657, doi:10.1007/BF01068419.

    Examples
    --------
    >>> [equivalence(d, 0.1, 20.0, 1.0, 0.05).status for d in (0.5, 0.9, 1.5)]
    ['equivalent', 'undecided', 'different']

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


NOT_EVALUATED = Equivalence("not_evaluated")
