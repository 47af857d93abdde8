"""Effects of a datasheet as tables that other programs interpolate.

An effect is evaluated, not rewritten: its own hooks are asked on a grid of whatever they turn out
to depend on. An effect of the user's is not in the library, and has no table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.criticism.effect import Effect, TorqueHook
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.coenergy import air_gap_torque, base_flux, effect_flux
from pipeline.criticism.operating import Array, Operating, ShaftState, Values
from pipeline.criticism.parameter import Machine
from pipeline.records.effect_table import EffectTable, EffectTables
from pipeline.records.model_verdict import ModelVerdict

_CURRENTS = 21
_SPEEDS = 60
_ANGLES_A_WAVE = 16
_PROBES = 64
_VARIABLES = (
    "id_a",
    "iq_a",
    "eps_rad",
    "theta_rad",
    "omega_rad_s",
    "winding_k",
    "magnet_k",
)
_SENSOR = "it is of the sensors or the drive, not of the motor"


def effect_tables(
    model: ModelVerdict | None, base: Mapping[str, float], pole_pairs: int
) -> EffectTables:
    """The effects that a model of a motor was fitted with or lacks, as tables.

    Parameters
    ----------
    model
        Of the datasheet, with the sizes of its effects; None gives no tables.
    base
        `r_ohm`, `ld_h`, `lq_h`, `psi_wb` of the motor, in their units.
    pole_pairs
        p [1].

    Returns
    -------
    EffectTables
        Torque over speed or over the shaft's angle, flux over both currents; and for every other
        effect the reason why there is no table.

    """
    if model is None:
        return EffectTables()
    library = effects()
    tables: list[EffectTable] = []
    without = dict.fromkeys(model.effects, "its size is not in the datasheet")
    without = {name: why for name, why in without.items() if not name.startswith("-")}
    for name, parameters in model.sizes.items():
        values = {short: value for short, (value, _, _) in parameters.items()}
        known = {short: value for short, value in values.items() if value is not None}
        without.pop(name, None)
        if name not in library or not model.scales:
            without[name] = "it is not in this library" if model.scales else "run the motor anew"
        elif len(known) < len(values):
            without[name] = "its size is not identifiable"
        else:
            machine = Machine(pole_pairs, None, model.scales)
            q = dict.fromkeys(_names(library[name], machine), 0.0) | known
            tables_of_effect = _tables(library[name], over_all_ranges(machine, base), q)
            tables += tables_of_effect
            if not tables_of_effect:
                without[name] = _why_not(library[name])
    return EffectTables(tuple(tables), without)


def _names(effect: Effect, machine: Machine) -> list[str]:
    return [] if effect.expand is not None else [one.name for one in effect.every(machine)]


def _why_not(effect: Effect) -> str:
    hooks = (effect.coenergy, effect.torque, effect.drop, effect.parallel)
    if all(hook is None for hook in hooks):
        return _SENSOR
    return "it needs more than a table over speed, angle or currents"


def over_all_ranges(machine: Machine, base: Mapping[str, float]) -> Operating:
    """States of the machine all over its range [n], no two variables in step.

    Parameters
    ----------
    machine
        Its scales.
    base
        `r_ohm`, `ld_h`, `lq_h`, `psi_wb` of the motor, in their units.

    """
    rng = np.random.default_rng(1)
    current, speed = machine.scales["current_a"], machine.scales["speed_rad_s"]
    draw = rng.uniform(-1.0, 1.0, (7, _PROBES))
    theta = math.pi * draw[3]
    return Operating(
        machine=machine,
        base=base,
        id_a=current * draw[0],
        iq_a=current * draw[1],
        eps_rad=math.pi * draw[2],
        theta_rad=theta,
        omega_rad_s=speed * draw[4],
        winding_k=20.0 * draw[5],
        magnet_k=20.0 * draw[6],
        travel_rad=np.full(_PROBES, math.inf),
        inverter=True,
        freq_hz=np.full(_PROBES, machine.scales["freq_hz"]),
        ts_s=machine.scales["period_s"],
        shaft=ShaftState(held=True),
    )


def _tables(effect: Effect, anywhere: Operating, q: Values) -> list[EffectTable]:
    """Tables of one effect: none where one of its hooks cannot be one."""
    if effect.drop is not None or (effect.parallel is not None and effect.torque is None):
        return []
    tables: list[EffectTable] = []
    if effect.coenergy is not None:
        flux = _flux_tables(effect, anywhere, q)
        if not flux:
            return []
        tables += flux
    if effect.torque is not None:
        torque = _torque_table(effect.name, effect.torque, anywhere, q)
        if torque is None:
            return []
        tables.append(torque)
    return tables


def _depends(on: Callable[[Operating], Array], x: Operating) -> set[str]:
    """The variables that a hook's answer changes with."""
    value = on(x)

    def moved(name: str) -> Array:
        return on(_fresh(x, **{name: np.roll(getattr(x, name), 1)}))

    return {name for name in _VARIABLES if not np.array_equal(moved(name), value)}


def _fresh(x: Operating, **changed: Any) -> Operating:
    return replace(x, **changed, cache={}, psi_wb=None, torque_em_nm=None)


def _torque_table(effect: str, hook: TorqueHook, x: Operating, q: Values) -> EffectTable | None:
    """Drag over what it depends on, where that is speed or the shaft's angle, at no current."""

    def drag(at: Operating) -> Array:
        at.psi_wb = base_flux(at, at.base)
        at.torque_em_nm = air_gap_torque(at, at.psi_wb, np.zeros(at.omega_rad_s.shape))
        return hook(at, q) + np.zeros(at.omega_rad_s.shape)

    needs = _depends(drag, x)
    note = "at no current" if needs & {"id_a", "iq_a"} else ""
    variables = needs - {"id_a", "iq_a"}
    if variables == {"theta_rad"} and not note:
        grid = 2.0 * math.pi * np.arange(_angles(q)) / _angles(q)
        name, axis = "theta_mech_rad", {"theta_rad": grid}
    elif variables == {"omega_rad_s"}:
        grid = _speeds(x.machine.scales["speed_rad_s"])
        name, axis = "omega_mech_rad_s", {"omega_rad_s": grid}
    else:
        return None
    values = drag(at_rest(x, grid.size, **axis))
    if not np.any(values):
        return None
    axes = {name: _floats(grid)}
    return EffectTable(effect, "torque_nm", "N·m", axes, _floats(values), note)


def _angles(q: Values) -> int:
    """Points of a turn: enough for the highest order that a parameter's name holds."""
    orders = [int(part) for name in q for part in name.split("_") if part.isdigit()]
    return _ANGLES_A_WAVE * max(orders, default=16)


def _speeds(largest: float) -> Array:
    """Speeds [n, rad/s], even in their logarithm, for friction bends at low ones."""
    half = np.geomspace(1e-4 * largest, largest, _SPEEDS)
    return np.concatenate([-half[::-1], half])


def _flux_tables(effect: Effect, x: Operating, q: Values) -> list[EffectTable]:
    """Both flux linkages over both currents, where nothing else moves them."""
    if _depends(lambda at: _packed(effect_flux(effect, at, q)[0]), x) - {"id_a", "iq_a"}:
        return []
    grid = np.linspace(-1.0, 1.0, _CURRENTS) * x.machine.scales["current_a"]
    d, i = (one.ravel() for one in np.meshgrid(grid, grid, indexing="ij"))
    flux, _ = effect_flux(effect, at_rest(x, d.size, id_a=d, iq_a=i), q)
    axes = {"id_a": _floats(grid), "iq_a": _floats(grid)}
    return [
        EffectTable(effect.name, name, "Wb", axes, _floats(part))
        for name, part in (("psi_d_wb", flux.real), ("psi_q_wb", flux.imag))
    ]


def _packed(flux: Any) -> Array:
    return np.stack([flux.real, flux.imag])


def at_rest(x: Operating, size: int, **changed: Array) -> Operating:
    """The machine at 25 °C without current or motion, but for what is changed.

    Parameters
    ----------
    x
        A state, of `over_all_ranges`.
    size
        Number of states n.
    **changed
        Variables that are not 0 [n].

    """
    zeros = {name: np.zeros(size) for name in (*_VARIABLES, "freq_hz")}
    return _fresh(x, **{**zeros, "travel_rad": np.full(size, math.inf), **changed})


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
