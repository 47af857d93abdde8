"""The twist of a shaft in two parts against the torque it passes, from whole captures.

Over a few hundredths of a second in which the load that nobody records, and errors of the drags,
are a constant c, a shaft whose far part f of J is free obeys

    load recorded:        θ = ∬(T − drags − T_load)/J + f·twist(S) + a + b t + c t²
    coupling recorded:    θ = ∬S/(f J)                +   twist(S) + a + b t + c t²

whatever happens in between: momentum does not care for impacts. Where the shaft passes torque on,
twist(S) is S/k of a spring, and half the gap more to the side that S presses to, if there is one.
So the angle is linear in 1/J, 1/k and the gap [1], without a model of flights and bounces.

Noise of the angle, and of the torque twice integrated, is whitened [2]. A window that misses it by
χ²/n = q > 1, as one in which the load jumps, counts 1/q², so that it hardly counts [3];
uncertainties are from the scatter of windows [4].

References: [1] Nordin & Gutman, Automatica 38 (2002), dead zones; [2] Aitken, Proc. R. Soc.
Edinb. 55 (1936), least squares; [3] Geman & McClure, Bull. Int. Stat. Inst. 52 (1987), weights
that redescend; [4] Liang & Zeger, Biometrika 73 (1986), clusters.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from pipeline.criticism.effect import Array

_BLOCKS_S = (0.5e-3, 1e-3, 2e-3, 4e-3)
_WINDOW_S = 0.03
_SHORTEST = 12
_SURE = 5.0
_FINE = 0.08
_RANGE = 10.0
_LEAST = 8
_FREE_RAD = 1.0
_STARTS_RAD = (0.0, 3e-4, 1e-3, 3e-3, 1e-2)
_ROUNDS = 40
_SETTLED = 1e-3


@dataclass(frozen=True, slots=True)
class Shaft:
    """One capture of a shaft whose far end is free: angle [rad] and torques [N·m], all [n].

    `through_nm` less `near_kgm2` θ″ is what the coupling passes on; `momentum_nm` is what turns
    `inertia_kgm2` (known to a few per cent). `kept` [n] are good samples, `u_*` the standard
    deviations of a sample's noise.
    """

    ts_s: float
    theta_rad: Array
    through_nm: Array
    momentum_nm: Array
    near_kgm2: float
    inertia_kgm2: float
    u_theta_rad: float
    u_torque_nm: float
    kept: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Law:
    """Softness 1/k [rad/(N·m)] and gap [rad] of a coupling, with standard uncertainties; times
    the far share f where the load was recorded. `torque_nm` is the root mean square that it passes
    in the `windows` in which the torque presses to both sides.
    """

    softness: float
    u_softness: float
    gap_rad: float
    u_gap_rad: float
    torque_nm: float
    windows: int


@dataclass(frozen=True, slots=True)
class _Window:
    """Whitened columns [m, 3] of 1/J, 1/k and half the gap, and angle [m]; mean square torque
    [(N·m)²], and whether it presses to both sides.
    """

    columns: Array
    angle: Array
    power: float
    turns: bool


def law_of_twist(shafts: Iterable[Shaft]) -> Law | None:
    """Softness and gap that explain the angle best; None where no torque changes its sign."""
    told: list[_Window] = []
    inertia = 0.0
    for shaft in shafts:
        inertia = shaft.inertia_kgm2
        told += _windows(shaft)
    turning = [one.power for one in told if one.turns]
    if not turning:
        return None
    found, spread = _fitted(told, inertia)
    return Law(
        float(found[1]),
        math.sqrt(spread[1, 1]),
        2.0 * float(found[2]),
        2.0 * math.sqrt(spread[2, 2]),
        math.sqrt(float(np.mean(turning))),
        len(turning),
    )


def _windows(shaft: Shaft) -> Iterable[_Window]:
    """Every window, half overlapping, in which the torque moves enough to tell of the twist."""
    block, theta, through, turned, least = _smoothed(shaft)
    size = max(round(_WINDOW_S / (block * shaft.ts_s)), _SHORTEST)
    closed = _closed(through, least)
    closed &= sliding_window_view(shaft.kept, 3 * block - 2).all(axis=1)[::block][: closed.size]
    noise = _noise(shaft, block, size)
    for first in range(0, theta.size - size + 1, size // 2):
        here = closed[first : first + size]
        pressed = through[first : first + size][here]
        if pressed.size < _LEAST or np.ptp(pressed) < _RANGE * least:
            continue
        side = np.sign(pressed)
        own = [x[first : first + size][here] - x[first] for x in (turned, theta)]
        lower = np.linalg.cholesky(noise[np.ix_(here, here)])
        white = np.linalg.solve(lower, np.column_stack([own[0], pressed, side, own[1]]))
        yield _Window(
            white[:, :3], white[:, 3], float(np.mean(pressed**2)), bool(np.ptp(side) > 0)
        )


def _smoothed(shaft: Shaft) -> tuple[int, Array, Array, Array, float]:
    """Samples a block; angle, torque passed on and momentum twice integrated, a block apart [n];
    and the torque that is sure to be one.

    All are under the weights that means over a block have once they are differenced twice: a
    ringing, however fast, is in each of them alike. The shortest block serves in which noise is
    small against the torque, since what a gap does is short.
    """
    whole = np.cumsum(np.cumsum(shaft.momentum_nm) - 0.5 * shaft.momentum_nm) * shaft.ts_s**2
    for length in _BLOCKS_S:
        block = max(round(length / shaft.ts_s), 1)
        period = block * shaft.ts_s
        box, kernel = _kernel(block)
        theta, through, turned = (
            np.convolve(x, kernel, mode="valid")[::block]
            for x in (shaft.theta_rad, shaft.through_nm, whole)
        )
        means = np.convolve(shaft.theta_rad, box, mode="valid")[::block]
        bend = np.diff(means, 2)[: theta.size] / period**2
        through = through[: bend.size] - shaft.near_kgm2 * bend
        bent = shaft.near_kgm2 * shaft.u_theta_rad * math.sqrt(6.0 / block) / period**2
        least = _SURE * math.hypot(bent, shaft.u_torque_nm * float(np.linalg.norm(kernel)))
        if least < _FINE * float(np.std(through)):
            break
    return block, theta[: bend.size], through, turned[: bend.size], least


def _kernel(block: int) -> tuple[Array, Array]:
    """Weights of a mean over a block, and of one whose second difference is a mean of θ″."""
    box = np.full(block, 1.0 / block)
    return box, np.convolve(np.convolve(box, box), box)


def _closed(through: Array, least: float) -> NDArray[np.bool_]:
    """Blocks [n] that pass torque on, as do those beside them, to the same side."""
    side = np.where(np.abs(through) > least, np.sign(through), 0.0)
    closed: NDArray[np.bool_] = np.abs(sliding_window_view(np.pad(side, 1), 3).sum(axis=1)) == 3.0
    return closed


def _noise(shaft: Shaft, block: int, size: int) -> Array:
    """Covariance [size, size] of a window's angle: its sensor's noise, the torque's twice
    integrated, and any parabola.
    """
    _, kernel = _kernel(block)
    near = np.correlate(kernel, kernel, mode="full")[kernel.size - 1 :: block]
    ahead = np.subtract.outer(np.arange(size), np.arange(size))
    apart = np.minimum(np.abs(ahead), near.size)
    angle = shaft.u_theta_rad**2 * np.append(near, 0.0)[apart]
    twice = (block * shaft.ts_s) ** 2 * np.maximum(ahead, 0)
    torque = (shaft.u_torque_nm / shaft.inertia_kgm2) ** 2 / block * twice @ twice.T
    free = np.vander(np.arange(size) / size - 0.5, 3)
    covariance: Array = angle + torque + _FREE_RAD**2 * free @ free.T
    return covariance


def _fitted(told: Sequence[_Window], inertia: float) -> tuple[Array, Array]:
    """Coefficients [3] of the columns, and their covariance [3, 3].

    Weights that redescend have more than one end: a few gaps are begun with, and the end stays
    that leaves most windows near their noise.
    """
    normal = np.array([one.columns.T @ one.columns for one in told])
    size = np.sqrt(np.einsum("ijj->j", normal))
    normal /= np.outer(size, size)
    slope = np.array([one.columns.T @ one.angle for one in told]) / size
    power = np.array([one.angle @ one.angle for one in told])
    count = np.array([one.angle.size for one in told])
    ends = []
    for gap in _STARTS_RAD:
        found = size * np.array([1.0 / inertia, 0.0, 0.5 * gap])
        for _ in range(_ROUNDS):
            weight = np.maximum(_spreads(normal, slope, power, count, found), 1.0) ** -2.0
            inverse = np.linalg.pinv(np.einsum("i,ijk->jk", weight, normal), hermitian=True)
            before, found = found, inverse @ (weight @ slope)
            if np.abs(found - before).max() < _SETTLED * np.abs(found).max():
                break
        spreads = np.maximum(_spreads(normal, slope, power, count, found), 1.0)
        score = weight[:, None] * (slope - normal @ found)
        # windows overlap by half: two of them tell as much as one
        spread = 2.0 * inverse @ (score.T @ score) @ inverse / np.outer(size, size)
        ends.append((float((count * (1.0 - 1.0 / spreads)).sum()), found / size, spread))
    _, best, covariance = min(ends, key=lambda end: end[0])
    return best, covariance


def _spreads(normal: Array, slope: Array, power: Array, count: Array, found: Array) -> Array:
    """χ²/n [W] of every window."""
    explained = 2.0 * slope @ found - np.einsum("ijk,j,k->i", normal, found, found)
    spreads: Array = np.maximum(power - explained, 0.0) / count
    return spreads
