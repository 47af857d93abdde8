"""Structure that no known effect explains: on what it depends, and what it looks like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.effect import Array
from pipeline.criticism.linearise import effect_columns
from pipeline.criticism.ports import Port, ports
from pipeline.criticism.segments import Segment
from pipeline.criticism.system import Fitted, own_columns, system
from pipeline.records.diagnosis import UnknownStructure

_NEAR = 0.05


@dataclass(frozen=True, slots=True)
class Found:
    """A port with the misfit it removes less its price, and its fitted coefficients."""

    port: Port
    gain: float
    values: dict[str, float]
    spread: Array


def unknown_structure(
    segments: Sequence[Segment], fitted: Fitted, signals: Sequence[str]
) -> tuple[UnknownStructure | None, float]:
    """The port that removes most misfit, as a sketch, and the misfit it removes.

    `signals` are the recorded signals that miss their floor; the structure is told of them.
    """
    offered = ports(fitted.model.machine)
    columns = [effect_columns(port.effect, fitted.model) for port in offered]
    wide = system(segments, fitted, [c for some in columns for c in some])
    own = np.arange(len(own_columns(fitted.model)))
    before = wide.best(own).misfit
    price = math.log(wide.size)
    found: list[Found] = []
    first = own.size
    for port, mine in zip(offered, columns, strict=True):
        places = np.arange(first, first + len(mine))
        first += len(mine)
        live = places[np.any(wide.matrix[:, places] != 0.0, axis=0)]
        if live.size == 0:
            continue
        chosen = np.concatenate([own, live])
        end = wide.best(chosen)
        gain = before - end.misfit - live.size * price
        spread = np.sqrt(np.maximum(np.diag(wide.covariance(chosen))[own.size :], 0.0))
        names = [wide.columns[n].name for n in live]
        values = dict(zip(names, end.step[own.size :].tolist(), strict=True))
        found.append(Found(port, gain, values, spread))
    best = max(found, key=lambda f: f.gain, default=None)
    if best is None or best.gain <= 0.0:
        return None, 0.0
    return _sketched(best, signals), best.gain


def _sketched(found: Found, signals: Sequence[str]) -> UnknownStructure:
    port = found.port
    terms = []
    for n, (name, value) in enumerate(found.values.items()):
        if abs(value) < 2.0 * found.spread[n]:
            continue
        short = name.rsplit(".", 1)[1]
        if port.knots:
            at = port.knots[int(short.removeprefix("k"))]
            short = f"at {port.variables[0]} = {at:.4g}"
        terms.append((short, value, port.unit))
    signal = port.signal
    if signal not in signals and port.signal in ("psi_d_wb", "psi_q_wb") and signals:
        signal = signals[0]
    return UnknownStructure(signal, port.variables, _shape(found), tuple(terms))


def _shape(found: Found) -> str:
    """The curve in words: where it is largest and how it runs between its ends."""
    port = found.port
    if not port.knots:
        names = sorted(found.values, key=lambda n: -abs(found.values[n]))[:3]
        told = ", ".join(f"{n.rsplit('.', 1)[1]} {found.values[n]:.3g} {port.unit}" for n in names)
        return f"{port.effect.words}: led by {told}"
    curve = {port.knots[int(n.rsplit(".k", 1)[1])]: v for n, v in found.values.items()}
    knots = np.array(sorted(curve))
    values = np.array([curve[k] for k in knots])
    span = float(np.ptp(values))
    odd = values + values[::-1] if knots.size % 2 == 0 else values
    even = values - values[::-1] if knots.size % 2 == 0 else values
    kind = "neither odd nor even"
    if np.abs(odd).max() < 0.2 * span:
        kind = "odd"
    elif np.abs(even).max() < 0.2 * span:
        kind = "even"
    top = float(knots[int(np.argmax(np.abs(values)))])
    edge = abs(top) < (1.0 - _NEAR) * float(np.abs(knots).max())
    bend = "with its largest value inside the range" if edge else "largest at the end of the range"
    return (
        f"{port.effect.words}, {kind}, {bend}: {np.abs(values).max():.3g} {port.unit} at "
        f"{port.variables[0]} = {top:.4g}"
    )
