"""A cache of verdicts of the residual test."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

from pipeline.execution.caches.keys import ModelParts, key_of
from pipeline.execution.caches.run_cache import FOLDER
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.work import Stamp
from pipeline.io.storage.checksummed import keep_checksummed, read_checksummed
from pipeline.io.storage.code_version import closure_digest, libraries_version
from pipeline.io.storage.locks import one_at_a_time
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.naming import file_stem

TEST = "pipeline.execution.tasks.model_tests"
"""The module that runs the test; its imports include the effects."""


class ModelMemory:
    """The cached verdict on one motor's model, in one file."""

    def __init__(self, job: MotorJob, stamp: Stamp) -> None:
        """`stamp` is of the new datasheet; a verdict of a revoked version is not used."""
        self._path = Path(job.output) / FOLDER / "models" / f"{file_stem(job.motor_id)}.json"
        self._campaign = stamp.campaign
        self._search = job.diagnose != "false"
        self._revoked = [revoked for revoked in job.revoked if revoked.version == stamp.version]

    def one_at_a_time(self) -> AbstractContextManager[None]:
        """Waits for the process that makes this motor's verdict, if there is one."""
        return one_at_a_time(self._path.with_suffix(".lock"))

    def key(self, model: ModelSpec, start: Constants) -> str:
        """The key of everything that the verdict depends on.

        Parameters
        ----------
        model
            The model and its effects.
        start
            Constants that the fit starts from.

        """
        code, libraries, known = closure_digest(TEST), libraries_version(TEST), start.estimates
        parts = self._campaign, model, known, self._revoked, self._search
        return key_of(ModelParts(code, libraries, *parts))

    def recall(self, key: str) -> ModelVerdict | None:
        """The cached verdict of this key, else None.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.

        """
        entry = read_checksummed(self._path)
        if entry is None or entry["key"] != key:
            return None
        return ModelVerdict.of(entry["model"])

    def keep(self, key: str, verdict: ModelVerdict) -> None:
        """Stores a verdict; a place that cannot be written is no failure.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.
        verdict
            The verdict.

        """
        keep_checksummed(self._path, {"key": key, "model": verdict.document()})
