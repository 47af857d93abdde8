"""`compare`: how far a model is from the recordings, and where."""

from __future__ import annotations

from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome
from pipeline.report.comparison_text import comparison_text
from pipeline.settings import CompareSettings
from pipeline.stages.criticism import Judged, Task, each_motor


def main(settings: CompareSettings) -> Outcome:
    """Writes `comparison/MOTOR.json` and a recording for every motor of `input`."""
    return each_motor(settings, _judge, "pipeline.criticism.comparison")


def _judge(task: Task) -> Judged:
    from pipeline.criticism.comparison import compare

    with task.watch.stage("compare"):
        result = compare(task.campaign, task.spec, task.start)
    output, stem = task.output, file_stem(task.campaign.motor_id)
    write_whole(output / "comparison" / f"{stem}.json", canonical_json(result.document()))
    if result.traces:
        from pipeline.io.recordings.comparison import write_comparison_recording

        with task.watch.stage("recording"):
            path = output / "recordings" / f"comparison-{stem}.rrd"
            write_comparison_recording(result, path)
    return Judged(comparison_text(result), not result.errors)
