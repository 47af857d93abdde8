"""All segments as one linear system around a fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Indices, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.regression.column_validity import is_valid
from pipeline.criticism.regression.columns import Column, ColumnKey, base_columns, effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linearise import Rows, linearise, whitened_anew
from pipeline.criticism.regression.normal_equations import (
    NormalEquations,
    Prior,
    deviance_of,
    prior_costs,
    pseudo_inverse,
)
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.channels import of_acceleration


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """Weak samples of all segments, linearised at a fit.

    Rows of a group that misses its noise floor, χ²/n = q > 1, count 1/q: the likelihood of a group
    whose scatter is at least the floor but otherwise unknown. So an equation that lacks an effect
    does not move constants that sound equations determine.

    Attributes
    ----------
    columns
        Parameters; those of the model first, then candidates.
    residual, matrix
        Residual [R] and its derivatives [R, P], over the noise.
    group
        Number of the (segment, channel, order) of each row [R].
    window
        Window of each row [R].
    unit
        A residual of one as a window's mean, in the unit of the signal [R].
    noise_ratio
        Noise floor over the scale that a row was divided by [R]; below 1 where a tolerance of form
        was added.
    row_weight
        What rows were multiplied by [R].
    labels
        Segment, channel and order of each group [G].
    prior_precision
        Inverse prior variance [P]; 0 without a prior.
    prior_gradient
        Half the slope of the priors' cost [P].
    fit
        Where it was linearised.
    model_column_count
        Number of columns of the model.
    made_at
        Values at which each column was computed.

    """

    columns: tuple[Column, ...]
    residual: Array
    matrix: Array
    group: Indices
    window: Indices
    unit: Array
    noise_ratio: Array
    row_weight: Array
    labels: tuple[tuple[int, str, int], ...]
    prior_precision: Array
    prior_gradient: Array
    fit: Fit
    model_column_count: int
    made_at: Mapping[ColumnKey, Values]

    @property
    def policy(self) -> Policy:
        """What the fit goes by."""
        return self.fit.policy

    @property
    def size(self) -> int:
        """Weak samples."""
        return int(self.residual.size)

    @property
    def model_columns(self) -> Indices:
        """Places of the columns of the model's own parameters."""
        return np.arange(self.model_column_count)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """What the fit is of."""
        return self.fit.segments

    @property
    def segment(self) -> Indices:
        """Number [R] of the segment that every weak sample is of."""
        return np.array([number for number, _, _ in self.labels])[self.group]

    @property
    def counts(self) -> Array:
        """Weak samples [G] of each group."""
        return np.bincount(self.group, minlength=len(self.labels)).astype(float)

    @property
    def independent_counts(self) -> Array:
        """Weak samples [G] of independent noise that tell as much as each group does.

        n / (1 + (n − 1)ρ), where ρ is the share of the floor's variance that is no noise of the
        sensors: an allowance for what bench and model have wrong may be the same error in every
        window [Kish (1965), Survey Sampling, 5.4: the design effect].
        """
        counts = self.counts
        noise = (np.concatenate(self.fit.sigma) * self.row_weight) ** 2
        share = np.bincount(self.group, noise, counts.size) / np.maximum(counts, 1.0)
        return counts / (1.0 + np.maximum(counts - 1.0, 0.0) * (1.0 - share))

    @property
    def deviance(self) -> float:
        """−2 log likelihood, less constants, and the cost of the priors."""
        cost = float(self.prior_costs().sum())
        return self.deviance_of(self.reduced_chi2(self.residual)) + cost

    @property
    def excess(self) -> float:
        """The part of the deviance that is over noise floors and priors."""
        nats = np.log(np.maximum(self.reduced_chi2(self.residual), 1.0))
        return float(self.counts @ nats) + float(self.prior_costs().sum())

    def prior_costs(self, places: Indices | None = None, step: Array | None = None) -> Array:
        """Squared distance of every parameter from the centre of its prior, after a step.

        Parameters
        ----------
        places
            Columns that move; None for no step.
        step
            Change of each of them.

        Returns
        -------
        array [P]
            In squared standard uncertainties; 0 without a prior.

        """
        gradient = self.prior_gradient.copy()
        if places is not None and step is not None:
            gradient[places] += self.prior_precision[places] * step
        return prior_costs(gradient, self.prior_precision)

    def weights(self, reduced_chi2: Array) -> Array:
        """How much each weak sample counts.

        Parameters
        ----------
        reduced_chi2
            χ²/n of the groups [G].

        Returns
        -------
        array [R]
            1/max(χ²/n, 1) of the row's group.

        """
        by_group: Array = 1.0 / np.maximum(reduced_chi2, 1.0)
        return by_group[self.group]

    def predicted_deviance(self, step: Array) -> float:
        """Deviance after a step along the first columns, to first order.

        Parameters
        ----------
        step
            Change of the first k parameters [k].

        Returns
        -------
        float
            −2 log likelihood and the cost of the priors.

        """
        places = np.arange(step.size)
        cost = float(self.prior_costs(places, step).sum())
        return self.deviance_of(self.reduced_chi2(self.after(places, step))) + cost

    def reduced_chi2(self, residual: Array) -> Array:
        """χ²/n of each group.

        Parameters
        ----------
        residual
            Whitened [R].

        Returns
        -------
        array [G]
            1 for an empty group.

        """
        counts = self.counts
        total = np.bincount(self.group, residual**2, minlength=counts.size)
        return np.where(counts > 0, total / np.maximum(counts, 1.0), 1.0)

    def deviance_of(self, reduced_chi2: Array) -> float:
        """−2 log likelihood of the groups.

        Parameters
        ----------
        reduced_chi2
            χ²/n of the groups [G].

        """
        return deviance_of(self.counts, reduced_chi2)

    def place(self, names: Iterable[str]) -> Indices:
        """Indices of columns by name.

        Parameters
        ----------
        names
            Full names of parameters.

        Returns
        -------
        array of int
            In the order of the columns; names without a column are left out.

        """
        requested = set(names)
        return np.array([n for n, c in enumerate(self.columns) if c.name in requested], dtype=int)

    def normal_equations(self, places: Indices | None = None) -> NormalEquations:
        """Normal matrices by group.

        Parameters
        ----------
        places
            Columns; None for all.

        Returns
        -------
        NormalEquations
            The priors of the other columns cost what they cost at the fit.

        """
        selected = np.arange(len(self.columns)) if places is None else places
        elsewhere = self.prior_costs()
        elsewhere[selected] = 0.0
        prior = Prior(
            self.prior_precision[selected], self.prior_gradient[selected], float(elsewhere.sum())
        )
        rows = np.column_stack([self.residual, self.matrix[:, selected]])
        return NormalEquations.of(rows, self.group, len(self.labels), prior, self.policy.fit)

    def normal_equations_of(self, residuals: Array) -> list[NormalEquations]:
        """Normal equations of all columns with other residuals in place of its own.

        Parameters
        ----------
        residuals
            Over the noise [T, R].

        Returns
        -------
        list of NormalEquations
            One a residual.

        """
        known = self.normal_equations()
        shape = len(self.labels), len(residuals)
        slope = np.empty((*shape, len(self.columns)))
        power = np.empty(shape)
        order = np.argsort(self.group, kind="stable")
        edges = np.concatenate([[0], np.cumsum(self.counts).astype(np.int64)])
        for number, (first, end) in enumerate(pairwise(edges.tolist())):
            group_residuals = residuals[:, order[first:end]]
            slope[number] = group_residuals @ self.matrix[order[first:end]]
            power[number] = (group_residuals**2).sum(axis=1)
        return [replace(known, power=power[:, n], slope=slope[:, n]) for n in range(len(residuals))]

    def only(self, places: Indices) -> LinearSystem:
        """The same system with some of its columns.

        Parameters
        ----------
        places
            Indices of the columns.

        """
        columns = tuple(self.columns[n] for n in places.tolist())
        prior_precision, prior_gradient = self.prior_precision[places], self.prior_gradient[places]
        matrix = self.matrix[:, places]
        return replace(
            self,
            columns=columns,
            matrix=matrix,
            prior_precision=prior_precision,
            prior_gradient=prior_gradient,
            model_column_count=int(np.count_nonzero(places < self.model_column_count)),
        )

    def after(self, places: Indices, step: Array) -> Array:
        """The residual after a step along some columns, to first order.

        Parameters
        ----------
        places
            Of the columns [k].
        step
            Change of their parameters [k].

        Returns
        -------
        array [R]

        """
        return self.residual + self.matrix[:, places] @ step

    def informed(self, places: Indices) -> int:
        """Weak samples of the captures that show some columns.

        Parameters
        ----------
        places
            Of the columns [k].

        Returns
        -------
        int
            All samples of a segment that has its share of the columns' information; two at least.

        References
        ----------
        Berger, Bayarri and Pericchi, Econometric Reviews 33 (2014) 197, the effective sample size,
        doi:10.1080/07474938.2013.807157.

        """
        squares = self.matrix[:, places] ** 2
        shares = (squares / np.maximum(squares.sum(axis=0), 1e-300)).max(axis=1)
        of_segment = np.bincount(self.segment, shares, len(self.segments))
        rows = np.bincount(self.segment, minlength=len(self.segments))
        return max(int(rows[of_segment > self.policy.selection.informed_share].sum()), 2)

    def covariance(self, places: Indices) -> Array:
        """Covariance of parameters when they are fitted together.

        Parameters
        ----------
        places
            Of their columns [k].

        Returns
        -------
        array [k, k]
            (A' W A + prior precision)⁻¹ with W = 1/max(1, χ²/n) of each row's group.

        """
        weight = self.weights(self.reduced_chi2(self.residual))
        matrix = self.matrix[:, places]
        normal = (matrix * weight[:, None]).T @ matrix + np.diag(self.prior_precision[places])
        return pseudo_inverse(normal)


def linear_system(
    fit: Fit,
    candidates: Sequence[Column] = (),
    before: LinearSystem | None = None,
    chord: bool = False,
) -> LinearSystem:
    """Linearises every segment around a fit, along its own columns and those of candidates.

    Parameters
    ----------
    fit
        Model and values.
    candidates
        Columns of parameters that are not in the model.
    before
        A system around a near fit; its columns that hold at this fit too stay as they were.
    chord
        Whether all of its columns stay.

    Returns
    -------
    LinearSystem
        Residual and columns over the noise, the model's own columns first.

    """
    model, values = fit.model, fit.values
    own_columns = model_columns(model)
    columns = [*own_columns, *candidates]
    known = _reusable_columns(before, fit, columns, chord)
    new = [column for column in columns if column.key not in known]
    arguments = [(model, values, new, floor) for floor in fit.floors]
    rows = on_each(linearise, fit.segments, arguments)
    group, labels = _numbered(rows)
    prior_precision, prior_gradient = _priors(model, columns, values)
    system = LinearSystem(
        columns=tuple(columns),
        residual=np.concatenate([r.residual for r in rows]),
        matrix=_placed(columns, new, np.concatenate([r.columns for r in rows])),
        group=group,
        window=np.concatenate([r.window for r in rows]),
        unit=np.concatenate([r.unit for r in rows]),
        noise_ratio=np.concatenate([r.noise_ratio for r in rows]),
        row_weight=np.concatenate([r.row_weight for r in rows]),
        labels=labels,
        prior_precision=prior_precision,
        prior_gradient=prior_gradient,
        fit=fit,
        model_column_count=len(own_columns),
        made_at={column.key: values for column in new},
    )
    return system if before is None or not known else _with_known(system, before, known)


def _numbered(
    rows: Sequence[Rows],
) -> tuple[Indices, tuple[tuple[int, str, int], ...]]:
    """Group [R] of every row of all segments, and the groups' labels."""
    first, labels, groups = 0, [], []
    for number, one in enumerate(rows):
        labels += [(number, channel, order) for channel, order in one.groups]
        groups.append(one.group + first)
        first += len(one.groups)
    return np.concatenate(groups), tuple(labels)


def _placed(columns: Sequence[Column], new: Sequence[Column], computed: Array) -> Array:
    """A matrix [R, P] of all columns with the `new` ones in it, `computed` [R, new]."""
    matrix = np.empty((computed.shape[0], len(columns)))
    fresh = {column.key: n for n, column in enumerate(new)}
    for place, column in enumerate(columns):
        if column.key in fresh:
            matrix[:, place] = computed[:, fresh[column.key]]
    return matrix


def _with_known(
    now: LinearSystem, before: LinearSystem, known: Mapping[ColumnKey, Array]
) -> LinearSystem:
    """The system with the `known` columns of the one `before` put where its matrix is still open:
    over the noise of now, and those of a free shaft by its inertia of now.
    """
    segments = now.segments
    free = np.array([of_acceleration(segments[n], channel) for n, channel, _ in now.labels])
    inertia = before.fit.values["j_kgm2"] / now.fit.values["j_kgm2"]
    lighter = np.where(free, inertia, 1.0)[now.group]
    places = [n for n, column in enumerate(now.columns) if column.key in known]
    carried_over = np.column_stack([known[now.columns[n].key] for n in places]) * lighter[:, None]
    counts = np.bincount(now.segment, minlength=len(segments)).tolist()
    now.matrix[:, places] = _rewhitened(
        segments, carried_over, (before.row_weight, now.row_weight), counts, now.fit.machine
    )
    made_at = {**now.made_at, **{key: before.made_at[key] for key in known}}
    return replace(now, made_at=made_at)


def _rewhitened(
    segments: Sequence[Segment],
    rows: Array,
    weights: tuple[Array, Array],
    counts: Sequence[int],
    machine: Machine,
) -> Array:
    """Columns [R, P] that were whitened by the first of the `weights` [R], whitened by the second
    instead; `counts` are the rows of each segment.
    """
    before, now = weights
    if np.array_equal(before, now):
        return rows
    edges = np.cumsum(counts)[:-1]
    parts = zip(*(np.split(one, edges) for one in (rows, before, now)), strict=True)
    arguments = [(*part, machine) for part in parts]
    return np.concatenate(on_each(whitened_anew, segments, arguments))


def _reusable_columns(
    before: LinearSystem | None, fit: Fit, columns: Sequence[Column], chord: bool
) -> dict[ColumnKey, Array]:
    """Those of the columns that an earlier system has and that hold at a new fit too.

    A stale column costs no accuracy. The residual is always computed anew, a fit ends where it has
    nothing left along the columns, and the columns of two near fits span nearly the same space.
    The exceptions: once an effect of the angle is found, the columns of other effects of the angle
    have changed; and all have once one is found that may be far from zero.
    """
    if before is None:
        return {}
    known = before.fit.model.effects
    added = [e for e in fit.model.effects if e not in known]
    if any(p.starts for e in added for p in e.parameters_of(fit.model.machine)):
        return {}
    turned = any(e.angle is not None for e in added)

    def stays(column: Column) -> bool:
        of_angle = column.effect is not None and column.effect.angle is not None
        return not (turned and of_angle) and is_valid(column, before.made_at[column.key], fit)

    places = {column.key: place for place, column in enumerate(before.columns)}
    carried_over = [column for column in columns if column.key in places]
    unchanged = [column.key for column in carried_over if chord or stays(column)]
    return {key: before.matrix[:, places[key]] for key in unchanged}


def _priors(model: Model, columns: Sequence[Column], values: Values) -> tuple[Array, Array]:
    prior_precision, prior_gradient = np.zeros(len(columns)), np.zeros(len(columns))
    priors = model.priors()
    for place, column in enumerate(columns):
        if column.name in priors:
            center, u = priors[column.name]
            prior_precision[place] = u**-2
            prior_gradient[place] = (values[column.name] - center) * u**-2
    return prior_precision, prior_gradient


def model_columns(model: Model) -> list[Column]:
    """The columns of a model's own parameters, those of the base first.

    Parameters
    ----------
    model
        The model.

    """
    columns = base_columns(model.machine, base_scales(model.machine))
    for effect in model.effects:
        columns += effect_columns(effect, model)
    return columns
