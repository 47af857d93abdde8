"""Friction or a magnet that is another in one kind of test: shares that are left free.

Friction of coasts and the magnet of open-circuit tests repeat as well as their nuisances say. A
bearing that was cold or a magnet that lost flux does not. Such shares are left free where that
explains the captures as well as any effect: a demagnetised magnet is likelier than a clock that is
off by as much, which looks the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from pipeline.criticism.machine.model import COAST_SHARES, OPEN_FLUX
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.numerics.identifiability import REACH

_FREE = 1.0
"""Standard uncertainty of a share that is left free: any change is less than the whole."""
_SHARE_OF = {
    "coast_dry_share": "dry friction",
    "coast_viscous_share": "viscous friction",
    "open_flux_share": "psi_wb",
}
"""What a share is of."""
_LOOKS_ALIKE = {
    "spin_down": "a part on the shaft or a clock that is off there",
    "open_circuit": "a clock that is off there, or a gain of voltages or torques,",
}
"""What else such a share may be."""
SHARES: dict[str, tuple[str, ...]] = {"spin_down": COAST_SHARES, "open_circuit": (OPEN_FLUX,)}
"""Nuisances that are left free together, by test."""


def with_free_shares(system: LinearSystem) -> LinearSystem | None:
    """The fit with the shares of a test left free, of the test where that helps most.

    Parameters
    ----------
    system
        Around a fit.

    Returns
    -------
    LinearSystem or None
        None where the deviance falls by no more than the penalty of the parameters and a `tie`.

    """
    fit, penalty = system.fit, math.log(system.size)
    gains = {
        test: _fall(system, names) - penalty * len(names)
        for test, names in SHARES.items()
        if test not in free_tests(fit)
    }
    test = max(gains, key=lambda one: gains[one], default="")
    least = system.policy.selection.tie
    if gains.get(test, 0.0) < least:
        return None
    machine, names = fit.model.machine, SHARES[test]
    free = replace(machine, stated_u={**machine.stated_u, **dict.fromkeys(names, _FREE)})
    tried = gauss_newton(replace(fit, model=replace(fit.model, machine=free)), before=system)
    gain = system.deviance - tried.deviance - penalty * len(names)
    return tried if gain > least else None


def _fall(system: LinearSystem, names: tuple[str, ...]) -> float:
    """Fall of the deviance, to first order, where shares are left free."""
    share_columns, columns = system.place(names), system.model_columns
    precision, gradient = system.prior_precision.copy(), system.prior_gradient.copy()
    precision[share_columns] = gradient[share_columns] = 0.0
    free = replace(system, prior_precision=precision, prior_gradient=gradient)
    thorough = system.policy.selection.thorough
    before, after = (s.normal_equations(columns).best(*thorough) for s in (system, free))
    return before.deviance - after.deviance


def free_tests(fit: Fit) -> tuple[str, ...]:
    """The tests whose shares a fit leaves free.

    Parameters
    ----------
    fit
        A fit.

    """
    stated = fit.model.machine.stated_u
    return tuple(test for test, names in SHARES.items() if stated.get(names[0]) == _FREE)


def share_notes(system: LinearSystem) -> Iterator[str]:
    """What the shares that a fit left free show, where they are large enough to matter.

    Parameters
    ----------
    system
        Around a fit.

    Yields
    ------
    str
        A sentence for each test.

    """
    fit = system.fit
    variance = system.covariance(system.model_columns).diagonal()
    for test in free_tests(fit):
        shares = {name: fit.values[name] for name in SHARES[test]}
        u = {name: math.sqrt(variance[system.place([name])[0]]) for name in shares}
        known = {n: share for n, share in shares.items() if abs(share) >= REACH * u[n]}
        if max(map(abs, known.values()), default=0.0) < system.policy.discovery.changed_share:
            continue
        captures = ", ".join(sorted({s.capture for s in fit.segments if s.test == test}))
        sizes = (
            share_words(_SHARE_OF[n], share, f"{100.0 * u[n]:.1g}") for n, share in known.items()
        )
        yield (
            f"{' and '.join(sizes)} in {captures} than in the other captures: changed between "
            f"them; {_LOOKS_ALIKE[test]} would look the same"
        )


def share_words(of: str, share: float, u_percent: str) -> str:
    """A share in words.

    Parameters
    ----------
    of
        What it is a share of.
    share
        The share [1], above 0 where that is higher.
    u_percent
        Its standard uncertainty in per cent.

    """
    return f"{of} is {100.0 * abs(share):.3g} ± {u_percent} % {'higher' if share > 0 else 'lower'}"
