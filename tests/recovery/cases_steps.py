"""Inductances from steps on a scope, with the Cramér-Rao bound of each seed's own noise.

What a bench does differently from day to day is drawn per seed: where between samples each edge
lies, how far the supply sags, the scope's bits, its noise, gains and offsets of clamp and probe,
and how far from its stated angle the rotor was locked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.estimation.estimators import current_step
from pipeline.simulator.bench import truth
from pipeline.simulator.design import Scope
from pipeline.simulator.protocols import CurrentStep
from tests.recovery.harness import Case, Trial, cramer_rao
from tests.recovery.simulated import BENCH, MOTOR, recorded

LEVELS = (-0.45, 0.45, 0.9)
SAMPLES_TAU = 50.0
ANGLES_DEG = {"ld_h": -30.0, "lq_h": 60.0}


def _step_trial(seed: int) -> Trial:
    rng = np.random.default_rng([seed, 20])
    scope = Scope(bits=int(rng.integers(8, 15)), noise_steps=float(rng.uniform(0.3, 1.2)))
    share = float(rng.uniform(0.0, 0.4))
    off_deg = 0.5 * rng.standard_normal(2)
    plan = [
        (f"step_{name}_{k}", "current_step", _protocol(angle, level, share, float(off)))
        for (name, angle), off in zip(ANGLES_DEG.items(), off_deg, strict=True)
        for k, level in enumerate(LEVELS)
    ]
    campaign, real = recorded(plan, seed, bench=replace(BENCH, scope=scope))
    true = truth(MOTOR)["constants"]
    gain = real.probe / real.clamp
    other = {"ld_h": "lq_h", "lq_h": "ld_h"}
    aside = dict(zip(ANGLES_DEG, np.sin(np.radians(off_deg)) ** 2, strict=True))
    seen = {n: gain * (true[n] + (true[other[n]] - true[n]) * aside[n]) for n in ANGLES_DEG}
    bound = {n: _axis_bound(true[n], scope, share, 1.0 / real.clamp) for n in ANGLES_DEG}
    return Trial(campaign, {n: true[n] for n in ANGLES_DEG}, seen, bound=bound)


def _protocol(angle_deg: float, level: float, share: float, off_deg: float) -> dict[str, Any]:
    return {
        "theta_elec_deg": angle_deg,
        "level": level,
        "samples_tau": SAMPLES_TAU,
        "source_share": share,
        "theta_off_deg": off_deg,
        "random_edges": True,
    }


def _axis_bound(l_phase_h: float, scope: Scope, share: float, gain: float) -> float:
    """One axis: the captures share L; all else is each one's own, so that their information adds.

    R, the supply's resistance and three open voltages, both edges and the current's offset. Noise
    is that of the scope and its rounding, q²/12, white.
    """
    how = CurrentStep()
    rate = SAMPLES_TAU / MOTOR.tau_elec_s
    before, on, off = (round(x * SAMPLES_TAU) for x in (how.before_tau, how.on_tau, how.off_tau))
    t = np.arange(before + on + off) / rate
    level_of = np.repeat([0, 1, 2], [before, on, off])
    r_ll = 2.0 * MOTOR.r_phase_ohm
    noise = math.sqrt(scope.noise_steps**2 + 1.0 / 12.0) * 2.0 ** (1 - scope.bits)

    def rise(start: float, tau: float) -> np.ndarray:
        return np.where(t > start, -np.expm1(-np.maximum(t - start, 0.0) / tau), 0.0)

    def mean(p: np.ndarray) -> np.ndarray:
        l_ll, r, source, rest, volts, after, start, stop, offset = p
        loop = r + source
        up, down = rise(start, l_ll / loop), rise(stop, l_ll / loop)
        current = (rest + (volts - rest) * up + (after - volts) * down) / loop
        voltage = np.array([rest, volts, after])[level_of] - source * current
        return np.concatenate([current + offset, voltage])

    information = 0.0
    for level in LEVELS:
        amps = level * MOTOR.current_rated_a
        volts = amps * r_ll * (1.0 + share)
        edges = (before - 0.5) / rate, (before + on - 0.5) / rate
        at = np.array([2.0 * l_phase_h, r_ll, r_ll * share, 0.0, volts, 0.0, *edges, 0.0])
        halves = [_half_range(abs(amps) / gain), _half_range(abs(volts))]
        sigma = np.repeat(noise * np.array(halves), t.size)
        information += 1.0 / cramer_rao(mean, at, sigma, step=1e-7)[0, 0]
    return 0.5 / math.sqrt(information)


def _half_range(largest: float) -> float:
    """The least of 1, 2, 5 times a power of ten that holds a tenth more than this."""
    decade = 10.0 ** math.floor(math.log10(1.1 * largest))
    return next(x * decade for x in (1.0, 2.0, 5.0, 10.0) if x * decade >= 1.1 * largest)


def _no_bound() -> Mapping[str, float]:
    return {}


CASES = (Case("current_step", current_step.ESTIMATOR, _step_trial, _no_bound, few=8),)
