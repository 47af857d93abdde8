"""Whether a column that was computed at one fit holds at another."""

from __future__ import annotations

from pipeline.criticism.machine.model import COAST_SHARES, CURVED, EARLY_S, EARLY_SHARES, Model
from pipeline.criticism.operating import Values
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.fit import Fit

_STEADY = ("psi_wb", "ld_h", "lq_h", "r_ohm")
"""Constants that every column goes with."""


def is_valid(column: Column, made_at: Values, fit: Fit) -> bool:
    """Whether a column is near what it would be at a fit.

    Parameters
    ----------
    column
        A parameter that the residual was differentiated by.
    made_at
        Parameters by full name, where it was computed.
    fit
        Where it would be used.

    Notes
    -----
    Every column goes with the constants; that of J with J, since a coasting shaft goes by 1/J. A
    coast's friction and its share are a product, and so are a friction that changes and the time
    constant by which it does. Columns of sensors and shapes go with other effects' parameters, by
    their typical sizes if these are larger.

    """
    model, now, far = fit.model, fit.values, fit.policy.fit.stale_share
    if any(abs(now[n] - made_at[n]) > far * abs(made_at[n]) for n in _STEADY):
        return False
    shares = [n for n in (*COAST_SHARES, *EARLY_SHARES) if n in now]
    if column.name in shares or any(abs(now[n] - made_at.get(n, 0.0)) > far for n in shares):
        return False
    early = any(one.get(n, 0.0) for one in (now, made_at) for n in EARLY_SHARES)
    early_s = made_at.get(EARLY_S, 0.0)
    if early and abs(now[EARLY_S] - early_s) > far * early_s:
        return False
    if column.name == "j_kgm2":
        return abs(now["j_kgm2"] / made_at["j_kgm2"] - 1.0) < far
    if _linear(column, model):
        return True
    parameters = model.parameters()
    out = any(value and "." in name and name not in parameters for name, value in made_at.items())
    return not out and all(
        abs(now[name] - made_at.get(name, 0.0))
        <= far * max(abs(now[name]), p.typical * model.machine.scale(p))
        for name, (_, p) in parameters.items()
    )


def _linear(column: Column, model: Model) -> bool:
    """Whether the residual is linear along a column, whatever the other parameters are."""
    effect = column.effect
    if effect is None:
        return not column.name.startswith(CURVED)
    if effect not in model.effects:
        return True
    shaped = any(not (p.amplitude or p.choice) for p in effect.parameters_of(model.machine))
    return effect.hook != "sensor" and not shaped
