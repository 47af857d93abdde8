"""A sparse expression for an unknown curve: orthogonal matching pursuit over the dictionary.

The weak residual is linear in a port's narrow hats, so once their columns are there any curve is
a product of small matrices, and scales are searched at no cost.

References: [1] Pati, Rezaiifar & Krishnaprasad, Asilomar Conf. (1993), orthogonal matching
pursuit; [2] Schwarz, Ann. Stat. 6 (1978), the penalty of a parameter; [3] Golub & Pereyra, SIAM J.
Numer. Anal. 10 (1973), scales with the amplitudes eliminated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.criticism.discovery.bases import Variable
from pipeline.criticism.discovery.dictionary import CENTRED, POWER, SHAPES, WAVES, Term
from pipeline.criticism.discovery.expression import Expression
from pipeline.criticism.discovery.residual_inputs import Port
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.discovery import Discovery
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import pseudo_inverse, unit_diagonal

_RIDGE = 1e-9
"""Share of a curve's own information that is added to it: two curves of one shape do not run away,
and no amplitude moves by more than that."""
Group = tuple[Term, ...]
"""Terms that come in together, as the sine and cosine of an order do."""


class Pursuit:
    """The weak columns of one residual input in hats, with the model's own parameters refitted.

    Parameters
    ----------
    system
        Its first `model_size` columns are the model's, the others those of the input.
    model_size
        Number of the model's columns.
    port
        The residual input.
    weight
        Weights of the rows [R] under the best fit of the input.

    """

    def __init__(self, system: LinearSystem, model_size: int, port: Port, weight: Array) -> None:
        self.system, self.model_size, self.port = system, model_size, port
        self.weight = weight
        self.policy = system.policy.discovery
        self.penalty = math.log(system.size)
        hats = system.matrix[:, model_size:]
        model_matrix, prior_gradient = (
            system.matrix[:, :model_size],
            system.prior_gradient[:model_size],
        )
        root = weight[:, None]
        normal = model_matrix.T @ (root * model_matrix) + np.diag(
            system.prior_precision[:model_size]
        )
        # in each parameter's own size: squares of what a fit hardly sees leave the range of numbers
        information = np.diag(normal)
        size = np.sqrt(np.where(information > 0.0, information, 1.0))
        inverse = pseudo_inverse(normal / np.outer(size, size))
        cross = (model_matrix / size).T @ (root * hats)
        slope = (model_matrix / size).T @ (weight * system.residual) + prior_gradient / size
        self.gram: Array = hats.T @ (root * hats) - cross.T @ inverse @ cross
        self.moment: Array = -(hats.T @ (weight * system.residual) - cross.T @ inverse @ slope)

    def hats_of(self, term: Term) -> Array:
        """A term as coefficients [K] of the port's hats and waves.

        Parameters
        ----------
        term
            The term.

        Returns
        -------
        array [K]
            One a column of the input.

        """
        basis = self.port.basis
        weights = np.zeros(self.system.matrix.shape[1] - self.model_size)
        if basis is None or term.kind == POWER:
            weights[term.monomial] = 1.0
            return weights
        first = term.carrier * len(basis.names)
        nodes = basis.nodes.size
        if term.kind in WAVES and term.order in basis.orders:
            place = basis.orders.index(term.order)
            weights[first + nodes + 2 * place + (term.kind == "cos")] = 1.0
        else:
            weights[first : first + nodes] = term.value(basis.nodes)
        return weights

    def linear_gain(self, known: Array, new: Array) -> float:
        """Fall of the weighted sum of squares by further curves.

        Parameters
        ----------
        known
            Curves that are there [K, k].
        new
            Further curves [K, m].

        """
        both = np.column_stack([known, new])
        return self._fall(both) - (self._fall(known) if known.shape[1] else 0.0)

    def _fall(self, curves: Array) -> float:
        return float(self.moment @ curves @ self.amplitudes(curves))

    def amplitudes(self, curves: Array) -> Array:
        """Best amplitudes of some curves.

        Parameters
        ----------
        curves
            [K, k].

        Returns
        -------
        array [k]
            In the unit of the input.

        """
        normal = curves.T @ self.gram @ curves
        solved = np.linalg.lstsq(
            normal + _RIDGE * np.diag(np.diag(normal)), curves.T @ self.moment, rcond=1e-10
        )
        return np.asarray(solved[0], dtype=np.float64)

    def curves(self, terms: Sequence[Term]) -> Array:
        """Terms as coefficients of the hats and waves of the input.

        Parameters
        ----------
        terms
            k terms.

        Returns
        -------
        array [K, k]
            One column a term.

        """
        width = self.system.matrix.shape[1] - self.model_size
        return np.column_stack([np.empty((width, 0)), *(self.hats_of(t) for t in terms)])

    def fit(self, curves: Array) -> tuple[Array, Array, Array, float]:
        """Fits curves together with the model's own parameters.

        Parameters
        ----------
        curves
            [K, k].

        Returns
        -------
        tuple
            Own step, amplitudes [k], residual [R] and deviance.

        """
        system, model_size = self.system, self.model_size
        matrix = np.column_stack(
            [system.matrix[:, :model_size], system.matrix[:, model_size:] @ curves]
        )
        prior_precision = np.concatenate(
            [system.prior_precision[:model_size], np.zeros(curves.shape[1])]
        )
        prior_gradient = np.concatenate(
            [system.prior_gradient[:model_size], np.zeros(curves.shape[1])]
        )
        weight, before = self.weight, np.inf
        step, residual, now = np.zeros(matrix.shape[1]), system.residual, np.inf
        places = np.arange(model_size)
        for _ in range(self.policy.most_rounds):
            weighted = matrix * weight[:, None]
            normal = weighted.T @ matrix + np.diag(prior_precision)
            scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
            inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-11, hermitian=True)
            step = -(inverse @ ((weighted.T @ system.residual + prior_gradient) / scale)) / scale
            residual = system.residual + matrix @ step
            reduced_chi2 = system.reduced_chi2(residual)
            now = system.deviance_of(reduced_chi2) + float(
                system.prior_costs(places, step[:model_size]).sum()
            )
            weight = system.weights(reduced_chi2)
            if abs(before - now) < system.policy.fit.settled:
                break
            before = now
        return step[:model_size], step[model_size:], residual, now


def expression(pursuit: Pursuit) -> Expression:
    """The expression at which the Bayesian information criterion stops.

    Parameters
    ----------
    pursuit
        The residual input.

    Returns
    -------
    Expression
        Of `policy.discovery.most_groups` groups at most; without terms where none is worth its
        parameters.

    """
    policy = pursuit.policy
    chosen: list[Group] = []
    nothing = pursuit.curves([])
    best = pursuit.fit(nothing)
    start = cost = best[3]
    offered = list(_dictionary(pursuit.port, policy))
    for _ in range(policy.most_groups):
        flat = [t for group in chosen for t in group]
        tried = [
            (*_judged(pursuit, [*chosen, group]), [*chosen, group])
            for group in _promising(pursuit, flat, offered)
        ]
        tried.sort(key=lambda candidate: candidate[0])
        if not tried:
            break
        now = tried[0][0]
        if cost - now < max(pursuit.system.policy.selection.tie, policy.least_gain * (start - now)):
            break
        chosen, cost = tried[0][1], now
    return _finished(pursuit, chosen, start)


def _promising(pursuit: Pursuit, known: Sequence[Term], offered: Sequence[Group]) -> list[Group]:
    """The groups that help most beside the known terms, each at its best trial scale."""
    base = pursuit.curves(known)
    best: dict[tuple[object, ...], tuple[float, Group]] = {}
    for group in offered:
        if any(t in known for t in group):
            continue
        gain = pursuit.linear_gain(base, pursuit.curves(group))
        key = tuple((t.kind, t.parity, t.carrier, t.order, t.monomial) for t in group)
        if gain > best.get(key, (0.0, group))[0]:
            best[key] = gain, group
    ranked = sorted(best.values(), key=lambda one: -one[0])
    return [group for _, group in ranked[: pursuit.policy.refined]]


def _judged(pursuit: Pursuit, groups: Sequence[Group]) -> tuple[float, list[Group]]:
    """Deviance and penalty of groups with their scales refined together."""
    refined = _refined(pursuit, groups)
    terms = [t for group in refined for t in group]
    free = sum(1 + len(t.free) for t in terms)
    deviance = pursuit.fit(pursuit.curves(terms))[3]
    return deviance + free * pursuit.penalty, refined


def _refined(pursuit: Pursuit, groups: Sequence[Group]) -> list[Group]:
    """Scales and centres of all terms at their best, amplitudes eliminated."""
    places = [
        (g, n, name)
        for g, group in enumerate(groups)
        for n, term in enumerate(group)
        for name in term.free
    ]
    if not places:
        return list(groups)

    def moved(z: Array) -> list[Group]:
        solution = [list(group) for group in groups]
        for (g, n, name), one in zip(places, z, strict=True):
            old = groups[g][n]
            if name == "scale":
                solution[g][n] = replace(solution[g][n], scale=old.scale * math.exp(one))
            elif old.kind in CENTRED:
                solution[g][n] = replace(solution[g][n], centre=old.centre * math.exp(one))
            else:
                solution[g][n] = replace(solution[g][n], centre=old.centre + one)
        return [tuple(group) for group in solution]

    def loss(z: Array) -> float:
        curves = pursuit.curves([t for group in moved(z) for t in group])
        return -pursuit._fall(curves) / size

    reach = pursuit.policy.refining_reach
    from scipy.optimize import minimize  # slow to import and rarely used

    size = max(abs(pursuit._fall(pursuit.curves([t for g in groups for t in g]))), 1e-300)
    solution = minimize(
        loss,
        np.zeros(len(places)),
        method="L-BFGS-B",
        bounds=[(-reach, reach)] * len(places),
        options={"ftol": 1e-14, "gtol": 1e-12},
    )
    return moved(solution.x) if solution.fun <= loss(np.zeros(len(places))) else list(groups)


def _dictionary(port: Port, policy: Discovery) -> Iterator[Group]:
    """Every group of terms offered for a port, at trial scales."""
    variable, basis = port.variable, port.basis
    if variable is None or basis is None:
        yield from ((Term(POWER, monomial=n),) for n in range(len(port.monomials)))
        return
    for carrier in range(len(port.carriers)):
        if variable.kind == "turn":
            yield from _turning(basis.orders, bool(basis.nodes.size), carrier, policy)
        else:
            yield from _shapes(variable, carrier, policy)


def _turning(
    orders: tuple[float, ...], curved: bool, carrier: int, policy: Discovery
) -> Iterator[Group]:
    for k in (*(range(1, policy.orders + 1) if curved else ()), *orders):
        yield Term("sin", carrier, order=k), Term("cos", carrier, order=k)
    if curved:
        for n in range(policy.centres):
            for width in policy.widths_rad:
                yield (Term("bump", carrier, scale=width, centre=2 * math.pi * n / policy.centres),)
        yield (Term("step", carrier),)


def _shapes(variable: Variable, carrier: int, policy: Discovery) -> Iterator[Group]:
    parities = {"signed": ("odd", "even"), "size": ("even",), "warm": ("plain",)}[variable.kind]
    trial = variable.top * np.geomspace(0.01, 2.0, policy.scales)
    for parity in parities:
        for shape in SHAPES:
            for scale in trial if shape.scaled else (variable.top,):
                yield (Term(shape.name, carrier, parity, float(scale)),)
        for kind, centre, width in product(CENTRED, policy.humps, policy.hump_widths):
            place, wide = centre * variable.top, width * variable.top
            yield (Term(kind, carrier, parity, wide, centre=place),)


def _finished(pursuit: Pursuit, chosen: Sequence[Group], start: float) -> Expression:
    terms = tuple(t for group in chosen for t in group)
    _, amplitudes, residual, deviance = pursuit.fit(pursuit.curves(terms))
    directions = tuple((n, name) for n, t in enumerate(terms) for name in ("amplitude", *t.free))
    columns = [
        _hat_direction(pursuit, terms[n], float(amplitudes[n]), name) for n, name in directions
    ]
    width = pursuit.system.matrix.shape[1] - pursuit.model_size
    slopes = np.column_stack([np.empty((width, 0)), *columns])
    covariance = _inverse(slopes.T @ pursuit.gram @ slopes)
    return Expression(terms, amplitudes, directions, covariance, start - deviance, residual)


def _hat_direction(pursuit: Pursuit, term: Term, amplitude: float, name: str) -> Array:
    if name == "amplitude":
        return pursuit.hats_of(term)
    step = 1e-4 * (term.scale if name == "scale" else 1.0)
    moved = replace(term, **{name: getattr(term, name) + step})
    return amplitude * (pursuit.hats_of(moved) - pursuit.hats_of(term)) / step


def _inverse(normal: Array) -> Array:
    if not normal.size:
        return normal
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.linalg.pinv(unit_diagonal(normal), hermitian=True) / np.outer(scale, scale)


def curve_about(
    pursuit: Pursuit, expression: Expression, coarse: Array, at: Array, carrier: int
) -> tuple[Array, Array]:
    """The curve of a structure and its standard uncertainty: its expression and what that leaves.

    Parameters
    ----------
    pursuit
        With the hats of the port.
    expression
        Expression.
    coarse
        Smooth curves in hats [K, k].
    at
        Where the curve is wanted [n].
    carrier
        Of the port.

    Returns
    -------
    curve, u
        [n each, unit of the port].

    Raises
    ------
    ValueError
        The port has no curve.

    Notes
    -----
    A smooth curve of what the expression leaves is added, so that the data decide where the
    expression is wrong. The model's own constants stay where the expression put them, since else a
    curve and a constant of one shape cannot be separated.

    """
    hats = pursuit.system.matrix[:, pursuit.model_size :] @ coarse
    weight = pursuit.system.weights(pursuit.system.reduced_chi2(expression.residual))
    live = np.any(hats != 0.0, axis=0)
    normal = hats[:, live].T @ (weight[:, None] * hats[:, live])
    covariance = _inverse(normal)
    step = -covariance @ (hats[:, live].T @ (weight * expression.residual))
    basis = pursuit.port.basis
    if basis is None:
        raise ValueError("a port without a curve has no hats")
    first = carrier * len(basis.names)
    shapes = (
        np.stack(
            [basis.curve(at, one[first : first + len(basis.names)]) for one in coarse[:, live].T],
            axis=1,
        )
        if live.any()
        else np.zeros((at.size, 0))
    )
    spread = np.sqrt(
        np.maximum(np.einsum("vi,ij,vj->v", shapes, covariance, shapes), 0.0)
        + expression.spread(at, carrier) ** 2
    )
    return expression.value(at, carrier) + shapes @ step, spread
