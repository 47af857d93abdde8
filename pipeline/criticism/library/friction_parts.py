"""What friction constants contain of a drag that turns with the shaft as friction does.

A coast with open terminals, and a drive at no load, show the sum of friction and iron loss. Only
the voltages and the flux tell the iron's part, so it is separated once an effect of it is known.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.library.effect_tables import at_rest, over_all_ranges
from pipeline.criticism.machine.coenergy import base_flux
from pipeline.criticism.machine.model import Model, evaluate, values_of
from pipeline.criticism.operating import Array, Values
from pipeline.criticism.parameter import Machine
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.model_verdict import Parameters

_SPEEDS = 64
_MAGNET_ALONE = {"psi_wb": 1.0, "ld_h": 1.0, "lq_h": 1.0, "r_ohm": 1.0}
"""Constants of a machine whose flux is told in that of its magnet."""
_FORMS = (("torque_coulomb_nm", "N·m"), ("b_visc_nm_s_rad", "N·m·s/rad"))


def friction_parts(
    effect: Effect, parameters: Mapping[str, ReportedParameter], machine: Machine
) -> Parameters:
    """What T_c and b contain of an effect's drag, where they were fitted without it.

    Parameters
    ----------
    effect
        An effect with a torque.
    parameters
        What was fitted of it, by name; those without a value count as 0.
    machine
        Its scales: the highest speed [rad/s].

    Returns
    -------
    mapping of str to (value, u, unit)
        By the name of the constant; empty where it has none.

    Notes
    -----
    T(ω) of the effect at no current and at the magnet's flux, by least squares of T_c sign(ω) + b ω
    over speeds that are even up to the highest. A drag of eddy currents is all of it b, that of
    hysteresis all of it T_c.

    """
    if effect.torque is None:
        return {}
    names = [one.name for one in effect.every(machine)]
    known = {name: one for name, one in parameters.items() if one.value is not None}
    values = dict.fromkeys(names, 0.0) | {name: one.value or 0.0 for name, one in known.items()}
    parts = _projected(effect, values, machine)
    changes = [
        _projected(effect, values | {name: values[name] + one.u}, machine) - parts
        for name, one in known.items()
        if one.u
    ]
    u = np.sqrt(np.sum(np.square(changes), axis=0)) if changes else np.zeros(len(_FORMS))
    return {
        constant: ReportedParameter(float(value), float(spread), unit)
        for (constant, unit), value, spread in zip(_FORMS, parts, u, strict=True)
        if value or spread
    }


def drives(effect: Effect, model: Model, values: Values) -> bool:
    """Whether an effect that is friction would push the shaft at some speed.

    Parameters
    ----------
    effect
        The effect; a load may drive, so one that is no `friction` is not looked at.
    model, values
        With the effect.

    Returns
    -------
    bool
        True where it differs between the senses by more than the drag that both have in common, its
        negligible size beside.

    Notes
    -----
    Friction has the sense of rotation. Its even part over speed is a difference between senses; its
    odd part, with all other frictions, is their mean. Other even drags, such as a load or waves of
    the angle, drop out of that mean.

    """
    if not effect.friction or effect.torque is None:
        return False
    machine = model.machine
    speeds = _speeds(machine)
    x = at_rest(
        over_all_ranges(machine, values), 2 * _SPEEDS, omega_rad_s=np.append(speeds, -speeds)
    )
    drag = evaluate(model, x, values, frozenset({"torque"})).drag_nm
    own = effect.torque(x, values_of(effect, machine, values))
    mean = 0.5 * (drag[:_SPEEDS] - drag[_SPEEDS:])
    difference = 0.5 * np.abs(own[:_SPEEDS] + own[_SPEEDS:])
    negligible = [p.negligible * machine.scale(p) for p in effect.parameters_of(machine)]
    return bool((difference - mean).max() > max(negligible))


def _speeds(machine: Machine) -> Array:
    """Speeds [n, rad/s], even up to the highest."""
    highest: float = machine.scales["speed_rad_s"]
    return highest * (np.arange(_SPEEDS) + 0.5) / _SPEEDS


def _projected(effect: Effect, values: Values, machine: Machine) -> Array:
    """T_c [N·m] and b [N·m·s/rad] of the drag."""
    highest = machine.scales["speed_rad_s"]
    speeds = _speeds(machine)
    x = at_rest(over_all_ranges(machine, _MAGNET_ALONE), _SPEEDS, omega_rad_s=speeds)
    x.psi_wb, x.torque_em_nm = base_flux(x, _MAGNET_ALONE), np.zeros(_SPEEDS)
    assert effect.torque is not None
    drag = effect.torque(x, values) + np.zeros(_SPEEDS)
    forms = np.column_stack([np.ones(_SPEEDS), speeds])
    solved, *_ = np.linalg.lstsq(forms, drag, rcond=None)
    # rounding of the one form in a drag that has only the other
    least = 1e-9 * np.max(np.abs(drag), initial=0.0) / np.array([1.0, highest])
    return np.where(np.abs(solved) > least, solved, 0.0)
