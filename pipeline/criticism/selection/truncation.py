"""Where a ladder is cut: trailing steps whose names are unsupported beside an unknown remainder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import values_of
from pipeline.criticism.regression.cross_validation import HeldOut, predicted_chi2
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.goodness import remainder, significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.noise_floors import form_tolerance
from pipeline.criticism.selection.sizes import driving_friction, is_rare
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.records.diagnosis import Remainder

SHAFT = ("torque_shaft_nm", "omega_mech_rad_s")
"""Signals of the shaft; the others are of the winding."""


def truncated(
    steps: Sequence[LadderStep], held_out: Sequence[HeldOut]
) -> tuple[tuple[LadderStep, ...], tuple[Remainder, ...]]:
    """The search without unsupported trailing steps.

    Parameters
    ----------
    steps
        Steps of the search.
    held_out
        Held-out residuals of each, over the same rows.

    Returns
    -------
    tuple
        The steps that stay, and what is over the floor at their end.

    Notes
    -----
    While anything is left, in the captures or where one is predicted from the others, trailing
    steps are dropped that captures contradict, where the effects found do not explain what is left;
    and those that lowered the held-out error by less than `guess_share`, but for a first effect
    that explains it. A step stays that cleared a signal of all waves of the angle, or that takes
    most of what its own side, winding or shaft, misses in captures held out: a residual of the
    other side is no evidence against it. Not so a rare effect: what benches seldom have is less
    likely than a part of what nothing explains.

    """
    policy = steps[0].fit.policy.selection
    for count in range(len(steps), 0, -1):
        kept, system = tuple(steps[:count]), steps[count - 1].system
        remainders = remainder(system)
        before, after = held_out[count - 2].total, held_out[count - 1].total
        lower = after < (1.0 - policy.guess_share) * before
        explains = explained(kept, held_out, remainders)
        if count == 1 or (explains and (count == 2 or lower or not remainders)):
            break
        if contradiction(steps[count - 1]):
            continue
        if lower:
            break
        if _adds_a_rare_one(steps[count - 1]):
            continue
        if _clears_orders(steps[count - 2].system, system):
            break
        if _clears_its_side(steps[count - 2 : count], held_out[count - 2 : count]):
            break
    return kept, remainders


def _adds_a_rare_one(step: LadderStep) -> bool:
    fit = step.fit
    return any(is_rare(e, fit) for e in fit.model.effects if e.name in step.added[-1:])


def contradiction(step: LadderStep) -> str:
    """What captures say against the effect that a step added.

    Parameters
    ----------
    step
        The step.

    Returns
    -------
    str
        Empty where they say nothing: an amplitude that they determine is less than half of the one
        that it should reach (`Parameter.at_least`), or the effect leaves a friction that drives.

    """
    system, model = step.system, step.fit.model
    share = step.fit.policy.selection.companion_share
    for effect in model.effects:
        if effect.name not in step.added[-1:]:
            continue
        if _is_drag(effect, step.fit) and (driving := _driving_friction(step)):
            return (
                f"{effect.name} would take much of what is left, but goes with a viscous friction "
                f"of {driving:.2g} N·m·s/rad, which drives the shaft"
            )
        values = values_of(effect, model.machine, step.fit.values)
        for p in effect.parameters_of(model.machine):
            known = np.any(system.matrix[:, system.place([f"{effect.name}.{p.name}"])])
            if p.at_least and known and values[p.name] < share * values[p.at_least]:
                other = f"{p.at_least} of {values[p.at_least]:.2g}"
                return (
                    f"{effect.name} would take much of what is left, but captures contradict "
                    f"it: its {other} goes with a {p.name} of {values[p.name]:.2g}"
                )
    return ""


def _is_drag(effect: Effect, fit: Fit) -> bool:
    """Whether an effect is a torque of the speed, and not a wave of the angle alone."""
    waves = all(p.order for p in effect.parameters_of(fit.machine))
    return effect.hook == "torque" and not waves


def _driving_friction(step: LadderStep) -> float:
    """The viscous friction [N·m·s/rad] beside a drag that was found, where it certainly drives the
    shaft; else zero. A drag of a wrong form leaves its difference from the true one to it; a wave
    of the angle leaves it none.
    """
    drags = [e for e in step.fit.model.effects if e.name in step.added and _is_drag(e, step.fit)]
    return driving_friction(step.system) if drags else 0.0


def _clears_orders(before: LinearSystem, after: LinearSystem) -> bool:
    """Whether some signal had waves of the angle over its floor before a step, and none after it.

    Cogging is supported where it takes every wave there was in a torque, however much a drag of no
    library leaves at order zero, or another capture in a voltage.
    """
    return bool(_waved(before) - _waved(after))


def _clears_its_side(steps: Sequence[LadderStep], held_out: Sequence[HeldOut]) -> bool:
    """Whether the newest effect of two steps takes most of the held-out power over the floor of its
    own side, winding or shaft, while the other side misses as well.

    A bump of friction is supported where coasts and torques need it, whatever an inverter leaves in
    the voltages. A capture that alone determines the effect is never held out, and shows nothing.
    """
    before, after = (step.system for step in steps)
    name = f"{after.fit.model.effects[-1].name}." if after.fit.model.effects else ""
    columns = [
        n
        for n, c in enumerate(after.columns[: after.model_column_count])
        if c.name.startswith(name)
    ]
    out = np.isfinite(held_out[-1].residual) & np.any(after.matrix[:, columns] != 0.0, axis=1)
    acts = np.bincount(after.group, out, len(after.labels))
    shaft = np.array([channel in SHAFT for _, channel, _ in after.labels])
    was, now = (
        step.system.counts * np.maximum(predicted_chi2(step.system, errors) - 1.0, 0.0)
        for step, errors in zip(steps, held_out, strict=True)
    )
    falls = [float((was - now)[(acts > 0) & side].sum()) for side in (shaft, ~shaft)]
    side = shaft if falls[0] >= falls[1] else ~shaft
    acting = (acts > 0) & side
    beside = bool(significant_groups(before)[~side].any())
    share = before.policy.selection.clears_share
    return beside and float(now[acting].sum()) < share * float(was[acting].sum())


def _waved(system: LinearSystem) -> set[str]:
    """Signals with waves of the angle that are reported."""
    significant = significant_groups(system)
    return {
        c for (_, c, order), over in zip(system.labels, significant, strict=True) if over and order
    }


def explained(
    steps: Sequence[LadderStep], held_out: Sequence[HeldOut], remainders: Sequence[Remainder]
) -> bool:
    """Whether the effects found explain what the captures show.

    Parameters
    ----------
    steps
        Steps of the search.
    held_out
        Held-out residuals of each.
    remainders
        What is over the floor at the end.

    Returns
    -------
    bool
        True where nothing was found and nothing is left.

    Notes
    -----
    They must remove most of the deviance of the signals that still miss, at least a share of each
    one's own (`least_share`), and most of what the held-out error has over the floor. A name that
    leaves more there than a floor may be wrong by (`goodness.over`) explains nothing either where
    no signal's part is large for the machine. An offset of the angle that removes all of the
    torque's error explains nothing of a shaft that coasts too short. Signals with a small part of
    the deviance do not count alone. Deviance is logarithmic: for an equation at a million floors,
    half of it remains at a thousand. A drag beside a viscous friction that drives the shaft is of
    another form than what the captures show, where anything is left. Where the held-out error is
    over what a floor may be wrong by, what is left of a signal at an order of the angle is at most
    `unexplained_share` of what the effects do there: their forms are not wrong where they do
    nothing.

    """
    policy, over = steps[0].fit.policy.selection, steps[0].fit.policy.goodness.over
    if remainders and _driving_friction(steps[-1]):
        return False
    first, last = (max(held_out[n].total ** 2 - 1.0, 0.0) for n in (0, len(steps) - 1))
    if last > policy.unexplained_share**2 * first:
        return not remainders and (len(steps) == 1 or last <= over)
    signals = sorted({r.signal for r in remainders})
    before, after = (
        np.array([_excess(step, {name}) for name in signals]) for step in (steps[0], steps[-1])
    )
    large = before > policy.least_share * before.sum()
    removed = bool((after[large] <= (1.0 - policy.least_share) * before[large]).all())
    allowed = policy.unexplained_share * float(before.sum())
    removed &= float(after.sum()) < allowed
    if not remainders or not removed:
        return not remainders
    return last <= over or _is_of_their_forms(steps[-1], remainders)


def _is_of_their_forms(step: LadderStep, remainders: Sequence[Remainder]) -> bool:
    """Whether all that is left may be what the forms of the effects found are wrong by."""
    system, fit = step.system, step.fit
    found = [effect for effect in fit.model.effects if effect.name in step.added]
    share = system.policy.selection.unexplained_share
    wrong = np.concatenate(
        [form_tolerance(s, fit.model, fit.values, found, share) for s in fit.segments]
    )
    scale = np.bincount(system.group, system.row_weight**-2) / np.maximum(system.counts, 1.0)
    left = (system.reduced_chi2(system.residual) - 1.0) * scale
    reported = {(r.capture, r.signal, r.order) for r in remainders}
    over = significant_groups(system) & [
        (system.segments[n].capture, channel, order) in reported
        for n, channel, order in system.labels
    ]
    return bool((left[over] <= wrong[over] ** 2).all())


def _excess(step: LadderStep, channels: set[str]) -> float:
    system = step.system
    reduced_chi2 = system.normal_equations(system.model_columns).best().reduced_chi2
    inside = np.array([channel in channels for _, channel, _ in system.labels])
    return float((system.counts * np.log(np.maximum(reduced_chi2, 1.0)))[inside].sum())
