"""An unknown structure in words, numbers and as an effect file to start from."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.criticism.discovery.dictionary import POWER
from pipeline.criticism.discovery.effect_source import effect_source
from pipeline.criticism.discovery.expression import Expression
from pipeline.criticism.discovery.matching_pursuit import Pursuit, curve_about
from pipeline.criticism.discovery.residual_inputs import Port
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.discovery import Discovery
from pipeline.records.diagnosis import (
    AlternativeVariables,
    CurvePoint,
    SketchTerm,
    UnknownStructure,
)

_POINTS, _TURN_POINTS, _DENSE = 17, 48, 2001
"""Points of a curve that is reported, of one over a turn at the least, and of one that is looked
at."""
_A_WAVE = 8
"""Points a wave of a curve that is reported over a turn: with fewer its lines cut the tops off, and
with less than two another order is seen."""
_SYMBOLS = {
    "torque": "drag",
    "drop": "drop",
    "flux": "co-energy/1.5",
    "angle": "recorded - true angle",
}
_DIRECTION = {"omega_mech_rad_s": "rotation", "iq_a": "the torque"}
"""What the sign of a variable is a direction of."""


def describe(
    pursuit: Pursuit,
    expression: Expression,
    smooth: Port,
    others: Sequence[tuple[tuple[str, ...], float]],
    signals: Sequence[str],
    name: str,
) -> UnknownStructure:
    """An unknown structure as curve, expression and effect file.

    Parameters
    ----------
    pursuit
        The residual input in narrow hats.
    expression
        The expression.
    smooth
        The same input with the few smooth curves that its evidence rests on.
    others
        Variables of inputs that explain nearly as much, and their share of the evidence.
    signals
        Recorded signals that miss, the worst first.
    name
        Name of the effect.

    """
    port = pursuit.port
    carrier = _leading(pursuit, expression)
    curve = _curve(pursuit, expression, smooth, carrier)
    shape = _shape(pursuit, curve, expression, carrier, others)
    size = pursuit.system.fit.model.machine.scales["current_a"]
    return UnknownStructure(
        signal=_signal(port, carrier, signals),
        variables=_columns(port, expression),
        shape=shape,
        sketch=tuple(
            SketchTerm(_term(port, expression, n, size), float(expression.amplitudes[n]), port.unit)
            for n in range(len(expression.terms))
        ),
        expression=_expression(port, expression, size),
        curve=curve,
        times="" if not port.carriers else port.carriers[carrier].words,
        alternatives=tuple(AlternativeVariables(*one) for one in others),
        effect=name,
        source=effect_source(port, expression, name, shape, size, pursuit.policy),
    )


def _columns(port: Port, expression: Expression) -> tuple[str, ...]:
    if not port.monomials:
        return port.columns
    used = [port.monomials[term.monomial] for term in expression.terms]
    names = ("id_a", "iq_a")
    used_names = tuple(c for n, c in enumerate(names) if any(powers[n] for powers in used))
    return used_names or names


def _signal(port: Port, carrier: int, signals: Sequence[str]) -> str:
    """The recorded signal that the structure is reported of: one that misses, if it acts on it."""
    signal = port.signals[min(carrier, len(port.signals) - 1)]
    if port.hook == "flux" and signals and signal not in signals:
        return signals[0]
    return signal


def _leading(pursuit: Pursuit, expression: Expression) -> int:
    """The carrier with the largest curve."""
    basis, count = pursuit.port.basis, len(pursuit.port.carriers)
    if basis is None or count < 2:
        return 0
    at = np.linspace(0.0, 2 * np.pi, _DENSE)
    return int(np.argmax([np.ptp(expression.value(at, n)) for n in range(count)]))


def _visited(pursuit: Pursuit) -> tuple[float, float]:
    """Range of the variable that the captures cover."""
    basis = pursuit.port.basis
    if basis is None or not basis.nodes.size:
        return 0.0, 2 * np.pi
    hats = pursuit.system.matrix[:, pursuit.model_size : pursuit.model_size + basis.nodes.size]
    largest = np.abs(hats).max(axis=0)
    live = np.flatnonzero(largest > pursuit.policy.visited_share * largest.max())
    return float(basis.nodes[live[0]]), float(basis.nodes[live[-1]])


def _curve(
    pursuit: Pursuit, expression: Expression, smooth: Port, carrier: int
) -> tuple[CurvePoint, ...]:
    """Bin centres with the curve's value and its 95 % band."""
    port = pursuit.port
    if port.variable is None or port.basis is None:
        return _map_curve(pursuit, expression)
    turning = port.variable.kind == "turn"
    if turning:
        at = turn_angles([term.order for term in expression.terms] or port.basis.orders)
    else:
        low, high = _visited(pursuit)
        at = np.linspace(low, high, _POINTS)
    value, spread = curve_about(pursuit, expression, _smooth_in_hats(pursuit, smooth), at, carrier)
    return tuple(
        CurvePoint(
            float(a),
            float(v),
            float(v - pursuit.policy.sure_u * u),
            float(v + pursuit.policy.sure_u * u),
        )
        for a, v, u in zip(at, value, spread, strict=True)
    )


def turn_angles(orders: Sequence[float]) -> Array:
    """Angles of a turn at which a curve is reported.

    Parameters
    ----------
    orders
        Waves a turn of the curve.

    Returns
    -------
    array [n]
        In rad, `_A_WAVE` points a wave at least.

    """
    points = max(_TURN_POINTS, _A_WAVE * math.ceil(max(orders, default=1.0)))
    return 2 * np.pi * np.arange(points) / points


def _smooth_in_hats(pursuit: Pursuit, smooth: Port) -> Array:
    """The smooth curves of a port [K, k] as coefficients of its hats, one block a carrier."""
    hats, smooth_basis = pursuit.port.basis, smooth.basis
    if hats is None or smooth_basis is None or not hats.nodes.size:
        return np.eye(pursuit.system.matrix.shape[1] - pursuit.model_size)
    block = np.zeros((len(hats.names), len(smooth_basis.names)))
    for n in range(len(smooth_basis.names)):
        weights = np.zeros(len(smooth_basis.names))
        weights[n] = 1.0
        block[: hats.nodes.size, n] = smooth_basis.curve(hats.nodes, weights)
    for n, order in enumerate(hats.orders):
        first = 2 * smooth_basis.orders.index(order)
        block[:, first : first + 2] = 0.0
        block[hats.nodes.size + 2 * n, first] = block[hats.nodes.size + 2 * n + 1, first + 1] = 1.0
    return np.asarray(np.kron(np.eye(len(pursuit.port.carriers)), block), dtype=float)


def _map_curve(pursuit: Pursuit, expression: Expression) -> tuple[CurvePoint, ...]:
    """Flux linkage along the axis whose own current bends it most, the other current zero."""
    size = pursuit.system.fit.model.machine.scales["current_a"]
    at = np.linspace(-1.0, 1.0, _POINTS)
    best: tuple[float, Array, Array] | None = None
    for axis in (0, 1):
        rows = []
        for term in expression.terms:
            powers = pursuit.port.monomials[term.monomial]
            power, other_power = powers[axis], powers[1 - axis]
            rows.append(power * at ** max(power - 1, 0) if other_power == 0 else np.zeros(at.size))
        slopes = np.stack(rows) if rows else np.zeros((0, at.size))
        value = expression.amplitudes @ slopes
        spread = np.sqrt(
            np.maximum(np.einsum("iv,ij,jv->v", slopes, expression.covariance, slopes), 0.0)
        )
        if best is None or np.ptp(value) > best[0]:
            best = float(np.ptp(value)), value, spread
    if best is None:
        return ()
    return tuple(
        CurvePoint(
            float(size * a),
            float(v),
            float(v - pursuit.policy.sure_u * u),
            float(v + pursuit.policy.sure_u * u),
        )
        for a, v, u in zip(at, best[1], best[2], strict=True)
    )


def _shape(
    pursuit: Pursuit,
    curve: Sequence[CurvePoint],
    expression: Expression,
    carrier: int,
    others: Sequence[tuple[tuple[str, ...], float]],
) -> str:
    """The curve in words: parity, where it is largest, and what else would explain as much."""
    port = pursuit.port
    text = port.effect.words
    variable = port.variable
    if variable is not None and curve:
        text += f": {_run(port, curve, expression, carrier, pursuit.policy)}"
    if others:
        listed = "; ".join(" and ".join(columns) for columns, _ in others)
        text += f"; the captures would be explained nearly as well by {listed}"
    return text


def _run(
    port: Port, curve: Sequence[CurvePoint], expression: Expression, carrier: int, policy: Discovery
) -> str:
    variable = port.variable
    if variable is None:
        raise ValueError("a port without a variable has no curve")
    low, high = curve[0].at, curve[-1].at
    dense = np.linspace(low, high, _DENSE)
    values = expression.value(dense, carrier)
    if not expression.terms:
        dense, values = _determined(curve)
    top = int(np.argmax(np.abs(values)))
    warm = variable.kind == "warm"
    at = f"{dense[top] + 25.0:.3g} degC" if warm else f"{abs(dense[top]):.3g} {variable.unit}"
    place = f"{abs(values[top]):.3g} {port.unit} at {at}"
    if variable.kind == "turn":
        return f"at most {place}"
    parity = _parity(dense, values, policy) if variable.kind == "signed" else ""
    step = _step(dense, values, policy)
    if port.hook == "angle" and parity == "odd, " and step:
        return (
            f"it depends on the direction of {_DIRECTION[variable.name]}, like an angle error of "
            f"±{1e3 * step:.3g} mrad, as of an encoder that sits loose"
        )
    return f"{parity}{'largest,' if warm else _ending(dense, np.abs(values), policy)} {place}"


def _determined(curve: Sequence[CurvePoint]) -> tuple[Array, Array]:
    """Places and values [n] of the points whose band leaves out zero; all where none does.

    Where few samples lie, a curve may be of any size.
    """
    points = [p for p in curve if p.low * p.high > 0.0] or curve
    return np.array([p.at for p in points]), np.array([p.value for p in points])


def _ending(at: Array, size: Array, policy: Discovery) -> str:
    """How a curve's size [n] runs out where its variable is largest."""
    top = int(np.argmax(size))
    end = 0 if abs(at[0]) > abs(at[-1]) or (at[0] < 0.0 and top == 0) else -1
    before = float(np.interp(at[end] - policy.tail_share * (at[end] - at[-1 - end]), at, size))
    level = size[end] <= (1.0 + policy.level_share) * before
    if level and size[end] >= (1.0 - policy.level_share) * size[top]:
        return "level towards the end of the range,"
    if abs(at[top]) < policy.inside_share * abs(at[end]):
        return "largest," if top == 0 else "with its maximum"
    return "largest," if level else "still growing at the end of the range,"


def _step(at: Array, values: Array, policy: Discovery) -> float:
    """Size of a curve that goes by the sign alone beside zero; 0 of any other."""
    size = np.abs(values)[np.abs(at) >= policy.jump_share * float(np.abs(at).max())]
    level = float(np.median(size))
    return level if float(np.abs(size - level).max()) <= policy.parity_share * level else 0.0


def _parity(at: Array, values: Array, policy: Discovery) -> str:
    mirrored = np.interp(-at, at, values)
    both = (np.abs(at) <= min(abs(at[0]), abs(at[-1]))) & (
        np.abs(at) > policy.jump_share * np.abs(at).max()
    )
    if at[0] >= 0.0 or at[-1] <= 0.0 or not both.any():
        return ""
    span = float(np.abs(values).max())
    if float(np.abs(values + mirrored)[both].max()) < policy.parity_share * span:
        return "odd, "
    if float(np.abs(values - mirrored)[both].max()) < policy.parity_share * span:
        return "even, "
    return "neither odd nor even, "


def _term(port: Port, expression: Expression, n: int, current_a: float) -> str:
    """One term in words, its carrier in front."""
    term = expression.terms[n]
    if term.kind == POWER or port.variable is None:
        d, q = port.monomials[term.monomial]
        divisor = f"/({current_a:.4g} A)"
        parts = [f"(id_a{divisor})^{d}"] * (d > 0) + [f"(iq_a{divisor})^{q}"] * (q > 0)
        return " ".join(parts)
    text = term.words(port.variable)
    carrier = port.carriers[term.carrier].words
    axis = ""
    if len(port.carriers) > 1:
        axis = "d axis: " if term.carrier == 0 else "q axis: "
    return f"{axis}{carrier} · {text}" if carrier else f"{axis}{text}"


def _expression(port: Port, expression: Expression, current_a: float) -> str:
    """The whole expression on one line, amplitudes with their standard uncertainty."""
    if not expression.terms:
        return ""
    parts = []
    for n in range(len(expression.terms)):
        u = expression.u(n, "amplitude")
        amplitude = f"({expression.amplitudes[n]:.4g} ± {u:.1g}) {port.unit}"
        parts.append(f"{amplitude} · [{_term(port, expression, n, current_a)}]")
    return f"{_SYMBOLS[port.hook]} = " + " + ".join(parts)
