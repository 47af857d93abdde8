"""Effects that windows cannot separate, discriminated on full drive logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Discrimination, Effect, FullLog
from pipeline.criticism.machine.model import Model, evaluate, values_of, zero
from pipeline.criticism.operating import Array, Values
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.residual import measured, operate
from pipeline.criticism.signals.shaft import averaged


def discriminate(fit: Fit, effect: Effect) -> Discrimination | None:
    """Which of the effects that share a discriminator full logs show.

    Parameters
    ----------
    fit
        A fit with the effect in its model.
    effect
        The effect.

    Returns
    -------
    Discrimination or None
        None where it has no discriminator, or the logs do not decide.

    """
    if effect.discriminator is None:
        return None
    model, values = fit.model.without(effect.name), fit.values
    return effect.discriminator(full_logs(fit, model), values_of(effect, model.machine, values))


def full_logs(fit: Fit, model: Model) -> list[FullLog]:
    """Every log of a fit at full rate, but those of a transducer that knows nothing of the shaft.

    Parameters
    ----------
    fit
        The fit.
    model
        The model of the logs: that of the fit, or one with fewer effects.

    """
    logs = [s for s in fit.segments if s.unthinned.columns is not None]
    return [_full_log(s, model, fit) for s in logs if not s.instrument.stator]


def _full_log(segment: Segment, model: Model, fit: Fit) -> FullLog:
    """One log at full rate, as a model without the effect sees it."""
    signals = dict(segment.unthinned.columns or {})
    good = signals.pop("good") > 0
    values = fit.values
    full = replace(segment, recorded=signals, weak=None)
    x = operate(full, signals, model, values)
    drag = evaluate(model, x, values).drag_nm
    finer = x.shaft.finer
    if finer > 1:
        torque, drag = averaged(x.torque_nm, finer), averaged(drag, finer)
        x = x.at(finer * np.arange(full.size))
        x.torque_em_nm = torque
    recorded = measured(full, signals, model, values)[-1]
    shaft = _true_torque(full, recorded, model, values)
    kt = 1.5 * model.machine.pole_pairs * values["psi_wb"]
    noise = segment.sensors.noise
    axes = [noise[name] for name in ("id_a", "iq_a") if name in noise]
    u_air_gap = kt * math.hypot(*axes) / math.sqrt(2.0)
    u_shaft = noise.get("torque_shaft_nm", 0.0)
    return FullLog(x, drag, shaft, good, noise["theta_mech_rad"], u_shaft, u_air_gap)


def _true_torque(full: Segment, recorded: Array, model: Model, values: Values) -> Array:
    """True shaft torque [n] behind a recorded one: gain and offset of the transducer taken out."""
    torque = recorded / (1.0 + values[full.instrument.transducer])
    for shaft, q in reversed(list(model.hooks("shaft", values))):
        offset, at_one = shaft(np.array([0.0, 1.0]), q)
        torque = (torque - offset) / (at_one - offset)
    return torque


def sharing_discriminator(effect: Effect, library: Mapping[str, Effect]) -> tuple[str, ...]:
    """The other effects that share an effect's discriminator.

    Parameters
    ----------
    effect
        The effect.
    library
        Every effect by name.

    """
    if effect.discriminator is None:
        return ()
    return tuple(
        n
        for n, e in library.items()
        if e.discriminator is effect.discriminator and n != effect.name
    )


def settled(effect: Effect, discrimination: Discrimination) -> Effect:
    """An effect with the shapes that full logs give, fixed, and their amplitudes as priors.

    Parameters
    ----------
    effect
        The effect.
    discrimination
        What its discriminator gave.

    """
    return replace(
        effect, parameters=tuple(_with_known_size(p, discrimination) for p in effect.parameters)
    )


def _with_known_size(p: Parameter, discrimination: Discrimination) -> Parameter:
    if p.name not in discrimination.values:
        return p
    if p.amplitude:
        return replace(p, usual=discrimination.values[p.name], u=discrimination.values[p.name][1])
    return replace(p, choice=True, scan=(1.0,), u=discrimination.values[p.name][1])


def renamed(system: LinearSystem, name: str, library: Mapping[str, Effect]) -> LinearSystem:
    """The fit with an effect replaced by the one that full logs show, with their numbers.

    Parameters
    ----------
    system
        The fit.
    name
        The effect; those that share its discriminator may take its place.
    library
        Every effect by name.

    Returns
    -------
    LinearSystem
        Refitted; the same where full logs do not decide.

    """
    fit = system.fit
    effect = fit.effect(name)
    discrimination = discriminate(fit, effect)
    if discrimination is None or discrimination.name not in (
        name,
        *sharing_discriminator(effect, library),
    ):
        return system
    shown = settled(library[discrimination.name], discrimination)
    effects = tuple(shown if e.name == name else e for e in fit.model.effects)
    model = replace(fit.model, effects=effects)
    prefix = f"{name}."
    values = fit.without(name).values | zero(shown, model)
    for p in shown.parameters_of(model.machine):
        if prefix + p.name in fit.values:
            values[f"{shown.name}.{p.name}"] = fit.values[prefix + p.name]
    values |= {f"{shown.name}.{key}": value for key, (value, _) in discrimination.values.items()}
    start = replace(fit, model=model, values=values).at({})
    return gauss_newton(start, before=system)
