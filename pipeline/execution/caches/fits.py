"""Caches of one motor: its fits, and the verdict of its residual test.

A fit depends on the code of the estimator's file and of everything that it imports, on its options,
on the captures as read and validated (every number, name, mask and entry of metadata), and on the
constants that the estimator declares to use. A changed estimator is fitted again. Estimators that
use its constants follow only if these have changed. Whatever changes what is read (a unit in a
source map, a sidecar, a gate's limit) changes the captures, and so the fits.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.registry import homes
from pipeline.execution.caches.keys import FitParts, ModelParts, key_of
from pipeline.execution.caches.run_cache import FOLDER
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.work import Stamp
from pipeline.io.storage.checksummed import keep_body, keep_checksummed, read_body, read_checksummed
from pipeline.io.storage.code_version import closure_digest, libraries_version
from pipeline.io.storage.locks import one_at_a_time
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.naming import file_stem
from pipeline.records.plain_form import record_of

TEST = "pipeline.execution.tasks.model_tests"
"""The module that runs the test; its imports include the effects."""
_MAX_BYTES = 2**30


class FitMemory:
    """The cached fits of one motor, in one file."""

    def __init__(self, job: MotorJob, stamp: Stamp) -> None:
        """`stamp` is of the new datasheet; fits of a revoked version are not used."""
        self._path = Path(job.output) / FOLDER / "fits" / f"{file_stem(job.motor_id)}.fits"
        self._kept = _load(self._path)
        self._homes = homes()
        self._used: dict[str, tuple[str, bytes, bytes]] = {}
        self._campaign = stamp.campaign
        self._revoked = [revoked for revoked in job.revoked if revoked.version == stamp.version]

    def __call__(
        self,
        estimator: Estimator,
        known: Constants,
        options: Mapping[str, float],
        fit: Callable[[], Fit],
    ) -> Fit:
        """The cached fit, or a new one."""
        home = self._homes.get(estimator.name, estimator.fit.__module__)
        code, libraries, constants = closure_digest(home), libraries_version(home), known.estimates
        key = key_of(FitParts(code, libraries, self._campaign, options, constants, self._revoked))
        kept = self._kept.get(estimator.name)
        if kept is not None and kept[0] == key:
            self._used[estimator.name] = kept
            return _decoded(kept[1], kept[2])
        text, data = _encoded(fit())
        self._used[estimator.name] = key, text, data
        # decoded as from the cache, so that its users see the same numbers in the next run
        return _decoded(text, data)

    def save(self) -> None:
        """Stores the fits of this campaign; a place that cannot be written is no failure."""
        if self._used != self._kept:
            keep_body(self._path, _body(self._used))


def _body(fits: Mapping[str, tuple[str, bytes, bytes]]) -> bytes:
    head = [
        [name, key, len(text), len(arrays)] for name, (key, text, arrays) in sorted(fits.items())
    ]
    parts = [json.dumps(head).encode() + b"\n"]
    for _, (_, text, arrays) in sorted(fits.items()):
        parts += [text, arrays]
    return b"".join(parts)


def _load(path: Path) -> dict[str, tuple[str, bytes, bytes]]:
    body = read_body(path, _MAX_BYTES)
    if body is None:
        return {}
    head, _, rest = body.partition(b"\n")
    fits, at = {}, 0
    for name, key, text, arrays in json.loads(head):
        fits[name] = (key, rest[at : at + text], rest[at + text : at + text + arrays])
        at += text + arrays
    return fits


def _encoded(fit: Fit) -> tuple[bytes, bytes]:
    """A fit as JSON, and the bytes of its arrays, whose shapes are in the JSON."""
    arrays: list[bytes] = []

    def array(values: NDArray[Any]) -> list[Any]:
        arrays.append(np.ascontiguousarray(values).tobytes())
        return [values.dtype.str, list(values.shape)]

    document = {
        "estimates": [asdict(estimate) for estimate in fit.estimates],
        "evidence": [
            {f.name: getattr(e, f.name) for f in fields(e) if f.name != "series"}
            | {
                "series": [
                    [s.label, array(s.x), array(s.measured), array(s.fitted)] for s in e.series
                ]
            }
            for e in fit.evidence
        ],
    }
    return json.dumps(document, default=_plain).encode(), b"".join(arrays)


def _plain(value: Any) -> Any:
    """A number of numpy as one of Python's; raises TypeError for anything else."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no plain form")


def _decoded(text: bytes, data: bytes) -> Fit:
    document = json.loads(text)
    at = 0

    def array(form: Sequence[Any]) -> NDArray[Any]:
        nonlocal at
        dtype, shape = np.dtype(form[0]), tuple(form[1])
        values = np.frombuffer(data, dtype, int(np.prod(shape)), at).reshape(shape).copy()
        at += values.nbytes
        return values

    estimates = tuple(record_of(Estimate, stored) for stored in document["estimates"])
    evidence = tuple(
        Evidence(
            **stored
            | {
                "series": tuple(
                    Series(label, array(x), array(measured), array(fitted))
                    for label, x, measured, fitted in stored["series"]
                )
            }
        )
        for stored in document["evidence"]
    )
    return Fit(estimates, evidence)


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
