"""Friction constants with the iron's drag separated from them, and combined with it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.uncertainty import type_a


def separated(constants: Mapping[str, Estimate], model: ModelVerdict) -> dict[str, Estimate]:
    """The constants less what they contain of effects that the model knows.

    Parameters
    ----------
    constants
        Estimates by name, fitted without these effects.
    model
        With `in_friction`: by effect, its part of each constant.

    Returns
    -------
    dict of str to Estimate
        The part's uncertainty is in the budget. A part that is more than the constant, beyond their
        uncertainty, contradicts it and is not taken.

    """
    changed = dict(constants)
    for effect, parts in model.in_friction.items():
        for name, (value, u, unit) in parts.items():
            one = changed.get(name)
            if value is None or u is None or one is None or not one.known:
                continue
            left = one.number - value
            if left < -2.0 * math.hypot(one.u, u):
                continue
            words = f"less {value:.3g} {unit} of {effect}"
            changed[name] = replace(
                one,
                value=left,
                budget=(*one.budget, *type_a(_source(effect, name), -u)),
                note="; ".join(part for part in (words, one.note) if part),
            )
    return changed


def combined(constants: Mapping[str, Estimate], model: ModelVerdict) -> dict[str, Estimate]:
    """The constants of all drag at no current, as before `separated`.

    Parameters
    ----------
    constants
        Of a datasheet.
    model
        The verdict of the same datasheet.

    """
    changed = dict(constants)
    for effect, parts in model.in_friction.items():
        for name, (value, _, _) in parts.items():
            one = changed.get(name)
            source = _source(effect, name)
            if value is None or one is None or all(c.source != source for c in one.budget):
                continue
            budget = tuple(c for c in one.budget if c.source != source)
            changed[name] = replace(one, value=one.number + value, budget=budget)
    return changed


def _source(effect: str, constant: str) -> str:
    return f"scatter:residual_test:{effect}:{constant}"
