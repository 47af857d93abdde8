"""The diagnosing side: a process of its own that is handed campaigns and nothing else."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from tempfile import TemporaryDirectory
from typing import Any

from pipeline.io.storage.publish import canonical_json
from pipeline.records.capture import Campaign
from pipeline.records.policy import Overrides

Diagnose = Callable[[Campaign, str], dict[str, Any]]
"""Campaign and name of the model in, a document of schema model-diagnosis/1 out."""


def product(campaign: Campaign, model: str, policy: Overrides = ()) -> dict[str, Any]:
    """What `python -m pipeline diagnose` writes for a campaign; `policy` overrides some numbers."""
    from pipeline.criticism.diagnosis import diagnose
    from pipeline.execution.tasks.start import start_constants
    from pipeline.records.comparison import ModelSpec

    document: dict[str, Any] = diagnose(
        campaign, ModelSpec(model, policy=policy), start_constants(campaign)
    ).document()
    return document


def attempted(diagnose: Diagnose, campaign: Campaign, model: str) -> dict[str, Any]:
    """A diagnosis, or a document with `failure` where it broke down: a case is never lost.

    A document that no file may hold (NaN, infinity) is a failure as well.
    """
    try:
        document = diagnose(campaign, model)
        canonical_json(document)
    except Exception as error:  # noqa: BLE001 - whatever breaks is what the benchmark reports
        return {"failure": f"{type(error).__name__}: {error}"[:300]}
    return document


def _forget(folder: str) -> None:
    """Leaves the blind process an empty folder and no words of the command that started it."""
    os.chdir(folder)
    sys.argv = [""]


@contextmanager
def blind_process() -> Iterator[ProcessPoolExecutor]:
    """A worker process in an empty folder: no path of truth or results ever reaches it."""
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(1, get_context("spawn"), _forget, (folder,)) as pool,
    ):
        yield pool
