"""Stretches of steady speed in a spin, found by the phase of its voltage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.spin import Complex, Spin
from pipeline.estimation.policy import policy
from pipeline.numerics.harmonics import hermite, whole_cycles
from pipeline.numerics.plateaus import true_runs, white_noise_sigma
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Flags

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows of one steady speed, with the phase of the voltage itself.

    Attributes
    ----------
    rows
        Indices [m] into the arrays of the spin.
    phase_rad
        Smoothed electrical phase of the voltage vector [m, rad].
    omega_elec_rad_s
        Its rate [m, rad/s].

    """

    rows: NDArray[np.intp]
    phase_rad: Array
    omega_elec_rad_s: Array

    @property
    def speed_rad_s(self) -> float:
        """Mean electrical speed, signed by the sense of a to b to c."""
        return float(self.omega_elec_rad_s.mean())

    @property
    def trend(self) -> float:
        """Relative change of the speed from the first to the last quarter."""
        quarter = max(self.rows.size // 4, 1)
        ends = self.omega_elec_rad_s[-quarter:].mean() - self.omega_elec_rad_s[:quarter].mean()
        return abs(float(ends) / self.speed_rad_s)

    @property
    def change(self) -> float:
        """Relative change from the lowest to the highest speed."""
        return abs(float(np.ptp(self.omega_elec_rad_s)) / self.speed_rad_s)


def steady_stretches(spin: Spin, change: float) -> list[Stretch]:
    """Stretches of at least three cycles in which the speed stays within `change`, relative.

    Where they hold less than a fifth of the spinning rows, the speed is taken as it comes and
    `change` is widened; ramps are left out where steady speeds are there.

    Parameters
    ----------
    spin
        The voltages of one capture.
    change
        Largest change of the speed within a stretch [1, relative].

    Returns
    -------
    list of Stretch
        Rows with the voltage's own phase [rad] and its rate [rad/s].

    """
    for allowed in (change, policy().back_emf.widened * change, math.inf):
        stretches, spinning = _stretches(spin, allowed)
        if sum(s.rows.size for s in stretches) >= policy().back_emf.least_share * spinning:
            break
    steady = [s for s in stretches if s.trend <= 0.5 * change]
    return steady or stretches


def _stretches(spin: Spin, change: float) -> tuple[list[Stretch], int]:
    """The stretches and the number of spinning rows.

    The phase of the space vector is averaged over whole cycles, which removes harmonics and
    offsets, and joined by a smooth curve whose slope is the speed.
    """
    vector = spin.vector_v()
    size = np.abs(vector)
    sigma = math.hypot(white_noise_sigma(vector.real), white_noise_sigma(vector.imag))
    least, share = policy().back_emf.standing_sigmas * sigma, policy().back_emf.standing_share
    moving = size > max(least, share * float(np.quantile(size, 0.99)))
    stretches: list[Stretch] = []
    for start, stop in _unbroken(spin.t_s, vector, moving):
        unwrapped = np.unwrap(np.angle(vector[start:stop]))
        for first, last in _one_way(unwrapped):
            rows = np.arange(start + first, start + last)
            smooth = _smooth_phase(spin.t_s[rows], unwrapped[first:last])
            if smooth is not None:
                stretches += _split(rows, *smooth, change)
    return stretches, int(np.count_nonzero(moving))


def _unbroken(t_s: Array, vector: Complex, moving: Flags) -> Iterator[tuple[int, int]]:
    """Runs of moving rows, split where rows are missing for more than half a cycle.

    Across such a gap the phase cannot be unwrapped. Half a cycle is seen by nine tenths of the
    advances from row to row.
    """
    consecutive = np.flatnonzero(moving[1:] & moving[:-1])
    if not consecutive.size:
        return
    advance = np.abs(np.angle(vector[consecutive + 1] * np.conj(vector[consecutive])))
    usual_s, after_s = float(np.median(np.diff(t_s)[consecutive])), np.diff(t_s)
    missed = float(np.quantile(advance, 0.9)) * after_s > math.pi * usual_s
    gaps = (
        np.flatnonzero(missed & (after_s > 1.5 * usual_s)) + 1 if usual_s > 0.0 else consecutive[:0]
    )
    for start, stop in true_runs(moving):
        inner = gaps[(gaps > start) & (gaps < stop)]
        edges = [start, *(int(k) for k in inner), stop]
        yield from pairwise(edges)


def _one_way(phase: Array) -> list[tuple[int, int]]:
    """Rows start..stop that split a phase [n] wherever it turns back by a cycle or more."""
    open_pieces, pieces = [(0, phase.size)], []
    while open_pieces:
        start, stop = open_pieces.pop()
        forward = phase[start:stop] * (1.0 if phase[stop - 1] >= phase[start] else -1.0)
        back = np.maximum.accumulate(forward) - forward
        low = int(np.argmax(back))
        if back[low] < TURN_RAD:
            pieces.append((start, stop))
            continue
        high = int(np.argmax(forward[: low + 1]))
        edges = sorted({start, start + high, start + low, stop})
        open_pieces += pairwise(edges)
    return sorted(pieces)


def _smooth_phase(t_s: Array, phase: Array) -> tuple[Array, Array, Rows] | None:
    """Phase and its rate [n] from means over whole cycles, and the cycle's number of each row."""
    if phase.size < 12:
        return None
    cuts = whole_cycles(phase)
    cuts = cuts[np.concatenate([[True], np.diff(cuts) >= 4])]
    if cuts.size < policy().back_emf.least_cycles + 1:
        return None
    counts = np.diff(cuts)
    mid_t = np.add.reduceat(t_s, cuts[:-1])[: counts.size].copy()
    mid_p = np.add.reduceat(phase, cuts[:-1])[: counts.size].copy()
    last = slice(int(cuts[-2]), int(cuts[-1]))
    mid_t[-1], mid_p[-1] = t_s[last].sum(), phase[last].sum()
    value, slope = hermite(mid_t / counts, mid_p / counts, t_s)
    number = np.clip(np.searchsorted(cuts, np.arange(phase.size), side="right") - 1, -1, None)
    number[cuts[-1] :] = -1
    return value, slope, number


def _split(rows: Rows, phase: Array, omega: Array, number: Rows, change: float) -> list[Stretch]:
    """Cuts a run where the speed leaves a band of ± `change` around its level."""
    cycles = int(number.max()) + 1
    inside = number >= 0
    speeds = np.bincount(number[inside], omega[inside], cycles) / np.bincount(
        number[inside], minlength=cycles
    )
    pieces, start = [], 0
    for stop in range(1, cycles + 1):
        level = float(speeds[start:stop].mean())
        if stop == cycles or abs(float(speeds[stop]) - level) > change * abs(level):
            first, last = _steady_core(speeds, start, stop)
            if last - first >= policy().back_emf.least_cycles:
                keep = np.flatnonzero((number >= first) & (number < last))
                pieces.append(Stretch(rows[keep], phase[keep], omega[keep]))
            start = stop
    return pieces


def _steady_core(speeds: Array, start: int, stop: int) -> tuple[int, int]:
    """The cycles between the ramps' last traces at both ends, less one cycle at each.

    A trace of a ramp is a speed that stands out of the scatter of the stretch's middle.
    """
    quarter = (stop - start) // 4
    middle = speeds[start + quarter : stop - quarter]
    level = float(np.median(middle))
    limit = 5.0 * 1.4826 * float(np.median(np.abs(middle - level))) + 1e-6 * abs(level)
    if stop - start < 2 * policy().back_emf.least_cycles + 2:
        return start, stop
    while start < stop and abs(float(speeds[start]) - level) > limit:
        start += 1
    while stop > start and abs(float(speeds[stop - 1]) - level) > limit:
        stop -= 1
    return start + 1, stop - 1
