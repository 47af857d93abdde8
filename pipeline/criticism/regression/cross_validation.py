"""Cross-validation of a fit: every capture is predicted from all the others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.regression import Goodness
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import pseudo_inverse, unit_diagonal

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


def _units(system: LinearSystem, divided: frozenset[str]) -> Indices:
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
