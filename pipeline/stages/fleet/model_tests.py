"""The residual test of one motor, in a worker: a model held against its captures, once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.fit.registry import BROKEN
from pipeline.io.code_version import rooms_digest
from pipeline.io.sealed import keep_sealed, read_sealed
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.finding import Finding
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.naming import file_stem
from pipeline.stages.fleet.jobs import MotorJob
from pipeline.stages.fleet.keeping import FOLDER, libraries_version
from pipeline.stages.fleet.keys import key_of, model_parts

SWITCHED_OFF = ModelVerdict("not_tested", note="residual_test=false")
ROOMS = ("criticism", "numerics", "physics", "records")
"""Packages whose code the test hangs on: effects are found there, and not imported by name."""


class ModelMemory:
    """The verdict on one motor's model that an earlier run came to, kept in one file."""

    def __init__(self, job: MotorJob, readings: Sequence[str], version: str) -> None:
        """`readings` are digests of the captures as read; `version` is to be made of them."""
        self._path = Path(job.output) / FOLDER / "models" / f"{file_stem(job.motor_id)}.json"
        self._campaign = [job.motor_id, *readings]
        self._doubt = [revoked for revoked in job.revoked if revoked.version == version]

    def key(self, model: ModelSpec, start: Constants) -> str:
        """What the verdict hangs on."""
        code, libraries = rooms_digest(ROOMS), libraries_version()
        known = start.estimates
        return key_of(model_parts(code, libraries, self._campaign, model, known, self._doubt))

    def recall(self, key: str) -> ModelVerdict | None:
        """The verdict of this key; None where another one is kept, or none."""
        kept = read_sealed(self._path)
        if kept is None or kept["key"] != key:
            return None
        return ModelVerdict.of(kept["model"])

    def keep(self, key: str, found: ModelVerdict) -> None:
        """Keeps a verdict; a place that cannot be written is no failure."""
        keep_sealed(self._path, {"key": key, "model": found.document()})


def judged_model(
    campaign: Campaign,
    model: ModelSpec | None,
    constants: Constants,
    memory: ModelMemory | None = None,
) -> tuple[ModelVerdict, tuple[Finding, ...]]:
    """The verdict on a model of one motor, `not_tested` for none, and what went wrong in the test.

    A test that breaks on some captures costs itself and not the datasheet. Raises UsageError for a
    model or an effect that there is not.
    """
    if model is None:
        return SWITCHED_OFF, ()
    from pipeline.criticism.adequacy import model_verdict
    from pipeline.stages.campaigns import start_constants

    try:
        start = start_constants(campaign, constants)
        key = "" if memory is None else memory.key(model, start)
        found = None if memory is None else memory.recall(key)
        if found is None:
            found = model_verdict(campaign, model, start)
            if memory is not None:
                memory.keep(key, found)
    except (*BROKEN, MemoryError) as error:
        said = f"the residual test broke on these captures: {type(error).__name__}: {error}"
        remedy = "the constants stand; report the captures with this line"
        broken = Finding(campaign.motor_id, "warning", "residual_test_failed", said, remedy)
        return ModelVerdict("not_tested", model.name, model.effects, note=said), (broken,)
    return found, ()
