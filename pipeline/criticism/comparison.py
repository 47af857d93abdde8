"""Compare: one model fitted to a motor's captures, its errors held out, and where they live."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import betainc

from pipeline.criticism.effect import Array
from pipeline.criticism.judge import HeldOut, leave_out
from pipeline.criticism.model import BASE, PHYSICAL, Model
from pipeline.criticism.segments import Segment, segments
from pipeline.criticism.size import machine_of
from pipeline.criticism.specification import model_of
from pipeline.criticism.system import Fitted, System, first_fit, own_columns
from pipeline.records.capture import Campaign
from pipeline.records.comparison import (
    Comparison,
    Dependence,
    ModelParameter,
    ModelSpec,
    SignalError,
)
from pipeline.records.constants import Constants

_BINS = 12


def compare(campaign: Campaign, model: ModelSpec, start: Constants) -> Comparison:
    """Fits a model's parameters to all captures and tells its errors, capture by capture.

    An error marked `held_out` is of a capture predicted from all the others; `fit` marks a
    capture that alone carries a constant.
    """
    machine = machine_of(campaign, start)
    found = segments(campaign, machine)
    asked = model_of(model, machine)
    names = tuple(effect.name for effect in asked.effects)
    if not found:
        note = "no capture holds what an equation needs: record a torque map"
        return Comparison(campaign.motor_id, model.name, names, {}, (), 0.0, (), (note,))
    fitted, around = first_fit(found, asked)
    held = leave_out(around, len(own_columns(asked)))
    return Comparison(
        campaign.motor_id,
        model.name,
        names,
        _parameters(fitted, around, asked),
        tuple(_errors(found, around, held)),
        held.total if math.isfinite(held.total) else 0.0,
        tuple(_where(found, around, held)),
    )


def _parameters(fitted: Fitted, around: System, model: Model) -> dict[str, ModelParameter]:
    own = np.arange(len(own_columns(model)))
    spread = np.sqrt(np.maximum(np.diag(around.covariance(own)), 0.0))
    u = {around.columns[n].name: float(spread[n]) for n in own}
    told = {
        c.name: ModelParameter(fitted.values[c.name], u[c.name], c.unit)
        for c in BASE
        if c.name in PHYSICAL
    }
    for name, (_, p) in model.parameters().items():
        scale, value = model.machine.scale(p), fitted.values[name]
        edge = 1e-9 * max(abs(p.typical), 1e-30) * scale
        bound = min(abs(value - p.low * scale), abs(value - p.high * scale)) <= edge
        bound = bound and not p.choice
        told[name] = ModelParameter(value, u.get(name, 0.0), p.unit, bound)
    return told


def _errors(found: Sequence[Segment], around: System, held: HeldOut) -> Iterator[SignalError]:
    """Errors of every capture's signals in plain windows; half-overlapping windows count half."""
    for place, (number, channel, order) in enumerate(around.labels):
        mine = around.group == place
        if order != 0 or not mine.any():
            continue
        out = bool(np.isfinite(held.residual[mine]).all())
        residual = held.residual[mine] if out else around.residual[mine]
        unit = around.unit[mine]
        n = int(mine.sum())
        yield SignalError(
            channel,
            found[number].capture,
            "held_out" if out else "fit",
            math.sqrt(float(((residual * unit) ** 2).mean())),
            math.sqrt(float((unit**2).mean())),
            n,
            _effective(residual),
        )


def _effective(residual: Array) -> float:
    """Independent samples in autocorrelated ones: n (1 − r)/(1 + r) with lag-one r ≥ 0."""
    n = residual.size
    if n < 4:
        return float(n)
    centred = residual - residual.mean()
    power = float(centred @ centred)
    r = float(centred[1:] @ centred[:-1]) / power if power > 0 else 0.0
    return n * (1.0 - max(r, 0.0)) / (1.0 + max(r, 0.0))


def _where(found: Sequence[Segment], around: System, held: HeldOut) -> Iterator[Dependence]:
    """For every signal: which variable's binned curve explains its error's variance."""
    residual = np.where(np.isfinite(held.residual), held.residual, around.residual)
    pooled: dict[tuple[str, str], list[tuple[Array, Array, float]]] = {}
    for place, (number, channel, order) in enumerate(around.labels):
        mine = around.group == place
        segment = found[number]
        if order != 0 or segment.weak is None or mine.sum() < 8:
            continue
        values = _variables(segment)
        at = around.window[mine]
        for name, means in values.items():
            scaled = residual[mine] * around.unit[mine]
            pooled.setdefault((channel, name), []).append(
                (means[at], scaled, _effective(residual[mine]) / at.size)
            )
    for (channel, name), parts in sorted(pooled.items()):
        value = np.concatenate([p[0] for p in parts])
        error = np.concatenate([p[1] for p in parts])
        share = min(p[2] for p in parts)
        told = _binned(value, error, share)
        if told is not None:
            yield Dependence(channel, name, *told)


def _variables(segment: Segment) -> dict[str, Array]:
    """Window means [W] of what an error may depend on; angles within a turn, at mid-window."""
    weak = segment.weak
    if weak is None:
        return {}
    signals = dict(segment.recorded)
    values = {}
    theta = signals.get("theta_mech_rad")
    if theta is not None and np.ptp(theta) > 0:
        middle = theta[weak.starts + weak.length // 2]
        values["theta_mech_rad"] = np.mod(middle, 2 * np.pi)
        speed = (theta[weak.starts + weak.length - 1] - theta[weak.starts]) / (
            (weak.length - 1) * segment.ts_s
        )
        values["omega_mech_rad_s"] = speed
    for name in ("id_a", "iq_a", "i_pair_a", "temp_winding_degc", "temp_magnet_degc"):
        if name in signals:
            values[name] = weak.means(signals[name][None])[0]
    values["t_s"] = weak.starts * segment.ts_s
    return values


def _binned(value: Array, error: Array, share: float) -> tuple[float, float] | None:
    """Share of variance between quantile bins, and its F test with effective samples."""
    edges = np.unique(np.quantile(value, np.linspace(0, 1, _BINS + 1)[1:-1]))
    place = np.searchsorted(edges, value)
    bins = int(place.max()) + 1
    total = float(((error - error.mean()) ** 2).sum())
    n_eff = share * error.size
    if bins < 2 or total <= 0 or n_eff <= bins + 1:
        return None
    count = np.bincount(place, minlength=bins)
    means = np.bincount(place, error, minlength=bins) / np.maximum(count, 1)
    between = float((count * (means - error.mean()) ** 2).sum())
    explained = min(between / total, 1.0)
    low, high = bins - 1.0, n_eff - bins
    # P(F > f) as an incomplete beta function of the share left
    return explained, float(betainc(high / 2, low / 2, max(1.0 - explained, 0.0)))
