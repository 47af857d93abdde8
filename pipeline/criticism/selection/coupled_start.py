"""A soft coupling tried from its own start, where torque misses by tens of noise floors.

With most of the inertia behind a soft shaft the base fit ends with an inertia and a friction that
are a tenth of the true ones, and no tangent leads from there to two masses. In the load that a
transducer beyond the far part reads,

    T_load = T − drags − J θ″ + (f J/k) T″ − (f J (1 − f) J/k) θ⁗,

all is linear in J, the drags and two further parameters. So one rough fit gives the share f and
the stiffness k, wherever the base fit ended, and the coupling is fitted from these.

Reference: Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.two_masses import LINEAR_COUPLING, spring_of
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.regression.linearise import effect_columns
from pipeline.criticism.selection.score_test import (
    Candidate,
    Score,
    Standing,
    clears,
    paid_for,
    quiet_fall,
    searched,
    share_of,
)

_TORQUE = "torque_shaft_nm"


def with_coupled_start(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: NDArray[np.bool_],
) -> tuple[Score, ...]:
    """The scores, that of a soft coupling from its own start if that beats its tangent.

    Tried where a torque that is `significant` [G] as a remainder misses by `coupling_floors`.
    """
    soft = [c for c in offered if {"share", "twist_rad", "damping_s"} <= _names(c, wide)]
    soft = [c for c in soft if "gap_rad" not in _names(c, wide)]
    if not soft or not _torque_misses(wide, significant):
        return tuple(scores)
    found = _scored(wide, soft[0])
    if found is None:
        return tuple(scores)
    found = replace(found, penalty=found.penalty + searched(offered))
    name = found.candidate.effect.name
    others = [score for score in scores if score.candidate.effect.name != name]
    known = [score for score in scores if score.candidate.effect.name == name]
    best = max([found, *known], key=lambda score: score.fall)
    return tuple(sorted([*others, best], key=lambda s: (-s.fall, s.candidate.effect.name)))


def _names(candidate: Candidate, wide: LinearSystem) -> set[str]:
    return {p.name for p in candidate.effect.parameters_of(wide.fit.machine)}


def _torque_misses(wide: LinearSystem, significant: NDArray[np.bool_]) -> bool:
    """Whether some plain torque misses its floor by so much that the base may be wrong."""
    least = wide.policy.selection.coupling_floors**2
    q = wide.reduced_chi2(wide.residual)
    groups = zip(wide.labels, q, significant, strict=True)
    return any(
        over and q > least
        for (_, channel, order), q, over in groups
        if (channel, order) == (_TORQUE, 0)
    )


def _scored(wide: LinearSystem, candidate: Candidate) -> Score | None:
    """The score of a coupling fitted from its own start; None where the torque shows none.

    A twist derived from an angle amplifies its noise. Both fits use the noise floors of the fit
    with the coupling.
    """
    begun = _begun(wide.fit, candidate.effect)
    if begun is None:
        return None
    near = gauss_newton(replace(begun, sigma=floors(begun.segments, begun.model, begun.values)))
    end = _reweighted(near.fit, near.fit)
    base = _reweighted(wide.fit, end.fit)
    before, after = _standing(base), _standing(end)
    own = f"{candidate.effect.name}."
    values = {name: value for name, value in end.fit.values.items() if name.startswith(own)}
    found = Score(
        replace(candidate, values=values),
        before.deviance - after.deviance,
        0.0,
        {f"{own}share": values[f"{own}share"]},
        {n: end.fit.values[n] - v for n, v in wide.fit.values.items()},
        share_of(base, candidate.effect, before, after),
        values[f"{own}share"] / candidate.effect.parameters_of(wide.fit.machine)[0].negligible,
        quiet_fall(base, before.reduced_chi2, after.reduced_chi2),
        policy=wide.policy.selection,
    )
    dof = paid_for(candidate.effect, wide.fit.machine, found)
    return replace(found, penalty=dof * math.log(wide.size))


def _reweighted(fit: Fit, other: Fit) -> LinearSystem:
    """A fit again, by the noise floors that the segments have at the values of another one."""
    sigma = floors(other.segments, other.model, other.values)
    return gauss_newton(replace(fit, sigma=sigma, near=other.values))


def _standing(system: LinearSystem) -> Standing:
    chi2 = system.reduced_chi2(system.residual)
    return Standing(system.deviance, chi2, float(system.prior_costs().sum()))


def _begun(fit: Fit, effect: Effect) -> Fit | None:
    """Where a fit with the coupling begins: at the share and stiffness that the torque shows.

    At an order of the angle the torque's fourth derivative of an angle is noise. These rows are
    left out. None where the linear form does not take most of the torque's power over the floor:
    what makes the torque miss is something else.
    """
    silent, machine = fit.policy.fit.silent, fit.machine
    plain = tuple(
        np.where([c == _TORQUE and k != 0 for c, k in row_index(segment)[3]], silent * sigma, sigma)
        for segment, sigma in zip(fit.segments, fit.sigma, strict=True)
    )
    columns = tuple(effect_columns(LINEAR_COUPLING, fit.model, ()))
    system = linear_system(replace(fit, sigma=plain), columns)
    known, effort = system.normal_equations(), fit.policy.selection.thorough
    end = known.along(np.arange(len(system.columns))).best(*effort)
    rigid = known.along(system.own).best(*effort)
    torque = np.array([channel == _TORQUE for _, channel, _ in system.labels])
    if not clears(system, torque, rigid.reduced_chi2, end.reduced_chi2):
        return None
    steps = zip((c.name for c in system.columns), end.step.tolist(), strict=True)
    moved = {name: fit.values.get(name, 0.0) + step for name, step in steps}
    linear = {
        p.name: moved.pop(f"{LINEAR_COUPLING.name}.{p.name}") for p in LINEAR_COUPLING.parameters
    }
    spring = spring_of(linear, moved["j_kgm2"], machine)
    if spring is None:
        return None
    model = fit.model.with_effects(effect)
    own = {f"{effect.name}.{name}": value for name, value in spring.items()}
    still = {f"{effect.name}.damping_s": 0.0, f"{effect.name}.between": -1.0}
    begun = replace(fit, model=model, values={**fit.values, **still, **own})
    return begun.at({**moved, **own})
