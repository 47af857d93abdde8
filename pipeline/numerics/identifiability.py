"""Which numbers the data determine, and which only together.

A least squares problem with whitened rows A [n, p], the priors that are measurements among them,
knows a function g of the parameters where its gradient has no part along the directions that A
sends to nothing; its variance is then gᵀ (AᵀA)⁺ g, whichever generalised inverse is taken [1].
Along such a direction every value fits as well, and what a minimum-norm solution makes of it is a
number of the algorithm. A number may also be known, but not to its own size: its likelihood then
has no end on a logarithmic scale [2].

The columns of A are scaled to unit length, whose singular values are Belsley's condition indices
[3], so that units do not matter; and A is decomposed, not AᵀA, which would lose half of the digits.

References: [1] Rao & Mitra, Generalized Inverse of Matrices (1971), 7.2; Walter & Pronzato,
Identification of Parametric Models (1997), 2.6. [2] Raue et al., Bioinformatics 25 (2009),
doi:10.1093/bioinformatics/btp358. [3] Belsley, Kuh & Welsch, Regression Diagnostics (1980), ch. 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TIED = 1e-10
"""Singular value, over the largest, of unit columns that are taken for tied. By judgement: exact
ties of columns from finite differences come out at 1e-14."""
_UNOBSERVED = 1e-6
"""Standard deviations of the data that a parameter must make when it moves by its own size."""
_TOUCHED = 0.1
"""Standard uncertainties by which a direction without information moves what it leaves alone."""
REACH = 1.959964
"""Standard uncertainties to either end of a 95 % interval."""
_COARSE = 1e-2
"""Part of a gradient along a direction without information that a column may be wrong by: a
difference quotient of 1/x with a step of a thousandth of x is a thousandth off."""
_OTHER = 1e-3
"""Part of a combination's gradient that must be none of those found before."""


@dataclass(frozen=True, slots=True)
class Identified:
    """What rows say of p parameters.

    `sizes` [p] are magnitudes at which the parameters matter, in their own units. `null` [p, k] are
    the directions without information, each of which moves some parameter by its size, and `root`
    [p, p] is a root of the covariance, root rootᵀ, of everything that no such direction moves.
    """

    sizes: Array
    null: Array
    root: Array

    @property
    def covariance(self) -> Array:
        """Covariance [p, p] of everything that no direction without information moves."""
        return self.root @ self.root.T

    def u_of(self, gradient: Array) -> float:
        """Standard uncertainty of a function of the parameters.

        Parameters
        ----------
        gradient
            Its derivatives [p] by the parameters.

        Returns
        -------
        float
            k = 1 [unit of the function]; infinite for a zero gradient and where directions without
            information move the function by more than a tenth of its uncertainty.

        """
        u = self._noise_of(gradient)
        moved = float(np.linalg.norm(gradient @ self.null))
        unknown = not np.any(gradient) or moved > _TOUCHED * u
        return math.inf if unknown else u

    def u_of_bent(self, gradient: Array) -> float:
        """Standard uncertainty of a function that is not linear in the parameters.

        Parameters
        ----------
        gradient
            Its derivatives [p] by the parameters, at their values.

        Returns
        -------
        float
            As `u_of`, but the gradient need be orthogonal to the directions without information
            only as far as columns from finite differences can show.

        """
        size = float(np.linalg.norm(gradient * self.sizes))
        moved = float(np.linalg.norm(gradient @ self.null))
        return self._noise_of(gradient) if moved < _COARSE * size else math.inf

    def _noise_of(self, gradient: Array) -> float:
        # by the root: in the covariance, what two nearly tied numbers are together is lost
        return float(np.linalg.norm(gradient @ self.root))

    @property
    def u(self) -> Array:
        """Standard uncertainty [p] of every parameter, infinite where it is not identifiable."""
        return np.array([self.u_of(one) for one in np.eye(self.sizes.size)])

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which parameters [p] are known at all, and better than to their own size: the 95 %
        interval is not as wide to either side.
        """
        return within(self.u, self.sizes)


def within(u: Array, sizes: Array) -> NDArray[np.bool_]:
    """Whether numbers are known better than to their own size.

    Parameters
    ----------
    u
        Standard uncertainties [p].
    sizes
        Magnitudes at which the numbers matter [p, same units].

    Returns
    -------
    array [p]
        True where the half width of the 95 % interval, `REACH` u, is below the size.

    """
    return REACH * u < sizes


def identify(rows: Array, sizes: Array) -> Identified:
    """What whitened rows of data and priors say of parameters.

    Parameters
    ----------
    rows
        Derivatives of the residuals by the parameters, over their standard deviation [n, p].
    sizes
        Magnitude at which each parameter matters [p, its unit], above zero.

    Returns
    -------
    Identified
        The directions without information, and a root of the covariance of all else.

    Raises
    ------
    ValueError
        A size is not above zero.

    Notes
    -----
    A column is unobserved where the parameter's size moves all rows together by less than
    `_UNOBSERVED` standard deviations. The others are scaled to unit length; directions whose
    singular value is below `TIED` of the largest hold no information.

    References
    ----------
    Belsley, Kuh and Welsch, Regression Diagnostics, Wiley, 1980, ch. 3.

    Examples
    --------
    Two parameters that are seen only as their sum: neither is known, the sum is.

    >>> found = identify(np.array([[1.0, 1.0], [1.0, 1.0]]), np.ones(2))
    >>> found.u.tolist(), round(found.u_of(np.array([1.0, 1.0])), 6)
    ([inf, inf], 0.707107)

    """
    if not (sizes > 0.0).all():
        raise ValueError("every parameter needs a size above zero")
    length = np.linalg.norm(rows, axis=0)
    observed = length * sizes > _UNOBSERVED
    count = sizes.size
    root = np.zeros((count, count))
    null = [np.eye(count)[:, ~observed]]
    if observed.any():
        scale = length[observed]
        triangle = np.linalg.qr(rows[:, observed] / scale, mode="r")
        _, singular, right = np.linalg.svd(triangle, full_matrices=False)
        known = singular > TIED * singular[0]
        root[observed, : int(known.sum())] = (right[known] / scale).T / singular[known]
        # fewer rows than columns leave directions that the decomposition does not give
        tied = np.zeros((count, int(observed.sum()) - int(known.sum())))
        tied[observed] = _complement(right[known]) / (scale * sizes[observed])[:, None]
        null.append(tied)
    free = np.column_stack(null)
    axes_of_sizes, _ = np.linalg.qr(free)
    return Identified(sizes, _one_size(axes_of_sizes) * sizes[:, None], root)


def _complement(rows: Array) -> Array:
    """Orthonormal columns [p, p − r] of the directions that r orthonormal rows [r, p] leave."""
    _, _, right = np.linalg.svd(rows, full_matrices=True)
    return right[rows.shape[0] :].T


def _one_size(directions: Array) -> Array:
    """Directions [p, k] in sizes, each scaled so that its largest part is one."""
    largest = np.abs(directions).max(axis=0, initial=0.0)
    return directions / np.where(largest > 0.0, largest, 1.0)


@dataclass(frozen=True, slots=True)
class Combination:
    """A function of parameters that is known where they are not.

    A `product` is Π x^w with `weights` of ±1 by the parameter's place, a sum Σ w x. `value`,
    `gradient` [p] by the parameters, `size` at which it matters, standard uncertainty `u`.
    """

    product: bool
    weights: tuple[tuple[int, float], ...]
    value: float
    gradient: Array
    size: float
    u: float


def known_combinations(
    identified: Identified, values: Array, places: Sequence[int], positive: Sequence[int]
) -> tuple[Combination, ...]:
    """The simplest functions of parameters that are known although the parameters are not.

    Parameters
    ----------
    identified
        What the data say of all parameters.
    values
        The parameters [p].
    places
        Indices of the parameters that may enter.
    positive
        Indices of those that are above zero: one of them, the first that serves, stands below a
        fraction.

    Returns
    -------
    tuple of Combination
        Independent of each other: ratios and products first, then sums of two terms.

    Notes
    -----
    A combination is known where `within` holds for it, and independent where its gradient is no
    linear combination of the gradients of those before it.

    """
    accepted: list[Combination] = []
    for one in (
        *_products(identified, values, places, positive),
        *_sums(identified, values, places),
    ):
        gradients = [
            *(other.gradient * identified.sizes for other in accepted),
            one.gradient * identified.sizes,
        ]
        if within(np.array(one.u), np.array(one.size)) and new_direction(gradients):
            accepted.append(one)
    return tuple(accepted)


def new_direction(gradients: Sequence[Array]) -> bool:
    """Whether the last of some gradients is no combination of the others.

    Parameters
    ----------
    gradients
        Derivatives [p each] by the parameters, in sizes of these.

    """
    unit = np.column_stack([one / np.linalg.norm(one) for one in gradients])
    _, triangle = np.linalg.qr(unit)
    return abs(float(triangle[-1, -1])) > _OTHER


def _products(
    identified: Identified, values: Array, places: Sequence[int], positive: Sequence[int]
) -> Iterator[Combination]:
    """Ratios, products of two, and what three parameters make, the simplest first."""
    places = [n for n in places if np.isinf(identified.u[n])]
    below = [n for n in positive if n in places]
    for j in below:
        yield from (_product(identified, values, {i: 1, j: -1}) for i in places if i != j)
    for pair in combinations(places, 2):
        yield _product(identified, values, dict.fromkeys(pair, 1))
    for j in below:
        others = [n for n in places if n != j]
        for one, two in combinations(others, 2):
            yield _product(identified, values, {one: 1, two: 1, j: -1})
    for one, two in combinations(below, 2):
        for i in (n for n in places if n not in (one, two)):
            yield _product(identified, values, {i: 1, one: -1, two: -1})


def _product(identified: Identified, values: Array, powers: dict[int, int]) -> Combination:
    """Π x^w, its gradient also where a factor of the numerator is zero."""
    gradient = np.zeros(values.size)
    for place, power in powers.items():
        factors = [values[n] ** w for n, w in powers.items() if n != place]
        gradient[place] = power * values[place] ** (power - 1) * float(np.prod(factors))
    value = float(np.prod([values[n] ** w for n, w in powers.items()]))
    size = float(
        np.prod([(identified.sizes if w > 0 else values)[n] ** w for n, w in powers.items()])
    )
    u = identified.u_of_bent(gradient)
    return Combination(True, tuple(powers.items()), value, gradient, abs(size), u)


def _sums(identified: Identified, values: Array, places: Sequence[int]) -> Iterator[Combination]:
    """X + w y of every two parameters that one direction without information moves together, or
    that are known poorly, with the w that is known best.
    """
    for one, two in combinations(places, 2):
        pair = [one, two]
        sizes = identified.sizes[pair]
        open_ = identified.null if identified.null[pair].any() else identified.root
        axes, _, _ = np.linalg.svd(open_[pair] / sizes[:, None])
        weight = axes[:, -1] / sizes
        if not weight.all():
            continue
        gradient = np.zeros(values.size)
        gradient[pair] = weight / weight[0]
        weights = ((one, 1.0), (two, float(gradient[two])))
        size = float(np.max(np.abs(gradient[pair]) * sizes))
        u = identified.u_of(gradient)
        yield Combination(False, weights, float(gradient @ values), gradient, size, u)


def walked(
    identified: Identified, values: Array, combinations_: Sequence[Combination], far: float
) -> Iterator[tuple[NDArray[np.bool_], Array]]:
    """Values at either end of every direction without information, the combinations being kept.

    Parameters
    ----------
    identified
        What the data say of all parameters.
    values
        The parameters [p].
    combinations_
        Functions of them that stay as they are.
    far
        How far to go: a parameter that is in a product goes up or down by a factor of exp(`far`) at
        the most, any other by `far` of its size.

    Yields
    ------
    moved [p]
        Which parameters the direction moves.
    values [p]
        The parameters there; two a direction, ahead first.

    """
    factors = np.zeros((values.size, 0))
    inside = np.zeros(values.size, dtype=bool)
    for one in combinations_:
        if one.product:
            powers = np.zeros(values.size)
            for place, power in one.weights:
                powers[place], inside[place] = power, True
            factors = np.column_stack([factors, powers])
    inside &= values != 0.0
    axes, _ = np.linalg.qr(factors)
    for direction in identified.null.T:
        logs = np.where(inside, direction / np.where(inside, values, 1.0), 0.0)
        logs -= axes @ (axes.T @ logs)
        logs /= max(float(np.abs(logs).max()), 1.0)
        for way in (far, -far):
            moved = values * np.exp(way * logs) + np.where(inside, 0.0, way * direction)
            yield direction != 0.0, moved
