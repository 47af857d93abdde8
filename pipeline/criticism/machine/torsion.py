"""The twist of a shaft in two parts against the torque it passes, from whole captures.

Over a few hundredths of a second in which the load that nobody records, and errors of the drags,
are a constant c, a shaft whose far part f of J is free obeys

    load recorded:        θ = ∬(T − drags − T_load)/J + f·twist(S) + a + b t + c t²
    coupling recorded:    θ = ∬S/(f J)                +   twist(S) + a + b t + c t²

whatever happens in between: momentum does not care for impacts. Where the shaft passes torque on,
twist(S) is S/k of a spring, and half the gap more to the side that S presses to, if there is one.
So the angle is linear in 1/J, 1/k and the gap [1], without a model of flights and bounces.

Noise of the angle, and of the torque twice integrated, is whitened [2]. Noise in the columns would
pass for a softness, and is taken out of the normal matrix [3]. A window that misses the equation by
far, as one in which an unrecorded load jumps, hardly counts [4]. Uncertainties are from the scatter
of windows [5].

References: [1] Nordin & Gutman, Automatica 38 (2002), dead zones; [2] Aitken, Proc. R. Soc.
Edinb. 55 (1936), least squares; [3] Fuller, Measurement Error Models (1987), ch. 3;
[4] Geman & McClure, Bull. Int. Stat. Inst. 52 (1987), weights that redescend; [5] Liang & Zeger,
Biometrika 73 (1986), clusters.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.policy.machine import Torsion


@dataclass(frozen=True, slots=True)
class Shaft:
    """One capture of a shaft whose far end is free.

    Attributes
    ----------
    ts_s
        Sample period.
    theta_rad
        Angle of the motor [n].
    through_nm
        Torque that, less `near_kgm2` times the acceleration, the coupling passes on [n].
    momentum_nm
        Torque that turns `inertia_kgm2` [n].
    near_kgm2, inertia_kgm2
        Inertias; the latter is known to a few per cent.
    u_theta_rad, u_through_nm, u_momentum_nm
        Standard deviations of a sample's noise; that of `through_nm` is in `momentum_nm` as well.
    valid
        Good samples [n].

    """

    ts_s: float
    theta_rad: Array
    through_nm: Array
    momentum_nm: Array
    near_kgm2: float
    inertia_kgm2: float
    u_theta_rad: float
    u_through_nm: float
    u_momentum_nm: float
    valid: Flags


@dataclass(frozen=True, slots=True)
class Law:
    """Stiffness and gap of a coupling; times the far share f where the load was recorded.

    Attributes
    ----------
    softness, u_softness
        1/k and its standard uncertainty [rad/(N·m)].
    gap_rad, u_gap_rad
        Gap and its standard uncertainty.
    torque_nm
        Rms torque that it passes in the `windows`.
    windows
        Windows in which the torque presses to both sides.
    mobility, u_mobility
        1/J of what turns under `momentum_nm` and its standard uncertainty [1/(kg·m²)].
    products
        Of the whitened columns of 1/J, 1/k and half the gap, and of the angle, with each other,
        summed over the windows [4, 4].

    """

    softness: float
    u_softness: float
    gap_rad: float
    u_gap_rad: float
    torque_nm: float
    windows: int
    mobility: float
    u_mobility: float
    products: Array

    def chi2(self, softness: float, gap_rad: float) -> float:
        """χ² of the windows with another softness and gap, damping and all else in it.

        Parameters
        ----------
        softness
            [rad/(N·m)].
        gap_rad
            Gap [rad].

        """
        residual = np.array([-self.mobility, -softness, -0.5 * gap_rad, 1.0])
        return float(residual @ self.products @ residual)


@dataclass(frozen=True, slots=True)
class _Window:
    """Whitened `columns` [m, 3] of 1/J, 1/k and half the gap, and `angle` [m], all less a parabola.

    `noise` [3, 4] is what noise adds on average to the columns' products with columns and angle;
    `power` the mean square torque [(N·m)²]; `turns`: the torque presses to both sides.
    """

    columns: Array
    angle: Array
    noise: Array
    power: float
    turns: bool


def law_of_twist(shafts: Iterable[Shaft], policy: Torsion) -> Law | None:
    """Softness and gap of a coupling that explain the angle best.

    Parameters
    ----------
    shafts
        Whole captures of one shaft.
    policy
        Constants of judgement.

    Returns
    -------
    Law or None
        None where no torque changes its sign.

    """
    windows: list[_Window] = []
    inertia = 0.0
    for shaft in shafts:
        inertia = shaft.inertia_kgm2
        windows += _windows(shaft, policy)
    turning = [one.power for one in windows if one.turns]
    if not turning:
        return None
    coefficients, spread = _fitted(windows, inertia, policy)
    return Law(
        float(coefficients[1]),
        math.sqrt(spread[1, 1]),
        2.0 * float(coefficients[2]),
        2.0 * math.sqrt(spread[2, 2]),
        math.sqrt(float(np.mean(turning))),
        len(turning),
        float(coefficients[0]),
        math.sqrt(spread[0, 0]),
        sum((_products(one) for one in windows if one.turns), np.zeros((4, 4))),
    )


def _products(window: _Window) -> Array:
    """Of the columns and the angle of a window with each other [4, 4]."""
    both = np.column_stack([window.columns, window.angle])
    return both.T @ both


def _windows(shaft: Shaft, policy: Torsion) -> Iterable[_Window]:
    """Every window, half overlapping, in which the torque moves enough to show the twist."""
    block, theta, through, turned, least = _smoothed(shaft, policy)
    size = max(round(policy.window_s / (block * shaft.ts_s)), policy.window_blocks)
    closed = _closed(through, least)
    valid = np.asarray(sliding_window_view(shaft.valid, 3 * block).all(axis=1))
    closed &= valid[::block][: closed.size]
    noise = _Noise.of(shaft, block, size)
    moves = max(policy.torque_range * least, policy.torque_moves * float(np.std(through)))
    for first in range(0, theta.size - size + 1, size // 2):
        rows = np.flatnonzero(closed[first : first + size])
        pressed = through[first : first + size][rows]
        if pressed.size < policy.closed_blocks or np.ptp(pressed) < moves:
            continue
        side = np.sign(pressed)
        angles = [x[first : first + size][rows] - x[first] for x in (turned, theta)]
        parabola = np.vander(rows / size - 0.5, 3)
        complement = np.linalg.qr(parabola, mode="complete")[0][:, 3:]
        lower = np.linalg.cholesky(complement.T @ noise.error[np.ix_(rows, rows)] @ complement)
        whiten = np.linalg.solve(lower, complement.T)
        white = whiten @ np.column_stack([angles[0], pressed, side, angles[1]])
        yield _Window(
            white[:, :3],
            white[:, 3],
            noise.products(whiten.T @ whiten, rows),
            float(np.mean(pressed**2)),
            bool(np.ptp(side) > 0),
        )


def _smoothed(shaft: Shaft, policy: Torsion) -> tuple[int, Array, Array, Array, float]:
    """Samples a block; angle, torque passed on and momentum twice integrated, a block apart [n];
    and the size from which on a torque is no noise.

    All three are smoothed by the same weights, those that block means have once they are
    differenced twice. So a ringing, however fast, is in each of them alike. The block is the
    shortest in which noise is small against the torque, since what a gap does is short.
    """
    travel = np.cumsum(np.cumsum(shaft.momentum_nm) - 0.5 * shaft.momentum_nm) * shaft.ts_s**2
    for length in policy.blocks_s:
        block = max(round(length / shaft.ts_s), 1)
        period = block * shaft.ts_s
        box, kernel = _kernel(block)
        theta, through, turned = (
            np.convolve(x, kernel, mode="valid")[1::block]
            for x in (shaft.theta_rad, shaft.through_nm, travel)
        )
        # the middle of three blocks is a sample after that of their weights
        means = np.convolve(shaft.theta_rad, box, mode="valid")[::block]
        bend = np.diff(means, 2)[: theta.size] / period**2
        through = through[: bend.size] - shaft.near_kgm2 * bend
        bent = shaft.near_kgm2 * shaft.u_theta_rad * math.sqrt(6.0 / block) / period**2
        noise = math.hypot(bent, shaft.u_through_nm * float(np.linalg.norm(kernel)))
        least = policy.torque_u * noise
        if least < policy.noise_share * float(np.std(through)):
            break
    return block, theta[: bend.size], through, turned[: bend.size], least


def _kernel(block: int) -> tuple[Array, Array]:
    """Weights of a mean over a block, and of one whose second difference is a mean of θ″."""
    box = np.full(block, 1.0 / block)
    return box, np.convolve(np.convolve(box, box), box)


def _closed(through: Array, least: float) -> Flags:
    """Blocks [n] that pass torque on, as do those beside them, to the same side."""
    side = np.where(np.abs(through) > least, np.sign(through), 0.0)
    return np.abs(sliding_window_view(np.pad(side, 1), 3).sum(axis=1)) == 3.0


@dataclass(frozen=True, slots=True)
class _Noise:
    """Covariances [size, size] of what noise does in a window: of the equation's `error`, and
    of momentum, torque passed on and angle.
    """

    error: Array
    momentum: Array
    momentum_torque: Array
    torque: Array
    torque_angle: Array

    @classmethod
    def of(cls, shaft: Shaft, block: int, size: int) -> _Noise:
        """White noise of the samples through the weights of `_smoothed`."""
        box, kernel = _kernel(block)
        bend = np.convolve(np.convolve(box, box), box)
        bend = np.convolve(bend, [1.0, -2.0, 1.0]) / shaft.ts_s**2
        samples = (size + 2) * block
        angle, torque = np.zeros((2, size, samples))
        for place in range(size):
            first = place * block
            angle[place, first + 1 : first + 1 + kernel.size] = kernel
            torque[place, first : first + bend.size] = -shaft.near_kgm2 * bend
        lag = np.subtract.outer(np.arange(samples), np.arange(samples))
        turned = shaft.ts_s**2 * angle @ np.maximum(lag, 0)
        u_theta, u_through, u_momentum = (
            u**2 for u in (shaft.u_theta_rad, shaft.u_through_nm, shaft.u_momentum_nm)
        )
        momentum = u_momentum * turned @ turned.T
        of_angle = u_theta * angle @ angle.T
        return cls(
            of_angle + momentum / shaft.inertia_kgm2**2,
            momentum,
            u_through * turned @ angle.T,
            u_through * angle @ angle.T + u_theta * torque @ torque.T,
            u_theta * torque @ angle.T,
        )

    def products(self, inverse: Array, rows: Indices) -> Array:
        """What noise adds to the whitened columns' products with columns and angle [3, 4]."""
        among = np.ix_(rows, rows)
        added = np.zeros((3, 4))
        added[0, 0] = np.sum(inverse * self.momentum[among])
        added[0, 1] = added[1, 0] = np.sum(inverse * self.momentum_torque[among])
        added[1, 1] = np.sum(inverse * self.torque[among])
        added[1, 3] = np.sum(inverse * self.torque_angle[among])
        return added


def _fitted(windows: Sequence[_Window], inertia: float, policy: Torsion) -> tuple[Array, Array]:
    """Coefficients [3] of the columns, and their covariance [3, 3].

    Noise is little beside what the coupling's damping does, for which there is no column. So a
    window counts in full up to the lower quartile of χ²/n of those in which the torque turns.
    Weights that redescend have more than one end: the fit begins with each of a few gaps, and the
    end stays that leaves most windows near their noise.
    """
    normal = np.array([one.columns.T @ one.columns for one in windows])
    size = np.sqrt(np.einsum("ijj->j", normal))
    normal /= np.outer(size, size)
    slope = np.array([one.columns.T @ one.angle for one in windows]) / size
    turns = np.array([one.turns for one in windows])
    power = np.array([one.angle @ one.angle for one in windows])
    count = np.array([one.angle.size for one in windows])
    noise = np.array([one.noise for one in windows])
    clean = normal - noise[:, :, :3] / np.outer(size, size)
    slope_free_of_noise = slope - noise[:, :, 3] / size
    ends = []
    for gap in policy.starts_rad:
        coefficients = size * np.array([1.0 / inertia, 0.0, 0.5 * gap])
        for _ in range(policy.rounds):
            spreads = _spreads(normal, slope, power, count, coefficients)
            usual = float(np.clip(np.quantile(spreads[turns], policy.usual), 1.0, policy.odd))
            weight = np.maximum(spreads / usual, 1.0) ** -2.0
            inverse = np.linalg.pinv(np.einsum("i,ijk->jk", weight, clean), hermitian=True)
            before, coefficients = coefficients, inverse @ (weight @ slope_free_of_noise)
            if np.abs(coefficients - before).max() < policy.settled * np.abs(coefficients).max():
                break
        spreads = np.maximum(_spreads(normal, slope, power, count, coefficients), 1.0)
        score = weight[:, None] * (slope_free_of_noise - clean @ coefficients)
        # windows overlap by half: two of them count as one
        spread = 2.0 * inverse @ (score.T @ score) @ inverse / np.outer(size, size)
        ends.append((float((count * np.log(spreads)).sum()), coefficients / size, spread))
    _, best, covariance = min(ends, key=lambda end: end[0])
    return best, covariance


def _spreads(normal: Array, slope: Array, power: Array, count: Array, coefficients: Array) -> Array:
    """χ²/n [W] of every window."""
    explained = 2.0 * slope @ coefficients - np.einsum(
        "ijk,j,k->i", normal, coefficients, coefficients
    )
    return np.maximum(power - explained, 0.0) / count
