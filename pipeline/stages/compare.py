"""`compare`: how far a model is from the recordings, and where."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

from pipeline.execution.outputs.page_links import links_of, relink
from pipeline.io.recordings.seal import write_checksummed
from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.comparison import Comparison
from pipeline.records.comparison_history import Earlier, document_of, history_of, with_latest
from pipeline.records.model_verdict import effects_key
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome
from pipeline.report.text.comparison_text import comparison_text
from pipeline.settings import CompareSettings
from pipeline.stages.steps.criticism import Judged, Task, each_motor


def main(settings: CompareSettings) -> Outcome:
    """Writes `comparison/MOTOR.json`, its page and a recording for every motor of `input`.

    What a motor was compared with before stays on its page.

    Parameters
    ----------
    settings
        The keys of `compare` or `diagnose`.

    """
    return each_motor(
        settings,
        _judge,
        "pipeline.criticism.comparison",
        "comparison",
        "pipeline.io.recordings.comparison",
    )


def _judge(task: Task) -> Judged:
    from pipeline.criticism.comparison import compare

    with task.watch.stage("compare"):
        comparison = compare(task.campaign, task.spec, task.start)
    output, stem = task.output, file_stem(task.campaign.motor_id)
    write_whole(
        output / "comparison" / f"{stem}.json", canonical_json(document := comparison.document())
    )
    if comparison.traces:
        recorded = task.worker.aside(_recorded, comparison)
        with task.watch.stage("recording"):
            write_checksummed(output / "recordings" / f"comparison-{stem}.rrd", recorded())
    with task.watch.stage("page"):
        _write_page(output, comparison)
    return Judged(
        comparison_text(comparison), not comparison.errors, document, _next(task, comparison)
    )


def _recorded(comparison: Comparison) -> bytes:
    from pipeline.io.recordings.comparison import comparison_bytes

    return comparison_bytes(comparison)


def _next(task: Task, result: Comparison) -> str:
    """A diagnosis where the model is off; a run with what was added, where that explains it."""
    if not result.errors:
        return ""
    quote = shlex.quote
    model = "" if task.spec.name == "standard" else f" model={task.spec.name}"
    model += effects_key(task.spec.effects)
    where = f"input={quote(task.folder)} motor={quote(task.campaign.motor_id)}"
    output = f" output={quote(str(task.output))}"
    if result.held_out is None or result.held_out > 1.0:
        return f"diagnose {where}{model}{output}"
    if task.spec.effects:
        return f"run input={quote(task.folder)}{model}{output}"
    return f"review motor={quote(task.campaign.motor_id)}{output}"


def _write_page(output: Path, result: Comparison) -> None:
    from pipeline.report.pages.comparison_page import render_comparison

    stem = file_stem(result.motor_id)
    kept = output / "comparison" / "history" / f"{stem}.json"
    earlier = _read_history(kept)
    links = links_of(output, "comparison/{}.html", result.motor_id)
    page = render_comparison(result, earlier, links)
    write_whole(output / "comparison" / f"{stem}.html", page.encode())
    if result.errors:
        history = with_latest(earlier, Earlier.of(result))
        write_whole(kept, canonical_json(document_of(result.motor_id, history)))
    relink(output, result.motor_id)


def _read_history(path: Path) -> tuple[Earlier, ...]:
    """What was compared before; nothing where that cannot be read, as it is for looking alone."""
    try:
        return history_of(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError):
        return ()
