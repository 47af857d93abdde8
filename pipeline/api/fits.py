"""Estimating and checking: recordings in, constants with uncertainty and datasheets out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl

from pipeline.api import frames
from pipeline.api.by_motor import ByMotor
from pipeline.api.figure import Figure, figure
from pipeline.api.options import check_options
from pipeline.api.recordings import Options, Recordings, recordings_of
from pipeline.estimation.registry import Failure, fit_all
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.evidence import Evidence
from pipeline.settings import RunSettings
from pipeline.views.tables import CONSTANT_SCHEMA, constant_rows, numbers, texts

RESIDUAL_SCHEMA = {
    **texts("motor_id estimator plot capture series x_name"),
    "x": pl.Float64,
    "y_name": pl.String,
    **numbers("measured fitted residual"),
}


@dataclass(frozen=True, slots=True)
class MotorFit:
    """The estimates of one motor.

    Attributes
    ----------
    campaign : Campaign
        The captures that were fitted, with the stated constants.
    constants : Constants
        Every estimate; `constants.best("ld_h")` is the preferred one of a name.
    evidence : tuple of Evidence
        The plots: measured and fitted series.
    failures : tuple of Failure
        Estimators that failed on these captures, with the reason.
    sources : tuple of SourceMap
        The source maps by which the captures were read.

    """

    campaign: Campaign
    constants: Constants = field(repr=False)
    evidence: tuple[Evidence, ...] = field(repr=False)
    failures: tuple[Failure, ...]
    sources: tuple[SourceMap, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class Fits(ByMotor[MotorFit]):
    """Estimates of every motor, before any check.

    Attributes
    ----------
    motors : mapping of str to MotorFit
        The estimates by motor_id.
    options : mapping of mapping
        The options of the estimators.
    stated : mapping of str to float
        The constants that were stated [SI].

    """

    options: Options = field(default_factory=dict)
    stated: Mapping[str, float] = field(default_factory=dict)

    @property
    def constants(self) -> pl.DataFrame:
        """One row a motor and constant, SI units: value, u, 95 % interval, status, captures."""
        return self._rows(alternatives=False)

    @property
    def alternatives(self) -> pl.DataFrame:
        """The same constants by other methods than the chosen one."""
        return self._rows(alternatives=True)

    @property
    def residuals(self) -> pl.DataFrame:
        """One row a point of every fit: measured, fitted and their difference [unit of y]."""
        parts: list[pl.DataFrame] = []
        for motor_id, fit in self.motors.items():
            for one in fit.evidence:
                parts += _residual_frames(motor_id, one)
        return pl.concat(parts) if parts else pl.DataFrame(schema=RESIDUAL_SCHEMA)

    def plot(self, estimator: str, motor: str | None = None) -> tuple[Figure, ...]:
        """The plots of one estimator: measured, fitted, and the residual below.

        Parameters
        ----------
        estimator : str
            Name of the estimator, for instance `"current_step"`.
        motor : str, optional
            A motor_id; the first motor without it.

        Returns
        -------
        tuple of Figure
            One figure a plot.

        Raises
        ------
        KeyError
            If the estimator has no plot of this motor.

        """
        from pipeline.report.charts.chart import chart

        motor_id = self.motor_or_first(motor)
        drawn = [e for e in self[motor_id].evidence if e.estimator == estimator]
        if not drawn:
            known = dict.fromkeys(e.estimator for e in self[motor_id].evidence)
            raise KeyError(f"{motor_id}: no plot of {estimator}; there are {', '.join(known)}")
        return tuple(figure(f"{motor_id}: {one.title}", chart(one)) for one in drawn)

    def _rows(self, *, alternatives: bool) -> pl.DataFrame:
        rows = []
        for motor_id, fit in self.motors.items():
            constants = fit.constants
            chosen = constants.rest() if alternatives else tuple(constants.chosen().values())
            motor_type, lot = (fit.campaign.text(key) for key in ("motor_type", "lot"))
            rows += constant_rows(motor_id, motor_type, lot, chosen)
        return frames.frame(rows, CONSTANT_SCHEMA)

    def _table(self) -> pl.DataFrame:
        known = self.constants.filter(pl.col("value").is_not_null())
        return known.select("motor_id", "constant", "value", "u", "unit", "method")


def fit(
    recordings: Recordings | str | Path,
    *,
    constants: Mapping[str, float] | None = None,
    options: Options | None = None,
) -> Fits:
    """Estimates every constant that the captures of each motor determine.

    Parameters
    ----------
    recordings : Recordings or path
        The result of `read` or `simulate`, or a folder to read.
    constants : mapping of str to float, optional
        Stated constants and their standard uncertainties [SI units of the glossary]:
        `{"kt_peak_nm_a": 0.118, "u_kt_peak_nm_a": 0.002}`.
    options : mapping of mapping, optional
        Options by estimator [units in the estimator's file], for instance
        `{"torque_map": {"level": 0.001}}`.

    Returns
    -------
    Fits
        A constant that is not determined is `not_identifiable` and names the test to record.

    Raises
    ------
    UsageError
        For an unknown estimator, option or constant.

    Notes
    -----
    An uncertainty is the root sum of squares of its contributions, by the law of propagation
    (JCGM 100:2008).
    Contributions that two constants share, such as the gain of an instrument, are correlated and
    cancel where they can.

    References
    ----------
    JCGM 100:2008, Guide to the expression of uncertainty in measurement.
    https://doi.org/10.59161/JCGM100-2008E

    Examples
    --------
    >>> import pipeline
    >>> import polars as pl
    >>> recordings = pipeline.read("data/demo", motor="G52-0601")
    >>> fits = pipeline.fit(recordings.only(tests=("open_circuit",)))
    >>> row = fits.constants.row(by_predicate=pl.col("constant") == "pole_pairs", named=True)
    >>> row["value"], row["status"]
    (7.0, 'measured')

    """
    chosen, stated = dict(options or {}), dict(constants or {})
    check_options(RunSettings(fit=chosen, constants=stated))
    given = recordings_of(recordings)
    motors = {}
    for name, campaign in given.campaigns.items():
        known = replace(campaign, stated=stated)
        motors[name] = MotorFit(known, *fit_all(known, chosen), given.sources.get(name, ()))
    return Fits(motors, chosen, stated)


def _residual_frames(motor_id: str, evidence: Evidence) -> Iterator[pl.DataFrame]:
    for series in evidence.series:
        n = series.x.size
        fitted = series.fitted if series.fitted.size == n else np.full(n, np.nan)
        words = {
            "motor_id": motor_id,
            "estimator": evidence.estimator,
            "plot": evidence.title,
            "capture": evidence.capture,
            "series": series.label,
            "x_name": evidence.x_name,
            "y_name": evidence.y_name,
        }
        numbers = pl.DataFrame(
            {
                "x": np.asarray(series.x, np.float64),
                "measured": np.asarray(series.measured, np.float64),
                "fitted": np.asarray(fitted, np.float64),
                "residual": np.asarray(series.measured - fitted, np.float64),
            }
        )
        constant = [pl.lit(word, pl.String).alias(name) for name, word in words.items()]
        yield numbers.with_columns(constant).select(list(RESIDUAL_SCHEMA))
