"""How good a fit is: errors of each signal, and what is left over the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.special import chdtri, ndtr

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.policy.regression import Goodness
from pipeline.criticism.regression.fit import Fit, current_floors_grown
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.channels import (
    channel_of,
    channel_scale,
    largest_reading,
    reported_signal,
)
from pipeline.records.diagnosis import Remainder


def floor_factors(tried: LinearSystem) -> Array:
    """Factors that turn χ²/n by the floors a fit was made with into χ²/n by those at its end.

    Parameters
    ----------
    tried
        The fit.

    Returns
    -------
    array [G]
        1 for an empty group.

    Notes
    -----
    The equations hold the noise of a current times R and L: a fit that makes these smaller makes
    the residual smaller as well.

    References
    ----------
    Fuller, Measurement Error Models, Wiley, 1987, section 1.3. doi:10.1002/9780470316665

    """
    was = np.concatenate(tried.fit.sigma)
    now = was * np.concatenate(current_floors_grown(tried.fit))
    power = tried.row_weight**-2
    by_end = np.bincount(tried.group, power + now**2 - was**2, len(tried.labels))
    factors: Array = np.bincount(tried.group, power, len(tried.labels)) / np.maximum(by_end, 1e-300)
    return np.where(tried.counts > 0, factors, 1.0)


def signal_errors(system: LinearSystem, residual: Array) -> dict[str, float]:
    """Rms error of the window means of each signal.

    Parameters
    ----------
    system
        Scale of each row.
    residual
        Whitened [R]; NaN rows are left out.

    Returns
    -------
    dict of float
        By reported name, in the unit of the signal.

    """
    errors: dict[str, float] = {}
    signals = (
        reported_signal(system.segments[number], channel) if order == 0 else ""
        for number, channel, order in system.labels
    )
    names = np.array(list(signals))
    of_row = names[system.group]
    for name in sorted({n for n in names.tolist() if n}):
        in_signal = (of_row == name) & np.isfinite(residual)
        if in_signal.any():
            errors[name] = math.sqrt(
                float(((residual[in_signal] * system.unit[in_signal]) ** 2).mean())
            )
    return errors


def remainder(system: LinearSystem, large: bool = False) -> tuple[Remainder, ...]:
    """Groups that are over their floor significantly and by a size that matters.

    Parameters
    ----------
    system
        Around a fit.
    large
        Whether the size must matter to the machine as a whole.

    Returns
    -------
    tuple of Remainder
        The worst first.

    Notes
    -----
    A floor from the recording itself is good to a factor of 2 in variance, and nobody acts on an
    error below 5e-4 of the machine's voltage or torque.

    """
    return tuple(one for one in over_floor(system, large) if one.matters)


def over_floor(system: LinearSystem, large: bool = False) -> tuple[Remainder, ...]:
    """Groups that are significantly over their floor, at any size.

    Parameters
    ----------
    system
        The fit.
    large
        Whether an error must be large beside the machine's own size, and not beside the readings.

    Returns
    -------
    tuple of Remainder
        Those that matter first, then by χ²/n. They show where a held-out error over the floor comes
        from when `remainder` is empty.

    """
    exceeding = []
    for place, chi2_per_n, size, matters in _groups_over_floor(system, system.noise_ratio, large):
        number, channel, order = system.labels[place]
        capture = system.segments[number].capture
        exceeding.append(Remainder(capture, channel, order, chi2_per_n, size, matters))
    return tuple(
        sorted(
            exceeding, key=lambda r: (not r.matters, -r.chi2_per_n, r.capture, r.signal, r.order)
        )
    )


def of_motor(system: LinearSystem, name: str) -> bool:
    """Whether an effect of a fit moves a signal that counts: the motor's, or its station's.

    Parameters
    ----------
    system
        The fit.
    name
        The effect.

    """
    columns = [
        place
        for place in system.model_columns
        if system.columns[place].name.partition(".")[0] == name
    ]
    moves = np.any(system.matrix[:, columns] != 0.0, axis=1)
    counts = [channel_of(system.segments[n], channel).counts for n, channel, _ in system.labels]
    return bool((moves & np.array(counts)[system.group]).any())


def significant_groups(system: LinearSystem) -> Flags:
    """Groups that a fit leaves over their floor, as `remainder` judges it.

    Parameters
    ----------
    system
        The fit.

    Returns
    -------
    array [G] of bool
        The floor here has the tolerance of form of the effects found in it.

    """
    significant = np.zeros(len(system.labels), dtype=bool)
    as_whitened = np.ones(system.size)
    groups_over = _groups_over_floor(system, as_whitened)
    significant[[place for place, _, _, matters in groups_over if matters]] = True
    return significant


def form_error_factor(system: LinearSystem) -> Array:
    """How wrong a model's form may have made the parameters.

    Parameters
    ----------
    system
        Around a fit.

    Returns
    -------
    array [own, own]
        Factor F of the covariance F' F of the gradient of the deviance by the fit's own parameters.
        Zeros where every group is as good as its floor.

    Notes
    -----
    What a group leaves over its floor is no noise: it repeats itself where the motor does, and no
    number of windows takes it away. Its sum Σ w x r lies between ∓ √(Σ w² x² · Σ r²) by Cauchy and
    Schwarz, and where, nobody knows; a uniform density between these bounds has a third of their
    square as its variance.

    References
    ----------
    JCGM 100:2008 (GUM), 4.3.7. doi:10.59161/JCGM100-2008E

    """
    size = system.model_columns.size
    weight = system.weights(system.reduced_chi2(system.residual))
    factor = np.zeros((size, size))
    for place, _, _, matters in _groups_over_floor(system, system.noise_ratio):
        if matters:
            in_group = system.group == place
            rows = system.matrix[in_group, :size] * weight[in_group, None]
            excess = float(
                (system.residual[in_group] ** 2 - system.noise_ratio[in_group] ** 2).sum()
            )
            bound = math.sqrt(max(excess, 0.0) / 3.0) * rows
            _, factor = np.linalg.qr(np.vstack([factor, bound]))
    return factor


def _groups_over_floor(
    system: LinearSystem, noise_ratio: Array, large: bool = False
) -> Iterator[tuple[int, float, float, bool]]:
    """Place, χ²/n, size of every group over its floor, and whether that size matters; the floor is
    `noise_ratio` [R] of the scale that rows are divided by.

    A wave of the motor is in more windows than one. In a single one the rounding of an encoder may
    beat with it, at a pace that is known too badly for its floor to say so.
    """
    policy, residual = system.policy.goodness, system.residual
    in_floors, of_segment = residual / noise_ratio, system.segment
    reduced_chi2, counts = system.reduced_chi2(in_floors), system.counts
    for place, (number, channel, order) in enumerate(system.labels):
        n, q = counts[place], reduced_chi2[place]
        if not _is_over(n, q, policy):
            continue
        in_group = system.group == place
        in_segment = of_segment == number
        if order and not _is_over(
            *_without_worst(in_floors, system.window, in_group, in_segment), policy
        ):
            continue
        precision = (system.unit * noise_ratio)[in_group] ** -2.0
        size = math.sqrt((q - 1.0) / float(precision.mean()))
        matters = size > material_size(system.segments[number], channel, system.fit, large)
        yield place, float(q), size, matters


def _is_over(n: float, reduced_chi2: float, policy: Goodness) -> bool:
    """Whether χ²/n of n samples is over a floor by more than it may be wrong by, and by chance."""
    highest = max(1.0 + policy.over, _highest_by_chance(n, policy.chance)) if n else math.inf
    return reduced_chi2 > highest


def _without_worst(
    in_floors: Array, window: Indices, rows: Flags, segment: Flags
) -> tuple[int, float]:
    """Number and mean square of a group's `rows` [R], in floors [R], without its worst window where
    the `segment` [R] has another.
    """
    squares, windows = in_floors[rows] ** 2, window[rows]
    if np.ptp(window[segment]):
        squares = squares[windows != np.argmax(np.bincount(windows, squares))]
    return squares.size, float(squares.mean()) if squares.size else 0.0


@cache
def _highest_by_chance(n: float, sigmas: float) -> float:
    """χ²/n of n samples that chance passes as seldom as so many standard deviations.

    The tail of χ² itself is used: of four samples, 1 + 5 √(2/n) is passed one time in a thousand.
    """
    return float(chdtri(n, ndtr(-sigmas))) / n


def material_size(segment: Segment, channel: str, fit: Fit, large: bool = False) -> float:
    """Error that is negligible in use.

    Parameters
    ----------
    segment
        Whose signal it is.
    channel
        The signal.
    fit
        For the machine's scales and the policy.
    large
        Whether the error shall be large for the machine, and not beside the readings.

    Returns
    -------
    float
        [unit of the signal]

    Notes
    -----
    Of a log at standstill the machine's own voltage is no measure: all of it is R times current.
    In a column that does not count no error is the motor's.

    """
    observed, policy = channel_of(segment, channel), fit.policy.goodness
    if not observed.counts:
        return math.inf
    scale = channel_scale(segment, channel, fit.model.machine, fit.values)
    size = (policy.material if observed.scale else policy.material_bench) * scale
    if observed.scale and observed.beside and not large:
        size = min(size, policy.material_reading * largest_reading(segment, observed.beside))
    return size
