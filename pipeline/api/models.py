"""Models compared with recordings: their errors, and the physical effects that they lack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from pipeline.api import frames
from pipeline.api.by_motor import ByMotor
from pipeline.api.figure import Figure, figure
from pipeline.api.options import check_constants, names_of
from pipeline.api.recordings import Recordings, recordings_of
from pipeline.execution.tasks.start import start_constants
from pipeline.records.capture import Campaign
from pipeline.records.comparison import Comparison, ModelSpec
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.errors import UsageError
from pipeline.records.evidence import Evidence, Series
from pipeline.views.tables import numbers, texts

ERROR_SCHEMA = {
    **texts("motor_id signal capture kind split"),
    **numbers("rmse noise_floor ratio"),
    "unit": pl.String,
    "n": pl.Int64,
    "n_eff": pl.Float64,
}
COMPARISON_SCHEMA = {
    **texts("motor_id model"),
    "effects": pl.List(pl.String),
    "held_out": pl.Float64,
}
TRACE_SCHEMA = texts("motor_id capture signal kind split") | numbers("t_s measured model residual")
PARAMETER_SCHEMA = texts("motor_id parameter") | numbers("value u") | texts("unit")
LADDER_SCHEMA = {
    "motor_id": pl.String,
    "step": pl.Int64,
    "added": pl.String,
    "held_out": pl.Float64,
    "signal": pl.String,
    "rmse": pl.Float64,
    "noise_floor": pl.Float64,
    "unit": pl.String,
}
RANKING_SCHEMA = {
    "motor_id": pl.String,
    "effect": pl.String,
    "missing": pl.Boolean,
    **numbers("score held_out_drop p_value"),
    "confused_with": pl.List(pl.String),
    **texts("explanation experiment"),
}


@dataclass(frozen=True, slots=True, repr=False)
class Comparisons(ByMotor[Comparison]):
    """One comparison a motor. Errors are of window means; a ratio of 1 is the noise floor.

    Attributes
    ----------
    motors : mapping of str to Comparison
        The comparisons by motor_id.

    """

    @property
    def errors(self) -> pl.DataFrame:
        """One row a signal and capture: rmse and noise floor [unit], and their ratio."""
        rows = [
            {"motor_id": name, **one.document(), "ratio": one.rmse / one.noise_floor}
            for name, model in self.motors.items()
            for one in model.errors
        ]
        return frames.frame(rows, ERROR_SCHEMA)

    @property
    def parameters(self) -> pl.DataFrame:
        """One row a fitted parameter; a parameter that the data do not determine has no value."""
        rows = [
            {"motor_id": name, "parameter": key, **one.document()}
            for name, model in self.motors.items()
            for key, one in model.parameters.items()
        ]
        return frames.frame(rows, PARAMETER_SCHEMA)

    @property
    def residuals(self) -> pl.DataFrame:
        """One row a sample of every trace: measured, model and their difference."""
        parts = [
            pl.DataFrame(
                {
                    "t_s": one.t_s,
                    "measured": one.measured,
                    "model": one.model,
                    "residual": one.measured - one.model,
                }
            ).select(
                pl.lit(name).alias("motor_id"),
                pl.lit(one.capture).alias("capture"),
                pl.lit(one.signal).alias("signal"),
                pl.lit(one.kind).alias("kind"),
                pl.lit(one.split).alias("split"),
                pl.all(),
            )
            for name, model in self.motors.items()
            for one in model.traces
        ]
        return pl.concat(parts) if parts else pl.DataFrame(schema=TRACE_SCHEMA)

    def plot(self, signal: str, capture: str, motor: str | None = None) -> Figure:
        """One signal of one capture: measured, model, and the residual below.

        Parameters
        ----------
        signal, capture : str
            As in the columns of `residuals`.
        motor : str, optional
            A motor_id; the first motor without it.

        Returns
        -------
        Figure
            Measured and model over time [s], in the unit of the signal.

        Raises
        ------
        KeyError
            If the comparison has no such trace.

        """
        from pipeline.report.charts.chart import chart

        motor_id = self.motor_or_first(motor)
        for one in self[motor_id].traces:
            if (one.signal, one.capture) == (signal, capture):
                series = Series("", one.t_s, one.measured, one.model)
                drawn = Evidence("model", signal, "t_s", signal, "line", (series,), capture)
                return figure(f"{motor_id}: {signal} of {capture}", chart(drawn))
        raise KeyError(f"{motor_id}: no trace of {signal} in {capture}")

    def _table(self) -> pl.DataFrame:
        rows = [(n, one.name, list(one.effects), one.held_out) for n, one in self.motors.items()]
        return pl.DataFrame(rows, schema=COMPARISON_SCHEMA, orient="row")


@dataclass(frozen=True, slots=True, repr=False)
class Diagnoses(ByMotor[Diagnosis]):
    """One diagnosis a motor: the missing effects, their evidence, and their alternatives.

    Attributes
    ----------
    motors : mapping of str to Diagnosis
        The diagnoses by motor_id.

    """

    @property
    def verdicts(self) -> pl.DataFrame:
        """One row a motor: verdict and missing effects."""
        rows = [(name, one.verdict, list(one.missing)) for name, one in self.motors.items()]
        schema = {"motor_id": pl.String, "verdict": pl.String, "missing": pl.List(pl.String)}
        return frames.frame([dict(zip(schema, row, strict=True)) for row in rows], schema)

    @property
    def ladder(self) -> pl.DataFrame:
        """One row a step and signal: the held-out error as effects are added, 1 at the floor."""
        rows = []
        for name, model in self.motors.items():
            for step, at in enumerate(model.ladder):
                before = model.ladder[step - 1].effects if step else ()
                added = ", ".join(e for e in at.effects if e not in before)
                common = {"motor_id": name, "step": step, "added": added, "held_out": at.held_out}
                rows += [
                    {**common, "signal": signal, **error.document()}
                    for signal, error in at.errors.items()
                ]
        return frames.frame(rows, LADDER_SCHEMA)

    @property
    def ranking(self) -> pl.DataFrame:
        """One row an effect: its evidence, and the effects it could be confused with."""
        rows = [
            {"motor_id": name, "missing": one.effect in model.missing, **one.document()}
            for name, model in self.motors.items()
            for one in model.ranking
        ]
        return frames.frame(rows, RANKING_SCHEMA)

    def plot(self, motor: str | None = None) -> Figure:
        """The ladder of one motor: each signal's held-out error over its noise floor by step.

        Parameters
        ----------
        motor : str, optional
            A motor_id; the first motor without it.

        Returns
        -------
        Figure
            One line a signal; 1 is the noise floor.

        Raises
        ------
        ValueError
            If the diagnosis has no ladder, as the captures could not fit the model.

        """
        from pipeline.report.charts.step_chart import step_chart

        motor_id = self.motor_or_first(motor)
        if not self[motor_id].ladder:
            notes = "; ".join(self[motor_id].notes)
            raise ValueError(f"{motor_id}: no ladder to draw: {notes}")
        ladder = self.ladder.filter(pl.col("motor_id") == motor_id)
        steps = ladder.unique("step", maintain_order=True)["added"].to_list()
        over = {
            str(name[0]): (part["rmse"] / part["noise_floor"]).to_list()
            for name, part in ladder.group_by("signal", maintain_order=True)
            if part.height == len(steps)
        }
        whole = self[motor_id].whole_model
        names = [f"+ {added}" if added else whole for added in steps]
        return figure(f"{motor_id}: error by step", step_chart(names, over))

    def _table(self) -> pl.DataFrame:
        return self.verdicts


def compare(
    recordings: Recordings | str | Path,
    model: str = "standard",
    effects: Sequence[str] = (),
    *,
    effects_path: str | None = None,
    policy: Mapping[str, Any] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Comparisons:
    """Compares a model with measurements that it was not fitted to, signal by signal.

    Parameters
    ----------
    recordings : Recordings or path
        The result of `read` or `simulate`, or a folder to read.
    model : str
        `ideal`, or `standard`: with copper and magnet temperature and Coulomb friction.
    effects : sequence of str
        Effects to add; a name with a leading `-` removes one.
    effects_path : str, optional
        Folder of your own effects, one file each.
    policy : mapping of mapping, optional
        Constants of judgement that differ from the defaults [units in docs/policy.md]:
        `{section: {field: number}}`.
    constants : mapping of float, optional
        Stated constants [units of the glossary], which are priors of the fit:
        `{"kt_peak_nm_a": 0.118, "u_kt_peak_nm_a": 0.002}`.

    Returns
    -------
    Comparisons
        Held-out errors over their noise floors, fitted parameters, traces.

    Raises
    ------
    UsageError
        For an unknown model or effect.

    Notes
    -----
    Every capture is predicted by a model that was fitted to the others (Stone, 1974). The page
    "Criticism" describes the equations and the noise floors.

    References
    ----------
    Stone, Cross-validatory choice and assessment of statistical predictions,
    J. R. Stat. Soc. B 36 (1974) 111-147. https://doi.org/10.1111/j.2517-6161.1974.tb00994.x

    Examples
    --------
    A motor with an unmodelled bump of friction at low speed coasts down:

    >>> import pipeline
    >>> hidden = pipeline.simulate("gimbal-5208", ["stribeck"], seed=3, exact=True)
    >>> recordings = hidden.only(tests=("spin_down", "cogging"))
    >>> errors = pipeline.compare(recordings, effects=["cogging"]).errors
    >>> errors.filter(errors["ratio"] > 100)["capture"].unique(maintain_order=True).to_list()
    ['spin_down_backward', 'spin_down_forward']

    """
    from pipeline.criticism.comparison import compare as compare_one

    spec = model_spec(model, effects, effects_path, policy)
    campaigns = _stated(recordings_of(recordings).campaigns, constants)
    return Comparisons({n: compare_one(c, spec, start_constants(c)) for n, c in campaigns.items()})


def diagnose(
    recordings: Recordings | str | Path,
    model: str = "standard",
    effects: Sequence[str] = (),
    *,
    effects_path: str | None = None,
    policy: Mapping[str, Any] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Diagnoses:
    """Names the physical effects that a model lacks, or reports that no known effect explains it.

    Parameters
    ----------
    recordings : Recordings or path
        The result of `read` or `simulate`, or a folder to read.
    model : str
        `ideal`, or `standard`: with copper and magnet temperature and Coulomb friction.
    effects : sequence of str
        Effects that are known to be present; a name with a leading `-` removes one.
    effects_path : str, optional
        Folder of your own effects, one file each.
    policy : mapping of mapping, optional
        Constants of judgement that differ from the defaults [units in docs/policy.md]:
        `{section: {field: number}}`.
    constants : mapping of float, optional
        Stated constants [units of the glossary], which are priors of the fit:
        `{"kt_peak_nm_a": 0.118, "u_kt_peak_nm_a": 0.002}`.

    Returns
    -------
    Diagnoses
        The verdict of each motor (`adequate`, `missing`, `unknown` or `insufficient`), the ladder
        of held-out errors as effects are added, and the ranking of all effects.

    Raises
    ------
    UsageError
        For an unknown model or effect.

    Notes
    -----
    Effects are added one by one while they lower the deviance by more than their BIC penalty
    (Schwarz, 1978) and lower the held-out error.

    References
    ----------
    Schwarz, Estimating the dimension of a model, Ann. Stat. 6 (1978) 461-464.
    https://doi.org/10.1214/aos/1176344136

    Examples
    --------
    >>> import pipeline
    >>> hidden = pipeline.simulate("gimbal-5208", ["stribeck"], seed=3, exact=True)
    >>> recordings = hidden.only(tests=("spin_down", "drive"))
    >>> pipeline.diagnose(recordings, effects=["cogging"])["gimbal-5208-3"].missing
    ('stribeck',)

    """
    from pipeline.criticism.diagnosis import diagnose as diagnose_one

    spec = model_spec(model, effects, effects_path, policy)
    campaigns = _stated(recordings_of(recordings).campaigns, constants)
    return Diagnoses({n: diagnose_one(c, spec, start_constants(c)) for n, c in campaigns.items()})


def _stated(
    campaigns: Mapping[str, Campaign], constants: Mapping[str, float] | None
) -> dict[str, Campaign]:
    """The campaigns with what is stated of their motors."""
    check_constants(constants or {})
    return {n: replace(c, stated={**c.stated, **(constants or {})}) for n, c in campaigns.items()}


def model_spec(
    name: str,
    effects: Sequence[str],
    effects_path: str | None = None,
    policy: Mapping[str, Any] | None = None,
) -> ModelSpec:
    """The model that a caller asks for, with every name in it checked.

    Parameters
    ----------
    name
        `ideal` or `standard`.
    effects
        Names of effects to add; a name that begins with `-` is left out of the model.
    effects_path
        Folder with effects of the user's own; None without any.
    policy
        Constants of judgement that differ from the default ones, by section and field.

    Returns
    -------
    ModelSpec
        The model, its policy reduced to what differs from the default.

    Raises
    ------
    UsageError
        There is no such model, effect or field of the policy.

    """
    from pipeline.criticism.library.named_models import MODELS
    from pipeline.criticism.library.registry import known_effects
    from pipeline.criticism.policy.policy import policy_changes

    if name not in MODELS:
        raise UsageError(f"no model {name!r}", f"known are {', '.join(MODELS)}")
    names = names_of(effects)
    known_effects(names, effects_path)
    return ModelSpec(name, tuple(names), effects_path, policy_changes(policy or {}))
