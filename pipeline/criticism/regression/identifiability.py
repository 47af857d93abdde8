"""Which of a model's parameters the captures and the station's priors determine, and how well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammainc, gammaincinv, ndtr, ndtri

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.machine.model import PHYSICAL, base_of
from pipeline.criticism.operating import Array
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.numerics.identifiability import Identified, identify

POSITIVE = ("psi_wb", "j_kgm2", "r_ohm", "ld_h", "lq_h")
"""Constants that no motor is without, in the order in which others are reported over them."""
_EDGE = 1e-9
"""Share of a bound by which a value that stands there may miss it."""


@dataclass(frozen=True, slots=True)
class Known:
    """What a fit determines of its own parameters.

    Attributes
    ----------
    identified
        What rows and priors determine.
    steps
        How far the parameters move without each capture that can be left out [K, own].
    rest
        Step [own] that the equations would still take where a bound or the last iteration prevents
        it.
    form_error_factor
        Factor [own, own] of what errors of the model's form may do; zeros where the form is taken
        as right.

    """

    identified: Identified
    steps: Array
    rest: Array
    form_error_factor: Array

    def u_of(self, gradient: Array, bent: bool = False) -> float:
        """Standard uncertainty of a function of the parameters.

        Parameters
        ----------
        gradient
            By the parameters [own].
        bent
            Whether the function is not linear.

        Returns
        -------
        float
            The larger one of the samples' noise and of leaving out one capture at a time, with the
            step that is still to be done and what a wrong form may do; infinite where the function
            is not identifiable.

        Notes
        -----
        Jackknife: u² = (K − 1)/K Σ (θ_k − mean)². A form that is a little wrong, or noise that is
        not white, disturbs every capture in its own way; a covariance from samples does not know
        that.

        References
        ----------
        Efron and Stein, Ann. Statist. 9(3), 1981, 586, doi:10.1214/aos/1176345462.

        """
        noise = self.identified.u_of_bent(gradient) if bent else self.identified.u_of(gradient)
        count, moves = len(self.steps), self.steps @ gradient
        between = 0.0
        if count > 1:
            between = math.sqrt((count - 1) * float(np.var(moves)))
        pull = self.identified.root @ (self.identified.root.T @ gradient)
        form = float(np.linalg.norm(self.form_error_factor @ pull))
        return math.hypot(max(noise, between), float(self.rest @ gradient), form)

    def excludes_zero(
        self, value: float, gradient: Array, least: float, bent: bool = False
    ) -> bool:
        """Whether a function of the parameters differs significantly from zero.

        Parameters
        ----------
        value
            Of the function.
        gradient
            By the parameters [own].
        least
            Standard uncertainties that it must be away from zero.
        bent
            Whether the function is not linear.

        Returns
        -------
        bool
            A step that a bound prevents is no doubt where it leads away from zero.

        """
        u, step = self.u_of(gradient, bent), float(self.rest @ gradient)
        if step * value > 0.0:
            u = math.sqrt(max(0.0, u * u - step * step))
        return abs(value) > least * u

    @property
    def u(self) -> Array:
        """Standard uncertainty [own] of every parameter."""
        return np.array([self.u_of(one) for one in np.eye(self.rest.size)])


def known(system: LinearSystem, held_out: HeldOut) -> Known:
    """What a system and its priors say of a fit's own parameters.

    Parameters
    ----------
    system
        Around a fit, with columns that were made at it.
    held_out
        What leaving out captures moves.

    Returns
    -------
    Known
        Without anything that only keeps steps short, or where the fit began.

    """
    sizes = _sizes(system.fit, system.columns[: system.model_columns.size])
    return known_by(system, held_out, sizes)


def known_by(system: LinearSystem, held_out: HeldOut, sizes: Array) -> Known:
    """What a system and its priors determine, with the sizes of the parameters given.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual.
    sizes
        Magnitudes [own] at which the parameters matter.

    Returns
    -------
    Known
        Without errors of the model's form.

    """
    count = system.model_columns.size
    weight = system.weights(system.reduced_chi2(system.residual))
    matrix, prior_precision = system.matrix[:, :count], system.prior_precision[:count]
    rows = np.vstack([matrix * np.sqrt(weight)[:, None], np.diag(np.sqrt(prior_precision))])
    identified = identify(rows, sizes)
    slope = matrix.T @ (weight * system.residual) + system.prior_gradient[:count]
    steps = np.array(list(held_out.steps.values())).reshape(-1, count)
    return Known(
        identified, steps, -identified.root @ (identified.root.T @ slope), np.zeros((count, count))
    )


def significantly_nonzero(system: LinearSystem, held_out: HeldOut, least: float) -> set[str]:
    """Parameters that differ significantly from zero, as they are or over or times a constant that
    no motor is without.

    Parameters
    ----------
    system
        Around a fit.
    held_out
        What leaving out captures moves.
    least
        Standard uncertainties that they must be away from zero.

    Returns
    -------
    set of str
        Names. A coast shows that there is windage though it shows no more than windage over
        inertia, and a torque that inductances fall though it shows no more than the share by which
        they do times an inductance. And a spring that is softer for less inertia behind it is at
        least as soft as it is with most of the inertia behind it.

    """
    fit = known(system, held_out)
    values = np.array([system.fit.values[c.name] for c in system.columns])
    inward = _inward(system)
    below = [n for n, c in enumerate(system.columns) if c.name in POSITIVE and values[n] > 0.0]
    sure = set()
    for n, column in enumerate(system.columns):
        gradient = _towards_zero(fit.identified.covariance, values, n, inward)
        if fit.excludes_zero(values[n], gradient, least) or any(
            fit.excludes_zero(
                values[n] * values[j] ** power, _by_constant(values, n, j, power), least, bent=True
            )
            for j in below
            for power in (-1, 1)
            if j != n
        ):
            sure.add(column.name)
    return sure


def together_nonzero(
    system: LinearSystem, held_out: HeldOut, names: Sequence[str], least: float
) -> bool:
    """Whether parameters that are each unsure are not all zero.

    Parameters
    ----------
    system
        Around a fit.
    held_out
        What leaving out captures moves.
    names
        The parameters.
    least
        Standard uncertainties that one alone must be away from zero; several must exclude zero with
        the same probability.

    Returns
    -------
    bool
        Of their combination that differs most from zero: of friction and damping of bristles, of
        which one may stand for the other, the sum may be known a hundred times better than either.

    References
    ----------
    Hotelling, Ann. Math. Statist. 2(3), 1931, 360, doi:10.1214/aoms/1177732979.

    """
    fit = known(system, held_out)
    parameters = [column.name for column in system.columns[: system.model_columns.size]]
    at = np.array([parameters.index(name) for name in names if name in parameters], dtype=int)
    values = np.array([system.fit.values[parameters[n]] for n in at])
    gradient = np.zeros(len(parameters))
    covariance = fit.identified.covariance[np.ix_(at, at)]
    gradient[at] = np.linalg.pinv(covariance, hermitian=True) @ values
    least = math.sqrt(2.0 * gammaincinv(0.5 * max(at.size, 1), gammainc(0.5, 0.5 * least**2)))
    return fit.excludes_zero(float(gradient[at] @ values), gradient, least)


def product_nonzero(
    system: LinearSystem, held_out: HeldOut, names: tuple[str, str], least: float
) -> bool:
    """Whether the product of two parameters differs significantly from zero, so that neither is.

    Parameters
    ----------
    system
        Around a fit.
    held_out
        What leaving out captures moves.
    names
        The parameters.
    least
        Standard uncertainties that it must be away from zero.

    Returns
    -------
    bool
        Far below its resonance a spring shows share and twist of its inertia as a product only.

    """
    parameters = [column.name for column in system.columns[: system.model_columns.size]]
    if not set(names) <= set(parameters):
        return False
    one, other = (system.fit.values[name] for name in names)
    gradient = np.zeros(len(parameters))
    gradient[[parameters.index(name) for name in names]] = other, one
    return known(system, held_out).excludes_zero(one * other, gradient, least, bent=True)


def least_of_several(least: float, count: int) -> float:
    """How far the largest of several numbers must be from zero to be no more likely by chance than
    one number alone.

    Parameters
    ----------
    least
        Standard uncertainties that one alone must be away from zero.
    count
        How many there are; one at the least.

    Returns
    -------
    float
        Standard uncertainties that one of several must be away from zero.

    References
    ----------
    Šidák, J. Am. Stat. Assoc. 62(318), 1967, 626, doi:10.1080/01621459.1967.10482935.

    """
    alone = 2.0 * ndtr(-least)
    return float(-ndtri(-0.5 * math.expm1(math.log1p(-alone) / max(count, 1))))


def _inward(system: LinearSystem) -> Array:
    """Senses [own] in which a fit's own parameters can leave the bounds they stand at, else 0."""
    fit = system.fit
    limits = limits_of(fit.model)
    inward = np.zeros(system.model_columns.size)
    for n, column in enumerate(system.columns[: inward.size]):
        value, bounds = fit.values[column.name], limits.get(column.name)
        if bounds is not None and at_bound(value, bounds):
            inward[n] = 1.0 if value - bounds[0] < bounds[1] - value else -1.0
    return inward


def _towards_zero(covariance: Array, values: Array, one: int, inward: Array) -> Array:
    """Gradient [own] of a parameter, without what others at a bound would move it away from zero.

    Such another one can only go one way. Where the parameter grows with that, zero is as far as
    with the other one at its bound.
    """
    gradient = np.zeros(inward.size)
    gradient[one] = 1.0
    for other in np.flatnonzero(inward):
        variance = covariance[other, other]
        if other != one and variance > 0.0:
            slope = covariance[one, other] / variance
            if slope * inward[other] * values[one] > 0.0:
                gradient[other] -= slope
    return gradient


def _by_constant(values: Array, one: int, other: int, power: int) -> Array:
    """Gradient [own] of a parameter times a power of another one."""
    gradient = np.zeros(values.size)
    gradient[one] = values[other] ** power
    gradient[other] = power * values[one] * values[other] ** (power - 1)
    return gradient


def at_bound(value: float, limits: tuple[float, float] | None) -> bool:
    """Whether a value stands at a bound."""
    return limits is not None and any(
        abs(value - end) <= _EDGE * max(abs(end), 1e-30) for end in limits if math.isfinite(end)
    )


def _sizes(fit: Fit, columns: Sequence[Column]) -> Array:
    """Magnitude [P] at which every parameter matters, in its own unit.

    Of a constant that no motor is without, its value, of a nuisance its prior, of the others their
    value or a size seen on real benches, the larger; waves of one unit are of one size.
    """
    model, values = fit.model, fit.values
    orders, priors = base_scales(model.machine), model.priors()
    known = {name: abs(values[name]) or orders[name] for name in POSITIVE}
    known["b_nm_s_rad"] = max(abs(values["b_nm_s_rad"]), orders["b_nm_s_rad"])
    for name, (effect, p) in model.parameters().items():
        alike = [
            abs(values[other])
            for other, q in effect.named(model.machine).items()
            if q.amplitude and (q.unit, q.scale) == (p.unit, p.scale)
        ]
        sizes = alike if p.amplitude else [abs(values[name])]
        known[name] = max(*sizes, p.typical * model.machine.scale(p), 1e-300)
    nuisances = (c.name for c in base_of(model.machine) if c.name not in PHYSICAL)
    known |= {name: priors[name][1] for name in nuisances if name in priors}
    return np.array([known.get(column.name, 1.0) for column in columns])
