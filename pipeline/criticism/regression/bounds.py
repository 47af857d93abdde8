"""Steps of a fit that respect bounds: a parameter that leans on one is not in the step.

Reference: Nocedal & Wright, Numerical Optimization, 2nd ed. (2006), 16.5, active sets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.machine.model import LAG_SPEED, Model
from pipeline.criticism.operating import Array, Indices, Values
from pipeline.criticism.regression.columns import Column

_AT = 1e-9
"""Share of its own size by which a value that stands at a bound may miss it by rounding."""


def limits_of(model: Model) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of what has bounds.

    Parameters
    ----------
    model
        Machine and effects.

    Returns
    -------
    dict
        Bounds [unit of the name] by the parameter's name; infinite on a side without.

    Notes
    -----
    A resistance, inductance or flux below zero, or an inertia next to nothing, would stand for an
    effect that is not in the model. A loop with a lag below zero is not stable.

    """
    limits = dict.fromkeys(("r_ohm", "ld_h", "lq_h", LAG_SPEED), (0.0, np.inf))
    least, scales = model.policy.fit.least_constant, base_scales(model.machine)
    for name in ("j_kgm2", "psi_wb"):
        limits[name] = (least * scales[name], np.inf)
    for name, (_, p) in model.parameters().items():
        scale = model.machine.scale(p)
        limits[name] = (p.low * scale, p.high * scale)
    return limits


class Step(Protocol):
    """What a best step along some columns comes to."""

    @property
    def step(self) -> Array:
        """Change [k] of the parameters."""
        ...


Best = Callable[[Indices], Step]


def bounded_step(best: Best, columns: Sequence[Column], model: Model, values: Values) -> Array:
    """Best step along all columns that moves no parameter beyond a bound it stands at.

    Parameters
    ----------
    best
        Gives the best step along some of the columns, by their places.
    columns
        All columns [P].
    model, values
        Whose bounds and values count.

    Returns
    -------
    array [P]
        A parameter that would leave its bound is taken out, and the others step anew without it.

    References
    ----------
    Nocedal and Wright, Numerical Optimization, 2nd ed., Springer, 2006, 16.5 (active sets).

    """
    limits = limits_of(model)
    live = np.arange(len(columns))
    step = np.zeros(len(columns))
    while live.size:
        free_step = best(live).step
        out = [
            n
            for n, change in zip(live.tolist(), free_step.tolist(), strict=True)
            if _leaves(values[columns[n].name], change, limits.get(columns[n].name))
        ]
        if not out:
            step[live] = free_step
            break
        live = np.setdiff1d(live, out)
    return step


def _leaves(value: float, change: float, limits: tuple[float, float] | None) -> bool:
    if limits is None:
        return False
    low, high = limits
    margin = _AT * abs(value)
    return (change < 0.0 and value <= low + margin) or (change > 0.0 and value >= high - margin)
