"""`diagnose`: which physical effect a model lacks, how sure that is, and what else it could be."""

from __future__ import annotations

from pipeline.execution.outputs.page_links import links_of, relink
from pipeline.io.recordings.seal import write_checksummed
from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome
from pipeline.report.text.ladder_text import ladder_text
from pipeline.settings import DiagnoseSettings
from pipeline.stages.steps.criticism import Judged, Task, each_motor
from pipeline.views.ladder import ladder_view


def main(settings: DiagnoseSettings) -> Outcome:
    """Writes `diagnosis/MOTOR.json`, its page and the ladder's recording for every motor.

    Where structure is left that no effect explains, an effect to start from is written as well:
    `diagnosis/effects/MOTOR_unknown.py`.

    Parameters
    ----------
    settings
        The keys of `diagnose`.

    """
    return each_motor(
        settings,
        _judge,
        "pipeline.criticism.diagnosis",
        "diagnosis",
        "pipeline.io.recordings.ladder",
    )


def _judge(task: Task) -> Judged:
    from pipeline.criticism.diagnosis import diagnose

    with task.watch.stage("diagnose"):
        diagnosis = diagnose(task.campaign, task.spec, task.start)
    output, stem = task.output, file_stem(task.campaign.motor_id)
    write_whole(
        output / "diagnosis" / f"{stem}.json", canonical_json(document := diagnosis.document())
    )
    if diagnosis.unknown is not None and diagnosis.unknown.sketch:
        effect = output / "diagnosis" / "effects" / f"{diagnosis.unknown.effect}.py"
        write_whole(effect, diagnosis.unknown.source.encode())
    recording = f"recordings/ladder-{stem}.rrd"
    recorded = task.worker.aside(_recorded, diagnosis) if diagnosis.ladder else None
    from pipeline.report.pages.ladder_page import render_ladder

    with task.watch.stage("page"):
        coming = [] if recorded is None else [recording]
        links = links_of(output, "diagnosis/{}.html", diagnosis.motor_id, coming)
        page = render_ladder(diagnosis, links, task.folder, str(output))
    if recorded is not None:
        with task.watch.stage("recording"):
            write_checksummed(output / recording, recorded())
    with task.watch.stage("page"):
        write_whole(output / "diagnosis" / f"{stem}.html", page.encode())
        relink(output, diagnosis.motor_id)
    undecided = diagnosis.verdict == "insufficient"
    view = ladder_view(diagnosis, task.folder, str(output))
    next_ = (view.try_start or view.compare).removeprefix("motor-datasheets ")
    return Judged(ladder_text(diagnosis), undecided, document, next_)


def _recorded(diagnosis: Diagnosis) -> bytes:
    from pipeline.io.recordings.ladder import ladder_bytes

    return ladder_bytes(diagnosis)
