"""Constants less what effects add to them, and held against the fit of all captures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.uncertainty import BETWEEN, propagate, type_a

INERTIA, TAU = "j_rotor_kgm2", "tau_mech_s"
FOLLOWING: Mapping[str, Mapping[str, float]] = {
    "saliency_ratio": {"lq_h": 1.0, "ld_h": -1.0},
    "tau_elec_s": {"lq_h": 1.0, "r_phase_ohm": -1.0},
    "kt_from_ke_nm_a": {"psi_pm_wb": 1.0},
    TAU: {INERTIA: 1.0, "r_phase_ohm": 1.0, "psi_pm_wb": -2.0},
}
"""Constants that are derived from others, and the powers of these."""
MECHANICAL = (INERTIA, "torque_coulomb_nm", "b_visc_nm_s_rad")
"""Constants that tests of a shaft share with every effect that turns or brakes it."""
FIT = "model"
"""In the source of a constant of the fit that has the effects, in the place of an effect."""


def separated(constants: Mapping[str, Estimate], model: ModelVerdict) -> dict[str, Estimate]:
    """The constants less what they contain of effects that the model knows: drag in friction, a
    mass beyond a coupling in the inertia and the time constant that goes with it; and held against
    the fit of all captures.

    Parameters
    ----------
    constants
        Estimates by name, fitted without these effects.
    model
        With `in_friction` and `far_inertia`: by effect, its part of each constant.

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
    for name in (one for one in changed if one in model.constants):
        changed[name] = _held_against(changed[name], model)
    for derived, powers in FOLLOWING.items():
        for name, power in powers.items():
            changed |= _with_what_it_follows(constants, changed, name, derived, power)
    for effect, share in list(model.far_inertia.items())[:1]:
        changed |= {
            name: _near(changed[name], effect, share)
            for name in (INERTIA, TAU)
            if name in changed and changed[name].known
        }
    return changed


def _with_what_it_follows(
    before: Mapping[str, Estimate],
    after: Mapping[str, Estimate],
    name: str,
    derived: str,
    power: float,
) -> dict[str, Estimate]:
    """A constant derived from one that was replaced or is in more doubt; else empty."""
    old, new, one = before.get(name), after.get(name), after.get(derived)
    if old is None or new is None or one is None or not (old.known and new.known and one.known):
        return {}
    added = tuple(part for part in new.budget if part not in old.budget)
    if not added:
        return {}
    ratio = (new.number / old.number) ** power
    own = power * ratio * one.number / new.number
    budget = propagate([(ratio, one.budget), (own, added)])
    return {derived: replace(one, value=ratio * one.number, budget=budget)}


def _held_against(estimate: Estimate, model: ModelVerdict) -> Estimate:
    """An estimate that was made from its own captures, or that of the fit of all captures.

    They differ where the distance is more than twice its uncertainty. Of a constant that an effect
    touches, known to the fit alone, the fit's is taken where they differ, or where the estimate has
    no value or one of more than twice the uncertainty. Where nothing says which of both is right
    (no effect is known, something is left that none explains, or two explain the same), the
    estimate stays, and the distance is in its budget.
    """
    value, u, unit = model.constants[estimate.name]
    if estimate.status == "stated" or value is None or u is None:
        return estimate
    apart = abs(estimate.number - value) if estimate.known else math.inf
    differ = apart > 2.0 * (math.hypot(estimate.u, u) if estimate.known else u)
    names = " and ".join(model.sizes)
    confused = any(found.confused_with for found in model.missing.values())
    touched = bool(names) and (estimate.name in MECHANICAL or estimate.name in model.touches)
    if touched and not confused and model.verdict != "unknown":
        if not differ and estimate.u <= 2.0 * u:
            return estimate
        words = f"by a fit with {names}"
        if estimate.known:
            words += f"; without, {estimate.number:.4g} ± {estimate.u:.2g} {unit}"
        budget = type_a(_source(FIT, estimate.name), u)
        held = replace(estimate, value=value, status="measured", budget=budget)
    elif differ and estimate.known:
        words = f"a fit of all captures{f' with {names}' if names else ''} has "
        words += f"{value:.4g} ± {u:.2g} {unit}"
        between = type_a(f"{BETWEEN}residual_test:{estimate.name}", apart / math.sqrt(2.0))
        held = replace(estimate, budget=(*estimate.budget, *between))
    else:
        return estimate
    return replace(held, note="; ".join(part for part in (words, estimate.note) if part))


def _near(whole: Estimate, effect: str, share: ReportedParameter) -> Estimate:
    """What is left of an inertia of all that turns on the motor's side of a coupling."""
    far, u = share.value or 0.0, share.u or 0.0
    parts = (1.0 - far, whole.budget), (1.0, type_a(_source(effect, whole.name), -whole.number * u))
    percent = f"{100.0 * far:.3g} ± {100.0 * u:.2g} %"
    words = f"less the {percent} of the inertia that are beyond a coupling ({effect})"
    note = "; ".join(part for part in (words, whole.note) if part)
    return replace(whole, value=(1.0 - far) * whole.number, budget=propagate(parts), note=note)


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
            sources = set() if one is None else {c.source for c in one.budget}
            if value is None or one is None or sources.isdisjoint({source, _source(FIT, name)}):
                continue
            budget = tuple(c for c in one.budget if c.source != source)
            changed[name] = replace(one, value=one.number + value, budget=budget)
    return changed


def _source(effect: str, constant: str) -> str:
    return f"scatter:residual_test:{effect}:{constant}"
