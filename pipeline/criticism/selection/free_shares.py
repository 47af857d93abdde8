"""Friction or a magnet that changes: shares that are left free, by test or with time.

Friction of coasts and the magnet of open-circuit tests repeat as well as their nuisances say. A
bearing that was cold or a magnet that lost flux does not. Such shares are left free where that
explains the captures as well as any effect: a demagnetised magnet is likelier than a clock that is
off by as much, which looks the same.

Friction also changes within captures: cold grease, a seal that runs in. No state of the machine
predicts it. The shares by which it is more at the start of a capture than later, and the time
constant by which that vanishes, are common to coasts and drives. They are left free where that
explains the captures better than any effect. In one coast, speed and time are one to one: a drag of
another form over speed explains it as well, and then that is named.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pipeline.criticism.data.segment import clock
from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values
from pipeline.criticism.machine.model import COAST_SHARES, EARLY_S, EARLY_SHARES, OPEN_FLUX
from pipeline.criticism.policy.discovery import Discovery
from pipeline.criticism.regression.columns import effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import over_floor
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.residuals.channels import channel_of
from pipeline.numerics.identifiability import REACH

_FREE = 1.0
"""Standard uncertainty of a share that is left free: any change is less than the whole."""
_SHARE_OF = {
    "coast_dry_share": "dry friction",
    "coast_viscous_share": "viscous friction",
    "open_flux_share": "psi_wb",
    "early_dry_share": "dry friction",
    "early_viscous_share": "viscous friction",
}
"""What a share is of."""
_LOOKS_ALIKE = {
    "spin_down": "a part on the shaft or a clock that is off there",
    "open_circuit": "a clock that is off there, or a gain of voltages or torques,",
}
"""What else such a share may be."""
SHARES: dict[str, tuple[str, ...]] = {"spin_down": COAST_SHARES, "open_circuit": (OPEN_FLUX,)}
"""Nuisances that are left free together, by test."""
_STILL_CHANGING = ", which none of these captures reaches"
_REPEAT = (
    "let it run warm, then record several coasts from different speeds in each sense, one after "
    "the other"
)


def with_changing_friction(system: LinearSystem, most: float = math.inf) -> LinearSystem | None:
    """The fit with a friction that changes with the time since a capture began.

    Parameters
    ----------
    system
        Around a fit.
    most
        Deviance that its end must be below, to first order.

    Returns
    -------
    LinearSystem or None
        None where nothing is left in a signal of a shaft that may change so, where friction is
        free already, and where the deviance falls by no more than the penalty of the parameters
        and a `tie`, or a friction of any form over speed explains the captures as well.

    """
    fit = system.fit
    spans = {s.capture: float(clock(s)[-1]) for s in fit.segments if EARLY_S in s.fixed}
    policy = system.policy
    if len(spans) < policy.discovery.friction_captures or changes(fit) or not _misses(system):
        return None
    span = max(spans.values())
    shortest, longest = policy.discovery.friction_scales
    scales = span * np.geomspace(shortest, longest, policy.discovery.friction_trials)
    begun = min(_begun(system, span, scales), key=lambda start: start[0], default=None)
    penalty = 3.0 * math.log(system.size) + 2.0 * math.log(scales.size)
    least = system.deviance - penalty - policy.selection.tie
    if begun is None or begun[0] > min(least, most):
        return None
    # shares, their time and friction are a narrow valley: one fit ends halfway down
    tried = gauss_newton(gauss_newton(begun[1]).fit)
    least = min(least, _by_speed(system) - penalty - policy.selection.tie)
    return tried if tried.deviance < least else None


def _by_speed(system: LinearSystem) -> float:
    """Least deviance, its penalty paid, of drags that are curves of speed, alike in both senses or
    not.
    """
    discovery = system.policy.discovery
    curves = [_curve(discovery, even=even) for even in (False, True)]
    columns = [effect_columns(curve, system.fit.model) for curve in curves]
    wide = linear_system(system.fit, [c for of_curve in columns for c in of_curve], system)
    first, costs = wide.model_columns.size, []
    for count in np.cumsum([len(of_curve) for of_curve in columns]).tolist():
        places = np.arange(first + count)
        end = wide.normal_equations(places).best(*system.policy.selection.thorough)
        costs.append(end.deviance + count * math.log(system.size))
    return min(costs)


def _curve(policy: Discovery, *, even: bool) -> Effect:
    """A drag of any form over speed: opposed to it, or that part which either sense has alike."""
    powers, widths = policy.friction_powers, policy.friction_widths
    count = 3 if even else len(powers) + len(widths)
    names = (f"c{n}" for n in range(count))
    bounds = (-math.inf, math.inf)
    parameters = tuple(Parameter(n, "N·m", 0.01, 0.0, "torque_nm", *bounds) for n in names)
    words = "a drag that either sense has alike" if even else "a drag as a curve of speed"
    return Effect(
        name="speed_curve_even" if even else "speed_curve",
        words=words,
        signature="",
        tests=(),
        experiment="",
        reference="",
        parameters=parameters,
        torque=_even_drag if even else partial(_odd_drag, powers, widths),
    )


def _even_drag(x: Operating, q: Values) -> Array:
    """Drag [n] [N·m] that either sense has alike: powers of the speed from 0 on."""
    share = np.abs(x.omega_rad_s) / x.machine.scales["speed_rad_s"]
    return _weighted((share**n for n in range(len(q))), q, share.shape)


def _odd_drag(powers: Sequence[float], widths: Sequence[float], x: Operating, q: Values) -> Array:
    """Drag [n] [N·m] opposed to the speed: its powers, and what dies out above each width."""
    share = np.abs(x.omega_rad_s) / x.machine.scales["speed_rad_s"]
    parts = [share**power for power in powers] + [np.exp(-share / width) for width in widths]
    sense = np.sign(x.omega_rad_s)
    return _weighted((sense * part for part in parts), q, share.shape)


def _weighted(parts: Iterable[Array], q: Values, shape: tuple[int, ...]) -> Array:
    """The sum of curves by their weights."""
    total = np.zeros(shape)
    for part, weight in zip(parts, q.values(), strict=True):
        if weight:
            total = total + weight * part
    return total


def changes(fit: Fit) -> bool:
    """Whether a fit leaves the friction free to change with time.

    Parameters
    ----------
    fit
        A fit.

    """
    return EARLY_S in fit.model.machine.stated_u


def _misses(system: LinearSystem) -> bool:
    """Whether a signal of the shaft is over its floor where friction may change, however little:
    friction is a small part of a machine's torque.
    """
    free = {
        (s.capture, channel)
        for s in system.segments
        for channel in s.channels
        if EARLY_S in s.fixed and channel_of(s, channel).scale == "torque_nm"
    }
    return any((excess.capture, excess.signal) in free for excess in over_floor(system))


def _begun(system: LinearSystem, span: float, scales: Array) -> Iterator[tuple[float, Fit]]:
    """Deviance to first order with each time constant, and the fit from which it is refined."""
    fit = system.fit
    u = fit.policy.discovery.friction_u
    free = {**dict.fromkeys(EARLY_SHARES, u), EARLY_S: u * span}
    machine = replace(fit.machine, stated_u={**fit.machine.stated_u, **free})
    for scale in scales.tolist():
        absent = {**dict.fromkeys(EARLY_SHARES, 0.0), EARLY_S: scale}
        start = replace(
            fit, model=replace(fit.model, machine=machine), near={**fit.near, **absent}
        ).at(absent)
        around = linear_system(start, before=system)
        columns = around.model_columns
        end = around.normal_equations(columns).best(*fit.policy.selection.thorough)
        moved = start.moved([around.columns[n] for n in columns], end.step)
        yield end.deviance, moved.at({EARLY_S: scale})


def friction_notes(system: LinearSystem) -> Iterator[str]:
    """How friction changes with time, where that is large enough to matter.

    Parameters
    ----------
    system
        Around a fit.

    Yields
    ------
    str
        One sentence, or none.

    """
    fit = system.fit
    if not changes(fit):
        return
    variance, tau_s = system.covariance(system.model_columns).diagonal(), abs(fit.values[EARLY_S])
    begin = {s.capture: float(clock(s)[-1]) for s in fit.segments if EARLY_S in s.fixed}
    over = 1.0 - math.exp(-max(begin.values()) / tau_s)
    shares = {name: fit.values[name] for name in EARLY_SHARES}
    if over * max(map(abs, shares.values())) < system.policy.discovery.changed_share:
        return
    u_percent = {n: 100.0 * math.sqrt(variance[system.place([n])[0]]) for n in shares}
    sizes = (share_words(_SHARE_OF[n], one, f"{u_percent[n]:.2g}") for n, one in shares.items())
    yield (
        f"{' and '.join(sizes)} at the start of {', '.join(sorted(begin))} than it comes to, with "
        f"a time constant of {tau_s:.3g} s: it changes within these captures, with no state of the "
        "machine; constants of friction are those that it comes to"
        + (_STILL_CHANGING if tau_s > max(begin.values()) else "")
        + f"; {_REPEAT}"
    )


def with_free_shares(system: LinearSystem, most: float = math.inf) -> LinearSystem | None:
    """The fit with the shares of a test left free, of the test where that helps most.

    Parameters
    ----------
    system
        Around a fit.
    most
        Deviance that its end must be below, to first order.

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
    least, paid = system.policy.selection.tie, penalty * len(SHARES.get(test, ()))
    if gains.get(test, 0.0) < max(least, system.deviance - most - paid):
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
