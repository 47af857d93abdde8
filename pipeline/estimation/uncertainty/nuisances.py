"""What a fit allowed for beside what it measures, in words that claim no effect."""

from __future__ import annotations

from collections.abc import Sequence


def allowed_for(terms: Sequence[str]) -> str:
    """The nuisance terms of a fit, in words that report no effect.

    Parameters
    ----------
    terms
        Names of the terms.

    Returns
    -------
    str
        Empty where there are none.

    Notes
    -----
    Nuisance terms absorb what would otherwise bias the constants, whatever it comes from, and one
    stands for another. Which effects a motor shows is for `diagnose` to find, which fits all tests
    at once.

    """
    if not terms:
        return ""
    return f"allowed for in this fit, no finding (diagnose tells effects): {', '.join(terms)}"
