"""Cache keys: what each cached result depends on, by named parts. A key is the digest of its parts.

A result that is looked up before anything is read depends on bytes of files, source maps, metadata,
settings, limits, code and libraries. A result of captures in memory depends on these as they were
read, and so on everything that could change the reading.
Records enter as a whole: a field that is added to one counts without a change here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from pipeline.execution.jobs import MotorJob
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.identification import Question
from pipeline.io.ingest.survey import Survey
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.content import content_digest
from pipeline.records.datasheet import Superseded
from pipeline.records.estimate import Estimate
from pipeline.settings import RunSettings

Parts = Mapping[str, Any]

NOT_OF_A_MOTOR = frozenset({"input", "output", "key", "refused"})
"""Fields of a job that do not change its result: folders, its key, and files that killed their
reader, after which nothing is cached.
"""
NOT_OF_A_BATCH = frozenset(
    {"input", "output", "workers", "executor", "scheduler", "tls_ca", "tls_cert", "tls_key"}
    | {"cache", "timings", "json", "config_dir", "registry_options", "watch", "settle_s"}
)
"""Settings of folders and of how the work is done; they do not change the results."""


def key_of(parts: Parts | NamedTuple) -> str:
    """sha256 of the parts.

    Parameters
    ----------
    parts
        What the result depends on, by name.

    """
    return content_digest(parts._asdict() if isinstance(parts, tuple) else dict(parts))


class AnswersParts(NamedTuple):
    """What the survey's answers on all files depend on.

    Attributes
    ----------
    tools
        Version of the code and of the libraries that give the result.
    sources
        Source maps by name.
    limits
        Time [s] and memory [MB] that reading one file may take.
    recover
        Whether damaged MCAP files are read up to the damage.

    """

    tools: str
    sources: Mapping[str, SourceMap]
    limits: ReadLimits
    recover: bool


class AnswerParts(NamedTuple):
    """What the survey's answer on one file depends on.

    Attributes
    ----------
    survey
        The key of what all answers depend on.
    question
        The file and its row of the manifest.
    file
        Digest of the file.
    sidecar
        Digest of its sidecar; None without one.

    """

    survey: str
    question: Question
    file: str
    sidecar: str | None


def motor_parts(tools: str, job: MotorJob) -> Parts:
    """What the findings and files of one motor depend on.

    Parameters
    ----------
    tools
        Version of the code and of the libraries that give the result.
    job
        What to do with one motor, and how.

    """
    parts = {f.name: getattr(job, f.name) for f in fields(job) if f.name not in NOT_OF_A_MOTOR}
    return {"tools": tools, **parts}


def batch_parts(
    tools: str,
    settings: RunSettings,
    motors: Sequence[str | None],
    survey: Survey,
    commit: int | None,
) -> Parts:
    """What the pages and the outcome of a batch depend on.

    Parameters
    ----------
    tools
        Version of the code and of the libraries that give the result.
    settings
        The keys of `run`.
    motors
        Keys of the motors; they cover the captures.
    survey
        What the input folder holds.
    commit
        Last commit of the registry; a version may be revoked later.

    """
    every = {f.name: getattr(settings, f.name) for f in fields(settings)}
    surveyed = {f.name: getattr(survey, f.name) for f in fields(survey)}
    return {
        "tools": tools,
        "settings": {name: value for name, value in every.items() if name not in NOT_OF_A_BATCH},
        "motors": motors,
        "survey": {name: value for name, value in surveyed.items() if name != "entries"},
        "commit": commit,
    }


def campaign_key(campaign: Campaign, readings: Sequence[str]) -> list[Any]:
    """Every field of a campaign, with its captures by their digests.

    Parameters
    ----------
    campaign
        The captures of one motor.
    readings
        Digests of the captures as they were read.

    """
    parts = {f.name: getattr(campaign, f.name) for f in fields(campaign) if f.name != "captures"}
    return [parts, list(readings)]


class VersionParts(NamedTuple):
    """What a datasheet depends on: captures as they were read, configuration, code, libraries.

    Attributes
    ----------
    code
        Version of the code.
    libraries
        Versions of the libraries.
    campaign
        The result of `campaign_key`.
    config
        Digest of the configuration.

    """

    code: str
    libraries: str
    campaign: Sequence[Any]
    config: str


class SupersedingParts(NamedTuple):
    """What a version depends on that supersedes a revoked one of the same work.

    Attributes
    ----------
    version
        Digest of the datasheet's version.
    supersedes
        The revoked version.

    """

    version: str
    supersedes: Superseded


class FitParts(NamedTuple):
    """What the fit of one estimator depends on.

    Attributes
    ----------
    code
        Version of its code.
    libraries
        Versions of the libraries.
    campaign
        The result of `campaign_key`.
    options
        Options of the estimator.
    known
        Constants that the estimator uses.
    revoked
        Revocations of versions that were made of these results.

    """

    code: str
    libraries: str
    campaign: Sequence[Any]
    options: Mapping[str, float]
    known: Sequence[Estimate]
    revoked: object


class ModelParts(NamedTuple):
    """What the residual test of one motor depends on.

    Attributes
    ----------
    code
        Version of the code of criticism.
    libraries
        Versions of the libraries.
    campaign
        The result of `campaign_key`.
    model
        The model and its effects.
    start
        Constants that the fit starts from.
    revoked
        Revocations of versions that were made of these results.
    search
        Whether missing effects are searched for.

    """

    code: str
    libraries: str
    campaign: Sequence[Any]
    model: ModelSpec
    start: Sequence[Estimate]
    revoked: object
    search: bool
