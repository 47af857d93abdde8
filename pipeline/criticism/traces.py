"""Columns of a capture as even, smoothed, decimated or thinned signals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Array
from pipeline.numerics.projection import window_starts
from pipeline.records.capture import Capture

PAD = 24
_SENSE_S = 0.001


def even_clock(
    capture: Capture, names: tuple[str, ...]
) -> tuple[float, dict[str, Array], NDArray[np.bool_]]:
    """Sample period [s], columns [n each] on an even clock and the samples to keep [n].

    A clock that is even within a thousandth is taken as it is; another one is interpolated.
    Missing values are bridged and not kept; so are samples inside a gap of over 1.5 periods.
    """
    home = capture.table_of("t_s", *names)
    found = capture.arrays("t_s", *names, masked=False)
    keep = capture.kept(home).copy()
    time = found.pop("t_s")
    period = float(np.median(np.diff(time)))
    for name, column in found.items():
        good = np.isfinite(column)
        if not good.all() and good.any():
            found[name] = np.interp(time, time[good], column[good])
            keep &= good
    if np.abs(np.diff(time) - period).max() > 1e-3 * period:
        even = time[0] + period * np.arange(round((time[-1] - time[0]) / period) + 1)
        after = np.clip(np.searchsorted(time, even), 1, time.size - 1)
        near = (time[after] - time[after - 1] < 1.5 * period) & keep[after] & keep[after - 1]
        found = {name: np.interp(even, time, column) for name, column in found.items()}
        keep = near
    keep[:1] = keep[-1:] = False
    return period, found, keep


def smoothed(signal: Array, width: int) -> Array:
    """Centred moving mean [n] of an odd width, edges held."""
    half = min(width, signal.size) // 2
    if half == 0:
        return signal
    padded = np.concatenate(
        [np.full(half, signal[:half].mean()), signal, np.full(half, signal[-half:].mean())]
    )
    total = np.concatenate([[0.0], np.cumsum(padded)])
    mean: Array = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return mean


def decimated(signal: Array, factor: int) -> Array:
    """Means [n // factor] of consecutive samples."""
    n = signal.size // factor * factor
    mean: Array = signal[:n].reshape(-1, factor).mean(axis=1)
    return mean


def travel(theta: Array, period: float) -> Array:
    """Angle [n] turned since the last reversal, infinite before the first one [rad]."""
    width = max(2 * round(_SENSE_S / period) + 1, 5)
    sense = np.sign(smoothed(np.gradient(theta), width))
    turned = np.flatnonzero(sense[1:] * sense[:-1] < 0) + 1
    if turned.size == 0:
        return np.full(theta.size, np.inf)
    last = np.searchsorted(turned, np.arange(theta.size), side="right") - 1
    since: Array = np.abs(theta - theta[turned[np.maximum(last, 0)]])
    since[last < 0] = np.inf
    return since


def thinned(
    found: Mapping[str, Array], keep: NDArray[np.bool_], length: int, most: int
) -> tuple[dict[str, Array], NDArray[np.int64]]:
    """Signals cut to an even selection of `most` windows, and their first samples in them.

    A bench log holds far more windows than the effects need, and cost goes with samples. A few
    samples on each side of a window keep what is smoothed or differenced out of its weights.
    """
    starts = window_starts(keep, length, length, most)
    if starts.size * (length + 2 * PAD) >= keep.size:
        return dict(found), window_starts(keep, length)
    starts = starts[(starts >= PAD) & (starts + length + PAD <= keep.size)]
    rows = (starts[:, None] - PAD + np.arange(length + 2 * PAD)[None, :]).ravel()
    cut = {name: column[rows] for name, column in found.items()}
    return cut, PAD + (length + 2 * PAD) * np.arange(starts.size)
