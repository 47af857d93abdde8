"""What a fit left over, and how loud the noise is that no fit could remove."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipeline.records.capture import Array
from pipeline.records.evidence import Series

FEWEST = 5


@dataclass(frozen=True, slots=True)
class ResidualScale:
    """Scatter of measured - fitted: `rms` and the point-to-point `noise` [unit of y], `n` points.

    `noise` is None with fewer than `FEWEST` neighbours, or where all of them are equal.
    """

    rms: float
    noise: float | None
    n: int

    @property
    def ratio(self) -> float | None:
        """The rms over the noise: 1 for white noise, more where neighbours share an error."""
        return None if self.noise is None else self.rms / self.noise


def residual_of(series: Series) -> Array:
    """What the fit left over, measured - fitted [n]; empty where the series has no fit.

    Parameters
    ----------
    series
        Measured and fitted samples.

    """
    return _less(series.measured, series.fitted)


def residual_before(series: Series) -> Array:
    """What an earlier fit left over [n]; empty where there was none.

    Parameters
    ----------
    series
        Measured and fitted samples.

    """
    return _less(series.measured, series.before)


def _less(measured: Array, fitted: Array) -> Array:
    if fitted.size == 0:
        return np.empty(0)
    with np.errstate(invalid="ignore"):
        return np.asarray(measured - fitted, dtype=np.float64)


def residual_scale(series: Iterable[Series]) -> ResidualScale | None:
    """Scatter of the residuals of several series, each in order of x; None without any fit.

    The noise is the root of half the mean squared difference of neighbours, which a smooth residual
    hardly moves. Reference: J. von Neumann, R. H. Kent, H. R. Bellinson, B. I. Hart, "The mean
    square successive difference", Ann. Math. Statist. 12 (1941) 153-162.

    Parameters
    ----------
    series
        Measured and fitted samples, each in order of x.

    """
    residuals, steps = [], []
    for one in series:
        residual = residual_of(one)
        if residual.size == 0:
            continue
        in_order = residual[np.argsort(one.x, kind="stable")]
        in_order = in_order[np.isfinite(in_order)]
        residuals.append(in_order)
        steps.append(np.diff(in_order))
    everything = np.concatenate(residuals) if residuals else np.empty(0)
    if everything.size == 0:
        return None
    differences = np.concatenate(steps)
    rms = math.sqrt(float(np.mean(everything**2)))
    noise = None
    if differences.size >= FEWEST and np.any(differences != 0.0):
        noise = math.sqrt(float(np.mean(differences**2)) / 2.0)
    return ResidualScale(rms, noise, int(everything.size))
