"""The job of one motor, as the settings of a run ask for it."""

from __future__ import annotations

from dataclasses import asdict

from pipeline.execution.jobs import MotorJob
from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.guard import ReadLimits
from pipeline.records.comparison import ModelSpec
from pipeline.records.finding import Finding
from pipeline.settings import RunSettings


def job_of(
    settings: RunSettings,
    motor_id: str,
    config_sha256: str,
    conditions: tuple[tuple[str, ...], bool],
    model: ModelSpec,
    entries: tuple[Entry, ...] = (),
    findings: tuple[Finding, ...] = (),
) -> MotorJob:
    """The job of one motor as the settings of a run ask for it, without a key.

    Parameters
    ----------
    settings
        The keys of `run`.
    motor_id
        The motor.
    config_sha256
        Digest of what of the configuration changes its result.
    conditions
        Constants that a release requires, and whether the model's remainder keeps from one.
    model
        The model of the residual test, where the settings ask for one.
    entries
        Its captures; none where they are read already.
    findings
        On its files.

    """
    required, model_gates = conditions
    return MotorJob(
        motor_id=motor_id,
        entries=entries,
        input=settings.input,
        output=settings.output,
        config_sha256=config_sha256,
        required=required,
        release=settings.release,
        report=settings.report,
        recordings=settings.recordings,
        gates=settings.gates,
        fit=settings.fit,
        constants=settings.constants,
        crosscheck=settings.crosscheck,
        model=model if settings.residual_test else None,
        diagnose=settings.diagnose,
        model_gates=model_gates,
        operate=asdict(settings.operate),
        findings=findings,
        limits=ReadLimits(settings.read_seconds, settings.read_memory_mb),
    )
