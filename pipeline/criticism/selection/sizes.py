"""How large an effect is that was fitted, and whether there can be such a one."""

from __future__ import annotations

import math
from collections.abc import Iterable

from pipeline.criticism.effect import Effect
from pipeline.criticism.library.friction_parts import drives
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem


def material(fit: Fit, effect: Effect) -> bool:
    """Whether an effect is large enough to matter.

    Parameters
    ----------
    fit
        A fit with the effect.
    effect
        The effect.

    Returns
    -------
    bool
        Some amplitude is over its negligible size, and every shape that has one over its own.

    """
    return shaped(fit, effect) and size_of(fit, effect, effect.parameters_of(fit.machine)) >= 1.0


def shaped(fit: Fit, effect: Effect) -> bool:
    """Whether an effect is one that there can be, every shape of it over its negligible size.

    Parameters
    ----------
    fit
        A fit with the effect.
    effect
        The effect.

    Returns
    -------
    bool
        False for a friction that drives, and for an effect at the bound of what it can be.

    """
    machine = fit.machine
    over = all(
        fit.size(effect, p) >= p.negligible * machine.scale(p)
        for p in effect.parameters_of(machine)
        if not p.amplitude
    )
    return over and not drives(effect, fit.model, fit.values) and not _beyond(fit, effect)


def driving_friction(system: LinearSystem) -> float:
    """The viscous friction of a fit [N·m·s/rad] where it certainly drives the shaft; else zero.

    Parameters
    ----------
    system
        Around the fit.

    """
    value = system.fit.values["b_nm_s_rad"]
    names = [system.columns[place].name for place in system.model_columns.tolist()]
    if value >= 0.0 or "b_nm_s_rad" not in names:
        return 0.0
    place = names.index("b_nm_s_rad")
    u = math.sqrt(float(system.covariance(system.model_columns)[place, place]))
    return value if value < -system.policy.selection.least_u * u else 0.0


def _beyond(fit: Fit, effect: Effect) -> bool:
    """Whether a fit would have more of an effect than there can be: at a bound other than zero
    stands an amplitude that has a negligible size, or one that goes with these.
    """
    limits = limits_of(fit.model)
    held = [
        name
        for name, p in effect.named(fit.machine).items()
        if p.amplitude and (p.negligible > 0.0 or not p.optional)
    ]
    return any(fit.values[name] != 0.0 and fit.values[name] in limits[name] for name in held)


def size_of(fit: Fit, effect: Effect, parameters: Iterable[Parameter]) -> float:
    """The largest of some amplitudes of an effect, relative to its negligible size.

    Parameters
    ----------
    fit
        A fit with the effect.
    effect
        The effect.
    parameters
        Parameters of it.

    Returns
    -------
    float
        0 where none is an amplitude that declares such a size.

    """
    sizes = [
        fit.size(effect, p) / (p.negligible * fit.machine.scale(p))
        for p in parameters
        if p.amplitude and p.negligible > 0.0
    ]
    return max(sizes, default=0.0)


def is_rare(effect: Effect, fit: Fit) -> bool:
    """Whether benches seldom have an effect, or one of such a sign.

    Parameters
    ----------
    effect
        The effect.
    fit
        A fit with it.

    """
    return effect.rare or any(
        fit.values[name] < p.rare_below * fit.machine.scale(p)
        for name, p in effect.named(fit.machine).items()
    )
