"""Terms inside an effect: those that the captures do not pay for are left out.

Reference: Schwarz, Ann. Stat. 6 (1978), the penalty of a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import zero
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import Fitted, System, own_columns
from pipeline.criticism.regression.normal_equations import Grams


def trimmed(
    segments: Sequence[Segment], fitted: Fitted, around: System, names: Sequence[str]
) -> tuple[Fitted, System]:
    """The fit with the optional terms of the named effects that do not pay left out.

    A term pays when −2 log L falls by more than ln n a parameter. All terms that to first order do
    not pay are left out in one refit. If that loses too much, they are tried one by one, and with
    them the terms that to first order pay less than twenty penalties. One amplitude always stays.
    """
    price = math.log(max(around.size, 2))
    for name in names:
        effect = _named(fitted, name)
        spare = _spare(fitted, around, effect, price)
        if not spare:
            continue
        less = _unless_worth(segments, fitted, around, name, spare, price)
        if less is not None:
            fitted, around = less
            continue
        alone = spare if len(spare) > 1 else ()
        for term in (*alone, *_doubtful(fitted, around, effect, spare, price)):
            less = _unless_worth(segments, fitted, around, name, (term,), price)
            fitted, around = less or (fitted, around)
    return fitted, around


def whole(fitted: Fitted) -> Fitted:
    """Where a fit begins in which the machine's own effects have all their terms again.

    A term that did not pay while another effect was missing may pay now.
    """
    model = fitted.model
    own = [e if e.hook == "sensor" else replace(e, left_out=()) for e in model.effects]
    full = replace(model, effects=tuple(own))
    values = dict(fitted.values)
    for effect in own:
        values = {**zero(effect, full), **values}
    return replace(fitted, model=full, values=values)


def _named(fitted: Fitted, name: str) -> Effect:
    return next(e for e in fitted.model.effects if e.name == name)


def _unless_worth(
    segments: Sequence[Segment],
    fitted: Fitted,
    around: System,
    name: str,
    terms: tuple[int, ...],
    price: float,
) -> tuple[Fitted, System] | None:
    """The refit without some terms of an effect; None where these were worth their penalty, or no
    amplitude would stay.
    """
    effect = _named(fitted, name)
    mine = effect.parameters_of(fitted.model.machine)
    if not any(p.amplitude and p.optional not in terms for p in mine):
        return None
    tried = _without(segments, fitted, around, effect, terms)
    worth = price * len(_parameters(fitted, effect, terms))
    return tried if tried[1].misfit - around.misfit < worth else None


def _parameters(fitted: Fitted, effect: Effect, terms: Sequence[int]) -> tuple[str, ...]:
    """Full names of the parameters of some terms."""
    mine = effect.parameters_of(fitted.model.machine)
    return tuple(f"{effect.name}.{p.name}" for p in mine if p.optional in terms)


def _spare(fitted: Fitted, around: System, effect: Effect, price: float) -> tuple[int, ...]:
    """The optional terms that do not pay to first order, the cheapest first."""
    parameters = effect.parameters_of(fitted.model.machine)
    left = sorted({p.optional for p in parameters} - {0})
    known = around.grams()
    gone: list[int] = []
    while True:
        costs = []
        for term in left:
            if any(p.amplitude and p.optional not in (*gone, term) for p in parameters):
                names = _parameters(fitted, effect, (*gone, term))
                more = len(names) * price
                costs.append((_loss(fitted, around, known, names) - more, term))
        cheapest = min(costs, default=(0.0, 0))
        if cheapest[0] >= 0.0:
            return tuple(gone)
        gone.append(cheapest[1])
        left.remove(cheapest[1])


def _loss(fitted: Fitted, around: System, known: Grams, names: Sequence[str]) -> float:
    """Rise of deviance, to first order, when these parameters go to zero and the rest refits."""
    own = np.arange(len(own_columns(fitted.model)))
    out = np.array([n for n in own if around.columns[n].name in names], dtype=int)
    move = np.array([-fitted.values[around.columns[n].name] for n in out])
    return known.moved(out, move).along(np.setdiff1d(own, out)).best().misfit - known.misfit()


def _doubtful(
    fitted: Fitted, around: System, effect: Effect, spare: Sequence[int], price: float
) -> tuple[int, ...]:
    """The optional terms that are not `spare` and that the tangent may be wrong about."""
    known = around.grams()
    terms = {p.optional for p in effect.parameters_of(fitted.model.machine)} - {0, *spare}
    return tuple(
        term
        for term in sorted(terms)
        if _loss(fitted, around, known, names := _parameters(fitted, effect, (term,)))
        < fitted.policy.selection.tangent_penalties * price * len(names)
    )


def _without(
    segments: Sequence[Segment],
    fitted: Fitted,
    around: System,
    effect: Effect,
    terms: Sequence[int],
) -> tuple[Fitted, System]:
    """The refit without some terms; columns of all else are taken over."""
    gone = _parameters(fitted, effect, terms)
    less = replace(effect, left_out=tuple(sorted({*effect.left_out, *terms})))
    effects = tuple(less if e.name == effect.name else e for e in fitted.model.effects)
    values = {name: v for name, v in fitted.values.items() if name not in gone}
    start = replace(fitted, model=replace(fitted.model, effects=effects), values=values)
    own = f"{effect.name}."
    named = [replace(c, name=f"-{c.name}") if c.name.startswith(own) else c for c in around.columns]
    return gauss_newton(segments, start, before=replace(around, columns=tuple(named)))
