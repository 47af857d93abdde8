"""Uncertainty budgets: named, signed contributions that remember what they share.

Two constants of one motor that were read with one current sensor carry the same contribution
`current@STATION`; their covariance is the sum over the sources they share, so a ratio in which
the gain cancels is judged with the gain gone.

References: JCGM 100:2008 (GUM), 5.1-5.2 (propagation, correlation) and G.4 (Welch-Satterthwaite).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from pipeline.records.field_kinds import Extension, Name, SpreadOrNull

Kind = Literal["A", "B"]
BETWEEN = "between:"
"""Begins the source of what independent equations, captures or methods of one constant scatter
beyond their own uncertainties: part of u like any other, kept separate to show why u is wide."""
METHODS = f"{BETWEEN}methods:"
"""Begins the source of what different methods of one constant scatter."""
COVERAGE = 0.9545
"""Level at which k is 2 for infinite degrees of freedom (GUM G.6.4 and table G.2)."""


@dataclass(frozen=True, slots=True)
class Contribution:
    """A signed standard uncertainty [unit of the estimate] from one source.

    `source` names the origin: an instrument (`current@rig-1`) or one fit's scatter
    (`scatter:spin_down:tau`). Equal sources are fully correlated, different ones independent.

    Attributes
    ----------
    source
        An instrument (`current@rig-1`) or the scatter of one fit (`scatter:spin_down:tau`). Equal
        sources are fully correlated, different ones independent.
    u
        With the sign of the sensitivity [unit of the estimate].
    kind
        `A` from scatter, `B` from other knowledge.
    dof
        Degrees of freedom of u.

    """

    source: Name
    u: float
    kind: Kind
    dof: Extension[SpreadOrNull] = math.inf


Budget = tuple[Contribution, ...]


def type_a(source: str, u: float, dof: float = math.inf) -> Budget:
    """A budget of one scatter contribution (GUM 4.2).

    Parameters
    ----------
    source
        Name of the fit.
    u
        Standard uncertainty [unit of the estimate].
    dof
        Its degrees of freedom.

    """
    return (Contribution(source, u, "A", dof),)


def type_b(source: str, u: float, dof: float = math.inf) -> Budget:
    """A budget of one contribution known from elsewhere (GUM 4.3), usually an instrument.

    Parameters
    ----------
    source
        Name of the instrument and its station.
    u
        Signed standard uncertainty [unit of the estimate].
    dof
        Its degrees of freedom.

    """
    return (Contribution(source, u, "B", dof),)


def propagate(terms: Iterable[tuple[float, Budget]]) -> Budget:
    """First-order propagation: the budget of Σ c_i x_i.

    Parameters
    ----------
    terms
        Pairs of a sensitivity c_i [unit of the result over unit of x_i] and the budget of x_i.

    Returns
    -------
    Budget
        Contributions of one source are added with their signs; sorted by source, so that equal work
        gives equal bytes.

    References
    ----------
    JCGM 100:2008 (GUM), eq. 13, for sources that are independent of each other.

    Examples
    --------
    A gain of 1 % that two readings of 2 share is gone in their difference:

    >>> gain = type_b("current@rig", 0.02)
    >>> standard_uncertainty(propagate([(1.0, gain), (-1.0, gain)]))
    0.0

    """
    sums: dict[str, Contribution] = {}
    for sensitivity, budget in terms:
        for part in budget:
            before = sums.get(part.source)
            u = sensitivity * part.u + (before.u if before else 0.0)
            sums[part.source] = Contribution(part.source, u, part.kind, part.dof)
    return tuple(sums[source] for source in sorted(sums))


def standard_uncertainty(budget: Budget, kind: Kind | None = None) -> float:
    """Root sum of squares of the contributions.

    Parameters
    ----------
    budget
        Its sources are different from each other.
    kind
        `A` or `B` alone; both where not given.

    Returns
    -------
    float
        Unit of the estimate.

    Examples
    --------
    >>> standard_uncertainty((*type_a("scatter:x", 3.0), *type_b("current@rig", 4.0)))
    5.0

    """
    return math.sqrt(sum(part.u**2 for part in budget if kind in (None, part.kind)))


def without_between(budget: Budget, source: str = BETWEEN) -> Budget:
    """The budget as it was before the scatter between equations, captures and methods joined.

    Parameters
    ----------
    budget
        Of a constant.
    source
        What the sources begin with that go: all scatter between, or, with `METHODS`, that between
        methods alone, which a check must not see, for a disagreement does not excuse itself.

    Returns
    -------
    Budget
        The other contributions.

    """
    return tuple(part for part in budget if not part.source.startswith(source))


def covariance(one: Budget, other: Budget) -> float:
    """Covariance of two estimates: the products of the contributions that they share.

    Parameters
    ----------
    one, other
        Their budgets.

    Returns
    -------
    float
        Product of their units.

    References
    ----------
    JCGM 100:2008 (GUM), 5.2 and F.1.2.3.

    """
    shared = {part.source: part.u for part in other}
    return sum(part.u * shared.get(part.source, 0.0) for part in one)


def effective_dof(budget: Budget) -> float:
    """Effective degrees of freedom of a budget.

    Parameters
    ----------
    budget
        Its sources are different from each other.

    Returns
    -------
    float
        u⁴/Σ(u_i⁴/ν_i); infinite where no contribution has finite degrees of freedom.

    References
    ----------
    JCGM 100:2008 (GUM), G.4.1, eq. G.2b.
    Satterthwaite, Biometrics Bulletin 2(6), 1946, 110, doi:10.2307/3002019.

    Examples
    --------
    >>> round(effective_dof((*type_a("scatter:x", 1.0, 4.0), *type_b("current@rig", 1.0))), 9)
    16.0

    """
    total = standard_uncertainty(budget) ** 2
    spread = sum(part.u**4 / part.dof for part in budget if math.isfinite(part.dof))
    return math.inf if spread == 0.0 else total**2 / spread


def coverage_factor(dof: float, level: float = COVERAGE) -> float:
    """The factor k by which U = k u covers a level.

    Parameters
    ----------
    dof
        Effective degrees of freedom.
    level
        Coverage probability [1].

    Returns
    -------
    float
        Quantile of Student's t [1]; 2 for the default level and infinite degrees of freedom.

    References
    ----------
    JCGM 100:2008 (GUM), G.3.

    Examples
    --------
    >>> round(coverage_factor(math.inf), 3), round(coverage_factor(10.0, 0.95), 3)
    (2.0, 2.228)

    """
    from scipy.special import stdtrit

    return float(stdtrit(min(dof, 1e9), 0.5 + level / 2.0))
