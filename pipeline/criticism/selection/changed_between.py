"""Friction or a magnet that is another in one kind of test: shares that are left free.

Friction of coasts and the magnet of open-circuit tests repeat as well as their nuisances say. A
bearing that was cold or a magnet that lost flux does not. Such shares are left free where that
explains the captures as well as any effect: a demagnetised magnet is likelier than a clock that is
off by as much, which looks the same.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pipeline.criticism.machine.model import COAST_SHARES, OPEN_FLUX
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem

_FREE = 1.0
"""Standard uncertainty of a share that is left free: any change is less than the whole."""
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
