"""What everything that is kept hangs on, by named parts; a key is the digest of its parts.

What is kept before anything is read hangs on all that decides what is read and made of it: bytes
of files, source maps, metadata, settings, limits, code, libraries. What is kept of captures in
memory hangs on them as they were read, so on every cause that could read them otherwise.
Records go in whole: a field that is added to one counts without a word here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from pipeline.execution.jobs import MotorJob
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.survey import Question, Survey
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.content import content_digest
from pipeline.records.datasheet import Superseded
from pipeline.records.estimate import Estimate
from pipeline.settings import RunSettings

Parts = Mapping[str, Any]

NOT_OF_A_MOTOR = frozenset({"input", "output", "key", "refused"})
"""Fields of a job that change nothing of what it gives: where things lie, what it is known by, and
files that killed their reader, after which nothing is kept.
"""
NOT_OF_A_BATCH = frozenset(
    {"input", "output", "workers", "executor", "scheduler", "tls_ca", "tls_cert", "tls_key"}
    | {"cache", "timings", "registry_options"}
)
"""Settings that say where things lie and how the work is done, never what comes of it."""


def key_of(parts: Parts) -> str:
    """sha256 of the parts."""
    return content_digest(dict(parts))


def answer_parts(
    tools: str,
    question: Question,
    file_sha256: str,
    sidecar_sha256: str | None,
    sources: Mapping[str, SourceMap],
    limits: ReadLimits,
    *,
    recover: bool,
) -> Parts:
    """What the survey's answer on one file hangs on; the question holds its manifest row."""
    return {
        "tools": tools,
        "question": question,
        "file": file_sha256,
        "sidecar": sidecar_sha256,
        "sources": dict(sources),
        "limits": limits,
        "recover": recover,
    }


def motor_parts(tools: str, job: MotorJob) -> Parts:
    """What the findings and files of one motor hang on."""
    own = {f.name: getattr(job, f.name) for f in fields(job) if f.name not in NOT_OF_A_MOTOR}
    return {"tools": tools, **own}


def batch_parts(
    tools: str,
    settings: RunSettings,
    motors: Sequence[str | None],
    found: Survey,
    commit: int | None,
) -> Parts:
    """What a batch's own pages and outcome hang on: `motors` are the keys of its motors, in which
    its captures are; `commit` is the registry's last one, after which a version may be revoked.
    """
    own = {f.name: getattr(settings, f.name) for f in fields(settings)}
    seen = {f.name: getattr(found, f.name) for f in fields(found)}
    return {
        "tools": tools,
        "settings": {name: value for name, value in own.items() if name not in NOT_OF_A_BATCH},
        "motors": motors,
        "survey": {name: value for name, value in seen.items() if name != "entries"},
        "commit": commit,
    }


def handed(campaign: Campaign, readings: Sequence[str]) -> list[Any]:
    """What a campaign hands to the work: every field of it, its captures by their digests."""
    own = {f.name: getattr(campaign, f.name) for f in fields(campaign) if f.name != "captures"}
    return [own, list(readings)]


def version_parts(code: str, libraries: str, campaign: Sequence[Any], config_sha256: str) -> Parts:
    """What a datasheet hangs on: captures as they were read, configuration, code, libraries.

    `campaign` is what `handed` gives.
    """
    return {
        "campaign": campaign,
        "config": config_sha256,
        "code": code,
        "libraries": libraries,
    }


def superseding_parts(version: str, superseded: Superseded) -> Parts:
    """What the version hangs on that takes the place of a revoked one: of the same work."""
    return {"version": version, "supersedes": superseded}


def fit_parts(
    code: str,
    libraries: str,
    campaign: Sequence[Any],
    options: Mapping[str, float],
    known: Sequence[Estimate],
    doubt: object,
) -> Parts:
    """What one estimator's fit hangs on: its code, the captures as they were read, its options, the
    constants that it uses, and the revocation of a version made of such fits (`doubt`).
    """
    return {
        "code": code,
        "libraries": libraries,
        "campaign": campaign,
        "options": dict(options),
        "known": list(known),
        "doubt": doubt,
    }


def model_parts(
    code: str,
    libraries: str,
    campaign: Sequence[Any],
    model: ModelSpec,
    start: Sequence[Estimate],
    doubt: object,
) -> Parts:
    """What the residual test of one motor hangs on: the code of criticism, the captures as they
    were read, the model, the constants that it starts from, and as for fits a revocation.
    """
    return {
        "code": code,
        "libraries": libraries,
        "campaign": campaign,
        "model": model,
        "start": list(start),
        "doubt": doubt,
    }
