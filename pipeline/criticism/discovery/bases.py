"""Linear bases for a curve of one variable: splines, waves, fine hats, and their ranges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from pipeline.criticism.operating import Array, Operating
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.discovery import Discovery
from pipeline.physics.units import TURN_RAD

PAST = "torque_past_nm"
"""Name of the variable that a transducer's hysteresis is a curve of."""
_EDGE = 1e-9
"""First hat, as a share of the range: beside zero and not at it, where friction jumps."""


@dataclass(frozen=True, slots=True)
class Variable:
    """What a curve may depend on.

    Attributes
    ----------
    name, unit
        Glossary name, and unit.
    columns
        Columns of a capture that hold it.
    kind
        `signed`, `size`, `warm` or `turn`.
    top
        Its range [unit].
    code, read
        How it is read from an `Operating` x, as Python and as a function.

    """

    name: str
    columns: tuple[str, ...]
    unit: str
    kind: str
    top: float
    code: str
    read: Callable[[Operating], Any]


@dataclass(frozen=True, slots=True)
class Basis:
    """Curves c(v) = Σ c_k mix_k(v) + Σ waves.

    Attributes
    ----------
    names
        One a coefficient.
    nodes
        Places between which the curves are linear; constant beyond them [N].
    mix
        The curves at the nodes [N, K].
    orders
        Each adds a sine and a cosine.
    period
        Of the variable; None where it has none.

    """

    names: tuple[str, ...]
    nodes: Array
    mix: Array
    orders: tuple[float, ...]
    period: float | None

    def curve(self, at: Any, weights: Array) -> Any:
        """The curve with given coefficients.

        Parameters
        ----------
        at
            Values of the variable [n]; complex where there are only waves.
        weights
            One a name.

        Returns
        -------
        array [n]
            Analytic where there are only waves.

        """
        count = self.mix.shape[1]
        total = 0.0 * at
        if np.any(weights[:count]):
            total = total + np.interp(
                at, self.nodes, self.mix @ weights[:count], period=self.period
            )
        for place, order in enumerate(self.orders):
            sine, cosine = weights[count + 2 * place : count + 2 * place + 2]
            if sine:
                total = total + sine * np.sin(order * at)
            if cosine:
                total = total + cosine * np.cos(order * at)
        return total


def variables(machine: Machine) -> Mapping[str, Variable]:
    """Every variable that a curve may depend on, with its range on one machine.

    Parameters
    ----------
    machine
        Scales of current and speed.

    Returns
    -------
    mapping of Variable
        By glossary name.

    """
    current, speed = machine.scales["current_a"], machine.scales["speed_rad_s"]
    listed = (
        _speed(speed),
        _axis("iq_a", current),
        _axis("id_a", current),
        Variable(
            "i_a", ("id_a", "iq_a"), "A", "size", current, "np.abs(x.i_a)", lambda x: np.abs(x.i_a)
        ),
        _warmth("temp_winding_degc", "winding_k"),
        _warmth("temp_magnet_degc", "magnet_k"),
        _past(machine),
        _turn("theta_mech_rad", "theta_rad"),
        _turn("theta_elec_rad", "eps_rad"),
    )
    return {variable.name: variable for variable in listed}


def _speed(top_rad_s: float) -> Variable:
    name, code = "omega_mech_rad_s", "x.omega_rad_s"
    return Variable(name, (name,), "rad/s", "signed", top_rad_s, code, attrgetter("omega_rad_s"))


def _axis(name: str, top_a: float) -> Variable:
    """The current of one axis, without the imaginary part of a complex step."""
    read = attrgetter(name)
    code = f"np.real(x.{name})"
    return Variable(name, (name,), "A", "signed", top_a, code, lambda x: np.real(read(x)))


def _past(machine: Machine) -> Variable:
    """Past of the recorded torque: over one that follows it with a play; 0 without a transducer."""
    top = machine.policy.cutting.play_share * machine.scales["torque_nm"]

    def read(x: Operating) -> Array:
        past = x.shaft.behind_nm
        return np.zeros(x.theta_rad.size) if past is None else past

    code = "0.0 * x.theta_rad if x.shaft.behind_nm is None else x.shaft.behind_nm"
    return Variable(PAST, ("torque_shaft_nm",), "N·m", "signed", top, f"({code})", read)


def _warmth(column: str, field: str) -> Variable:
    """A temperature above 25 °C, up to 100 K."""
    return Variable(column, (column,), "K", "warm", 100.0, f"x.{field}", attrgetter(field))


def _turn(column: str, field: str) -> Variable:
    """An angle, of one turn."""
    return Variable(column, (column,), "rad", "turn", TURN_RAD, f"x.{field}", attrgetter(field))


def coarse(variable: Variable, machine: Machine, policy: Discovery) -> Basis:
    """A few smooth curves, enough to see whether and how something depends on the variable.

    A signed variable has a spline for each sign, since friction jumps at zero.

    Parameters
    ----------
    variable
        The variable.
    machine
        Orders that its waves may have.
    policy
        Number of knots.

    Returns
    -------
    Basis
        A signed variable has a spline for each sign, since friction jumps at zero.

    """
    if variable.kind == "turn":
        return waves(_orders(variable, machine, policy))
    nodes = _nodes(variable, policy)
    if variable.kind == "warm":
        mix = _cardinal(np.array(policy.warm_knots_k), nodes)
    else:
        # natural splines of the size itself hold a straight line, which friction has too
        knots = variable.top * np.linspace(0.0, 1.0, policy.knots) ** policy.knot_exponent
        half = _cardinal(knots, np.abs(nodes))
        sides = [nodes > 0.0] if variable.kind == "size" else [nodes < 0.0, nodes > 0.0]
        mix = np.concatenate([half * side[:, None] for side in sides], axis=1)
    names = tuple(f"k{n}" for n in range(mix.shape[1]))
    return Basis(names, nodes, mix, (), None)


def fine(variable: Variable, machine: Machine, policy: Discovery) -> Basis:
    """Hats narrow enough for any curve of the dictionary, and the waves that they miss.

    Parameters
    ----------
    variable
        The variable.
    machine
        Orders that its waves may have.
    policy
        Number of hats.

    """
    nodes = _nodes(variable, policy)
    periodic = variable.kind == "turn"
    high: tuple[float, ...] = ()
    if periodic:
        high = tuple(k for k in _orders(variable, machine, policy) if k not in _lowest(policy))
    names = tuple(f"k{n}" for n in range(nodes.size)) + _wave_names(high)
    return Basis(names, nodes, np.eye(nodes.size), high, TURN_RAD if periodic else None)


def waves(orders: tuple[float, ...]) -> Basis:
    """Sine and cosine of some orders.

    Parameters
    ----------
    orders
        Waves a turn.

    """
    return Basis(_wave_names(orders), np.empty(0), np.empty((0, 0)), orders, TURN_RAD)


def _wave_names(orders: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{wave}{k}" for k in orders for wave in ("sin", "cos"))


def _lowest(policy: Discovery) -> tuple[int, ...]:
    """Orders a turn that are offered on every machine."""
    return tuple(range(1, policy.orders + 1))


def _orders(variable: Variable, machine: Machine, policy: Discovery) -> tuple[float, ...]:
    if variable.name == "theta_elec_rad":
        return (*_lowest(policy), 12)
    p = machine.pole_pairs
    slots = {order for order in (machine.slots, machine.cogging_order) if order}
    orders = slots.union(machine.torque_orders, machine.load_orders)
    return tuple(sorted(orders.union(_lowest(policy), (p, 2 * p, 6 * p))))


def _nodes(variable: Variable, policy: Discovery) -> Array:
    if variable.kind == "turn":
        return TURN_RAD * np.arange(policy.turn_hats) / policy.turn_hats
    if variable.kind == "warm":
        return np.linspace(policy.warm_knots_k[0], policy.warm_knots_k[-1], 2 * policy.hats)
    half = variable.top * np.maximum(
        np.linspace(0.0, 1.0, policy.hats) ** policy.knot_exponent, _EDGE
    )
    return half if variable.kind == "size" else np.concatenate([-half[::-1], half])


def _cardinal(knots: Array, at: Array) -> Array:
    """Natural cubic splines [N, K] that are one at a knot and zero at the others."""
    from scipy.interpolate import CubicSpline  # slow to import and rarely used

    spline = CubicSpline(knots, np.eye(knots.size), bc_type="natural")
    return spline(np.clip(at, knots[0], knots[-1]))
