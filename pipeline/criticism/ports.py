"""Generic places where an unknown effect could act: curves of one variable, without a formula.

Each port is an effect like any other, so the same fit and score serve it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.criticism.effect import (
    Array,
    Complex,
    Effect,
    Machine,
    Operating,
    Parameter,
    Values,
)

_KNOTS = (
    -1.0,
    -0.8,
    -0.6,
    -0.42,
    -0.28,
    -0.16,
    -0.08,
    -0.03,
    0.03,
    0.08,
    0.16,
    0.28,
    0.42,
    0.6,
    0.8,
    1.0,
)
_WIDE = 1e6


@dataclass(frozen=True, slots=True)
class Port:
    """One generic effect: the signal it enters, the capture column it depends on, its knots."""

    effect: Effect
    signal: str
    variables: tuple[str, ...]
    knots: tuple[float, ...]
    unit: str


def ports(machine: Machine) -> tuple[Port, ...]:
    """Every port for one machine."""
    s = machine.scales
    ranges: dict[str, tuple[float, Callable[[Operating], Array]]] = {
        "omega_mech_rad_s": (s["speed_rad_s"], lambda x: x.omega_rad_s),
        "iq_a": (s["current_a"], lambda x: np.real(x.iq_a)),
        "id_a": (s["current_a"], lambda x: np.real(x.id_a)),
        "temp_winding_degc": (100.0, lambda x: x.winding_k),
        "temp_magnet_degc": (100.0, lambda x: x.magnet_k),
    }
    made = []
    for name, (top, read) in ranges.items():
        made.append(_torque_curve(name, top, read))
        made += [_drop_curve(name, top, read, axis) for axis in "dq"]
    for signal, variable in (
        ("torque", "theta_mech_rad"),
        ("drop", "theta_mech_rad"),
        ("flux", "theta_elec_rad"),
    ):
        made.append(_waves(signal, variable, machine))
    made.append(_flux_map())
    return tuple(made)


def _hats(value: Array, knots: Array, weights: Array) -> Array:
    """Piecewise linear curve through `weights` at `knots`, flat outside."""
    return np.interp(value, knots, weights)


def _curve_parameters(scale: str, unit: str, knots: Array) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"k{n}", unit, 0.01, 0.0, scale, -_WIDE, _WIDE) for n in range(knots.size)
    )


def _effect(name: str, words: str, parameters: tuple[Parameter, ...], **hooks: Any) -> Effect:
    return Effect(name, words, "", (), "", "", parameters, **hooks)


def _torque_curve(name: str, top: float, read: Callable[[Operating], Array]) -> Port:
    knots = top * np.array(_KNOTS)

    def torque(x: Operating, q: Values) -> Array:
        return _hats(read(x), knots, np.array(list(q.values())))

    effect = _effect(
        f"port:torque:{name}",
        f"drag as a curve of {name}",
        _curve_parameters("torque_nm", "N·m", knots),
        torque=torque,
    )
    return Port(effect, "torque_shaft_nm", (name,), tuple(knots), "N·m")


def _drop_curve(name: str, top: float, read: Callable[[Operating], Array], axis: str) -> Port:
    knots = top * np.array(_KNOTS)
    turn = 1.0 if axis == "d" else 1j

    def drop(x: Operating, q: Values) -> Complex:
        curve = _hats(read(x), knots, np.array(list(q.values())))
        voltage: Complex = (turn * curve * (1.0 if x.inverter else 0.0)).astype(np.complex128)
        return voltage

    effect = _effect(
        f"port:v{axis}:{name}",
        f"v_{axis} drop as a curve of {name}",
        _curve_parameters("voltage_v", "V", knots),
        drop=drop,
    )
    return Port(effect, f"v{axis}_v", (name,), tuple(knots), "V")


def _waves(signal: str, variable: str, machine: Machine) -> Port:
    p = machine.pole_pairs
    electrical = variable == "theta_elec_rad"
    orders = {1, 2, 3, 4, 5, 6, 8, 12} if electrical else {1, 2, 3, 4, 5, 6, p, 2 * p, 6 * p}
    if not electrical:
        orders |= set(machine.torque_orders)
    scale, unit = {
        "torque": ("torque_nm", "N·m"),
        "drop": ("voltage_v", "V"),
        "flux": ("flux_wb", "Wb"),
    }[signal]
    axes = ("",) if signal == "torque" else ("d", "q")
    parameters = tuple(
        Parameter(f"{axis}{wave}{k}", unit, 0.01, 0.0, scale, -_WIDE, _WIDE)
        for axis in axes
        for k in sorted(orders)
        for wave in ("sin", "cos")
    )

    def series(x: Operating, q: Values, axis: str) -> Any:
        angle = x.eps_rad if electrical else x.theta_rad
        total = 0.0 * angle
        for name, value in q.items():
            if value and name.startswith(axis):
                bare = name.removeprefix(axis)
                wave = np.sin if bare.startswith("sin") else np.cos
                total = total + value * wave(int(bare[3:]) * angle)
        return total

    hooks: dict[str, Any] = {
        "torque": {"torque": lambda x, q: series(x, q, "")},
        "drop": {
            "drop": lambda x, q: (
                (series(x, q, "d") + 1j * series(x, q, "q")) * (1.0 if x.inverter else 0.0)
            )
        },
        "flux": {"coenergy": lambda x, q: x.id_a * series(x, q, "d") + x.iq_a * series(x, q, "q")},
    }[signal]
    effect = _effect(
        f"port:{signal}:{variable}", f"{signal} as waves of {variable}", parameters, **hooks
    )
    shown = {"torque": "torque_shaft_nm", "drop": "vd_v", "flux": "psi_d_wb"}[signal]
    return Port(effect, shown, (variable,), (), unit)


def _flux_map() -> Port:
    powers = [(a, n - a) for n in (3, 4, 5) for a in range(n + 1)]
    parameters = tuple(
        Parameter(f"d{a}q{b}", "Wb", 0.01, 0.0, "flux_wb", -_WIDE, _WIDE) for a, b in powers
    )

    def coenergy(x: Operating, q: Values) -> Any:
        size = x.machine.scales["current_a"]
        d, i = x.id_a / size, x.iq_a / size
        terms = {(a, b): q[f"d{a}q{b}"] for a, b in powers}
        return size * sum(c * d**a * i**b for (a, b), c in terms.items() if c)

    effect = _effect(
        "port:flux:current",
        "co-energy as a polynomial of the currents",
        parameters,
        coenergy=coenergy,
    )
    return Port(effect, "psi_q_wb", ("id_a", "iq_a"), (), "Wb")
