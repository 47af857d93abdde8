"""How good a fit is: held-out error, errors of each signal, and what is left over the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtr

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.regression import Goodness
from pipeline.criticism.regression.fit import Fit, current_floors_grown
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import pseudo_inverse, unit_diagonal
from pipeline.criticism.residuals.channels import (
    channel_of,
    channel_scale,
    largest_reading,
    reported_signal,
)
from pipeline.records.diagnosis import Remainder

_MOST_BLOCKS = 10_000
"""More than the blocks of any capture, so that every block has a number of its own."""


@dataclass(frozen=True, slots=True)
class HeldOut:
    """The errors of a fit where each capture is predicted without itself.

    Attributes
    ----------
    residual
        [R]; NaN in what alone determines a constant, and so is always in the fit.
    total
        Rms of the others over what may be expected of a prediction [1]; of the fit itself where
        there are none.
    steps
        How far the parameters move without a capture [own columns], by its number.
    widening
        Factor on the noise floor for what the other captures and the instruments leave open of a
        prediction [R].
    divided
        Captures of which each block is predicted from all else, as no other capture can.

    """

    residual: Array
    total: float
    steps: Mapping[int, Array] = field(default_factory=dict)
    widening: Array | float = 1.0
    divided: frozenset[str] = frozenset()

    @property
    def notes(self) -> tuple[str, ...]:
        """What whoever reads `total` must know."""
        if np.isfinite(self.residual).any():
            return ()
        return ("no capture can be predicted from the others: errors are those of the fit",)

    @classmethod
    def of(
        cls,
        system: LinearSystem,
        residual: Array,
        steps: Mapping[int, Array],
        widening: Array,
        divided: frozenset[str] = frozenset(),
    ) -> HeldOut:
        """The held-out errors with their total.

        Parameters
        ----------
        system
            The fit.
        residual
            Held-out residual, NaN in captures that are always in the fit [R].
        steps
            How far the parameters move without a capture, by its number.
        widening
            Factor on the noise floor [R].
        divided
            Captures that are predicted block by block.

        Returns
        -------
        HeldOut
            The total is over the rows that are held out, or over those of the fit where none is.

        """
        predicted = np.isfinite(residual)
        errors_of_rows = cls(residual, 0.0, steps, widening, divided)
        errors = errors_of_rows.or_fit(system) / (system.noise_ratio * widening)
        errors = errors[predicted] if predicted.any() else errors
        return replace(errors_of_rows, total=math.sqrt(float((errors**2).mean())))

    def or_fit(self, system: LinearSystem) -> Array:
        """The held-out residual, that of the fit where a capture is always in it.

        Parameters
        ----------
        system
            The fit.

        Returns
        -------
        array [R]
            Whitened.

        """
        return np.where(np.isfinite(self.residual), self.residual, system.residual)


def leave_out(system: LinearSystem, divided: frozenset[str] = frozenset()) -> HeldOut:
    """Predicts every capture from all the others, by one weighted step from the full fit.

    Parameters
    ----------
    system
        Around the full fit.
    divided
        Captures that are predicted block by block at any rate.

    Returns
    -------
    HeldOut
        Of a capture that alone determines a constant every block is predicted from all else, as far
        as it has blocks; what then still determines one stays in the fit.

    Notes
    -----
    Δ = −(N − N_k)⁻¹ (s − s_k) with the normal matrix N and the gradient s of all rows, and those of
    the capture k. To first order: noise floors, weights and shapes stay those of the full fit.

    A row x of the capture is predicted with the variance x (N − N_k)⁻¹ x' beside its noise. This N
    counts noise and the priors of instruments and temperatures: what a model misses excuses
    nothing.

    """
    policy, own_size = system.policy.goodness, system.model_columns.size
    places = np.flatnonzero(np.any(system.matrix[:, :own_size] != 0.0, axis=0))
    weight = system.weights(system.reduced_chi2(system.residual))
    matrix = system.matrix[:, places]
    unit = _units(system, divided)
    weighted = matrix * weight[:, None]
    normal = weighted.T @ matrix + np.diag(system.prior_precision[places])
    unweighted = matrix.T @ matrix + np.diag(system.prior_precision[places])
    slope = weighted.T @ system.residual + system.prior_gradient[places]
    spread = np.diag(np.linalg.pinv(unit_diagonal(normal), hermitian=True))
    residual, widening = np.full(system.size, np.nan), np.ones(system.size)
    steps: dict[int, Array] = {}
    carrying: set[str] = set()
    for number in sorted(set(unit.tolist())):
        in_unit = unit == number
        remaining = normal - weighted[in_unit].T @ matrix[in_unit]
        scale = np.sqrt(np.diag(normal))
        inverse = np.linalg.pinv(remaining / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        grown = np.diag(inverse) / np.maximum(spread, 1e-300)
        if (
            not np.isfinite(grown).all()
            or grown.max() > policy.carried_growth
            or _loses_information(remaining, normal, policy)
        ):
            if number < len(system.segments) and system.segments[number].blocks is not None:
                carrying.add(system.segments[number].capture)
            continue
        step = (
            -(inverse @ ((slope - weighted[in_unit].T @ system.residual[in_unit]) / scale)) / scale
        )
        residual[in_unit] = system.residual[in_unit] + matrix[in_unit] @ step
        rows = matrix[in_unit] / system.noise_ratio[in_unit, None]
        covariance = pseudo_inverse(unweighted - matrix[in_unit].T @ matrix[in_unit])
        widening[in_unit] = np.sqrt(1.0 + np.einsum("rk,kl,rl->r", rows, covariance, rows))
        steps[number] = np.zeros(own_size)
        steps[number][places] = step
    if carrying:
        return leave_out(system, divided | carrying)
    return HeldOut.of(system, residual, steps, widening, divided)


def in_common(fits: Sequence[LinearSystem], held_out: Sequence[HeldOut]) -> tuple[HeldOut, ...]:
    """The same rows held out of several fits to the same captures, so that their errors compare.

    Parameters
    ----------
    fits
        Systems around the fits, of the same rows.
    held_out
        What each of them predicts.

    Returns
    -------
    tuple of HeldOut
        Rows that one of them could not hold out count in none. A capture that one of them predicts
        block by block, all do.

    Notes
    -----
    A parameter that one capture alone determines keeps that capture in the fit. If it counted in
    one fit and not in the other, that would pass for a better prediction. So would a prediction
    that leaves more open: of each row the surest prediction's widening counts in all.

    """
    divided = frozenset[str]().union(*(h.divided for h in held_out))
    held_out = [
        h if h.divided == divided else leave_out(system, divided)
        for system, h in zip(fits, held_out, strict=True)
    ]
    shared = np.all([np.isfinite(h.residual) for h in held_out], axis=0)
    widening = np.minimum.reduce([np.broadcast_to(h.widening, shared.shape) for h in held_out])
    return tuple(
        HeldOut.of(system, np.where(shared, h.residual, np.nan), h.steps, widening, divided)
        for system, h in zip(fits, held_out, strict=True)
    )


def predicted_chi2(system: LinearSystem, held_out: HeldOut) -> Array:
    """χ²/n of every group as predicted without its capture.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual.

    Returns
    -------
    array [G]
        Over what may be expected of a prediction; captures that are always in the fit as fitted.

    """
    return system.reduced_chi2(held_out.or_fit(system) / held_out.widening)


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


def _units(system: LinearSystem, divided: frozenset[str]) -> NDArray[np.int64]:
    """Number of what is held out together, of every row [R]: a segment, or a block of a capture.

    Segments of one capture that are split alike are held out together.
    """
    segment = system.segment
    units = segment.astype(np.int64)
    names = [s.capture for s in system.segments]
    first = len(names)
    for number, one in enumerate(system.segments):
        if one.blocks is not None and (not one.whole or one.capture in divided):
            in_segment = segment == number
            units[in_segment] = first + names.index(one.capture) * _MOST_BLOCKS
            units[in_segment] += one.blocks[system.window[in_segment]]
    return units


def _loses_information(remaining: Array, normal: Array, policy: Goodness) -> bool:
    """Whether some constant keeps next to nothing of its information."""
    return bool((np.diag(remaining) < policy.lost_share * np.diag(normal)).any())


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


def significant_groups(system: LinearSystem) -> NDArray[np.bool_]:
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
    """
    policy, residual = system.policy.goodness, system.residual
    reduced_chi2, counts = system.reduced_chi2(residual / noise_ratio), system.counts
    for place, (number, channel, _) in enumerate(system.labels):
        n, q = counts[place], reduced_chi2[place]
        if n == 0 or q <= max(1.0 + policy.over, _highest_by_chance(n, policy.chance)):
            continue
        in_group = system.group == place
        precision = (system.unit * noise_ratio)[in_group] ** -2.0
        size = math.sqrt((q - 1.0) / float(precision.mean()))
        matters = size > material_size(system.segments[number], channel, system.fit, large)
        yield place, float(q), size, matters


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
