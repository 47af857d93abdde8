"""The version of a datasheet: a digest of settings, captures as read, code and libraries."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

from pipeline.execution.caches.keys import VersionParts, campaign_key, key_of
from pipeline.execution.caches.versions import datasheet_code, datasheet_libraries
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.work import Stamp
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.storage.publish import canonical_json
from pipeline.records.capture import Campaign
from pipeline.records.content import content_digest
from pipeline.settings import RunSettings, result_document


def stamp_of(job: MotorJob, campaign: Campaign) -> Stamp:
    """The version of a motor's datasheet, with the parts of its digest.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    campaign
        The captures of one motor.

    """
    readings = tuple(content_digest(capture) for capture in campaign.captures)
    code, libraries = datasheet_code(), datasheet_libraries()
    of_campaign = campaign_key(campaign, readings)
    version = key_of(VersionParts(code, libraries, of_campaign, job.config_sha256))
    return Stamp(version, readings, job.config_sha256, code, libraries, of_campaign)


def configuration_digest(
    settings: RunSettings,
    required: Sequence[str],
    sources: Iterable[SourceMap | None],
    *,
    model_gates: bool = True,
) -> str:
    """Digest of the settings that can change a result.

    It covers the conditions of a release, and the source maps that the captures need. The limits of
    a lot change no datasheet.

    Parameters
    ----------
    settings
        The keys of `run`.
    required
        Constants that a release needs.
    sources
        The source map of each capture, None for one in the contract's form.
    model_gates
        Whether a model that lacks something prevents a release.

    """
    conditions = {"required": tuple(required), "model_gates": model_gates}
    work = canonical_json({**result_document(settings), **conditions})
    maps = sorted({repr(source) for source in sources if source is not None})
    return hashlib.sha256("\n".join([work.decode(), *maps]).encode()).hexdigest()
