"""Datasheets: made from fits by cross-checks, or loaded from the output of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from pipeline.api import frames
from pipeline.api.by_motor import ByMotor
from pipeline.api.fits import Fits, MotorFit
from pipeline.api.models import model_spec
from pipeline.api.options import check_options, names_of
from pipeline.api.recordings import Options
from pipeline.execution.caches.stamp import configuration_digest, stamp_of
from pipeline.execution.run_job import job_of
from pipeline.execution.tasks import work
from pipeline.io.storage.datasheets import read_datasheets
from pipeline.io.storage.diagnoses import read_diagnoses
from pipeline.io.storage.limits import limits_file, release_conditions
from pipeline.records.datasheet import Datasheet
from pipeline.records.diagnosis_summary import DiagnosisSummary
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Stopwatch
from pipeline.settings import ModelSettings, RunSettings
from pipeline.views.tables import CONSTANT_SCHEMA, constant_rows, texts

DATASHEET_SCHEMA = {
    **texts("motor_id motor_type lot status"),
    "why": pl.List(pl.String),
    **texts("version code_version"),
}


@dataclass(frozen=True, slots=True, repr=False)
class Datasheets(ByMotor[Datasheet]):
    """Datasheets by motor.

    Attributes
    ----------
    motors : mapping of str to Datasheet
        The datasheets by motor_id.
    diagnoses : mapping of str to DiagnosisSummary
        The diagnoses of an output folder by motor_id; empty for datasheets made by `check`.

    """

    diagnoses: Mapping[str, DiagnosisSummary] = field(default_factory=dict)

    @property
    def constants(self) -> pl.DataFrame:
        """One row a motor and constant, SI units: value, u, 95 % interval, status, captures."""
        rows = [
            row
            for name, one in self.motors.items()
            for row in constant_rows(
                name, one.motor_type, one.lot, (e for _, e in sorted(one.constants.items()))
            )
        ]
        return frames.frame(rows, CONSTANT_SCHEMA)

    @property
    def checks(self) -> pl.DataFrame:
        """One row a motor and cross-check: status, value, limit, meaning, suspect."""
        rows = [r for n, one in self.motors.items() for r in frames.check_rows(n, one.checks)]
        return frames.frame(rows, frames.CHECK_SCHEMA)

    @property
    def summary(self) -> pl.DataFrame:
        """One row a motor: status with its reasons, and version."""
        rows = [
            {
                "motor_id": name,
                "motor_type": one.motor_type,
                "lot": one.lot,
                "status": one.status,
                "why": list(one.why),
                "version": one.version,
                "code_version": one.code_version,
            }
            for name, one in self.motors.items()
        ]
        return frames.frame(rows, DATASHEET_SCHEMA)

    def _table(self) -> pl.DataFrame:
        return self.summary.select("motor_id", "lot", "status", "why")


def check(
    fits: Fits,
    *,
    limits: str = "default",
    release: str = "manual",
    options: Options | None = None,
    model: str | None = "standard",
    effects: Sequence[str] = (),
    diagnose: bool = True,
) -> Datasheets:
    """Cross-checks the constants of each motor and puts its datasheet together.

    Parameters
    ----------
    fits : Fits
        The result of `fit`.
    limits : str
        Name of a file of `conf/limits/`, or a path. It names the constants that a release requires.
    release : str
        `manual`: a person approves in the registry; `auto`: released if nothing is missing.
    options : mapping of mapping, optional
        Options by check [units in the check's file].
    model : str, optional
        The model of the residual test; None for no residual test.
    effects : sequence of str
        Effects to add to the model.
    diagnose : bool
        Name what the model lacks, with sizes, where its residuals are over their noise floor.

    Returns
    -------
    Datasheets
        One datasheet a motor: `released`, `provisional` or `refused`, with the reasons.

    Raises
    ------
    UsageError
        For an unknown limits file, release, check, option, model or effect.
    TypeError
        For anything but the result of `fit`.

    Examples
    --------
    >>> import pipeline
    >>> import polars as pl
    >>> recordings = pipeline.read("data/demo", motor="G52-1402")
    >>> fits = pipeline.fit(recordings.only(tests=("resistance",)))
    >>> sheets = pipeline.check(fits, model=None)
    >>> sheets["G52-1402"].status
    'refused'
    >>> sheets.checks.filter(pl.col("status") == "fail")["check"].to_list()
    ['resistance_balance']

    """
    if not isinstance(fits, Fits):
        raise TypeError(f"check takes the result of fit, not a {type(fits).__name__}")
    if release not in ("manual", "auto"):
        raise UsageError(f"release={release} is unknown", "it is manual or auto")
    settings = RunSettings(
        fit=dict(fits.options),
        constants=dict(fits.stated),
        crosscheck=dict(options or {}),
        limits=limits,
        release=release,
        residual_test=model is not None,
        model=ModelSettings(name=model or "standard", effects=names_of(effects)),
        diagnose="auto" if diagnose else "false",
    )
    check_options(settings)
    conditions = release_conditions(limits_file(limits))
    sheets = {name: _datasheet(one, settings, conditions) for name, one in fits.motors.items()}
    return Datasheets(sheets)


def _datasheet(
    fit: MotorFit, settings: RunSettings, conditions: tuple[tuple[str, ...], bool]
) -> Datasheet:
    required, model_gates = conditions
    model = model_spec(settings.model.name, settings.model.effects, policy=settings.policy)
    digest = configuration_digest(settings, required, fit.sources, model_gates=model_gates)
    job = job_of(settings, fit.campaign.motor_id, digest, conditions, model)
    checked = work.check(job, fit.campaign, fit.constants, Stopwatch())
    judged = work.with_verdict(job, fit.campaign, checked, None, Stopwatch())
    return work.assemble(job, fit.campaign, judged, stamp_of(job, fit.campaign))


def load(output: str | Path) -> Datasheets:
    """Reads the datasheets and diagnoses of an output folder of `run`.

    Parameters
    ----------
    output : path
        The output folder of a run.

    Returns
    -------
    Datasheets
        The datasheets as published. Approvals are in the registry.

    Raises
    ------
    UsageError
        If the folder holds no datasheet, or a file that is no datasheet.

    Examples
    --------
    >>> import pipeline
    >>> pipeline.load("data/demo")
    Traceback (most recent call last):
    ...
    pipeline.records.errors.UsageError: no datasheets in data/demo; name the output folder of a run

    """
    place = Path(output)
    sheets = {one.motor_id: one for one in read_datasheets(place)}
    return Datasheets(sheets, read_diagnoses([place / "diagnosis"]))
