"""Datasheets of constants alone."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict


def sheet_of(constants: Mapping[str, Estimate], model: ModelVerdict | None = None) -> Datasheet:
    """A provisional datasheet of these constants."""
    return Datasheet(
        motor_id="m-1",
        motor_type="test",
        lot=None,
        version="0" * 64,
        status="provisional",
        why=(),
        captures=(),
        config_sha256="0" * 64,
        code_version="0",
        constants=constants,
        alternatives=(),
        checks=(),
        model=model,
    )
