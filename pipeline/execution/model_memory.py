"""Verdicts of the residual test that need not be come to again."""

from __future__ import annotations

from pathlib import Path

from pipeline.execution.jobs import MotorJob
from pipeline.execution.keeping import FOLDER
from pipeline.execution.keys import key_of, model_parts
from pipeline.execution.work import Stamp
from pipeline.io.storage.code_version import closure_digest, libraries_version
from pipeline.io.storage.sealed import keep_sealed, read_sealed
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.naming import file_stem

TEST = "pipeline.execution.model_tests"
"""What makes the test, with the effects that it finds."""


class ModelMemory:
    """The verdict on one motor's model that an earlier run came to, kept in one file."""

    def __init__(self, job: MotorJob, stamp: Stamp) -> None:
        """`stamp` is of the datasheet to be made; where it was revoked, no verdict is recalled."""
        self._path = Path(job.output) / FOLDER / "models" / f"{file_stem(job.motor_id)}.json"
        self._campaign = stamp.campaign
        self._doubt = [revoked for revoked in job.revoked if revoked.version == stamp.version]

    def key(self, model: ModelSpec, start: Constants) -> str:
        """What the verdict hangs on."""
        code, libraries = closure_digest(TEST), libraries_version(TEST)
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
