"""`diagnose`: which physical effect a model lacks, how sure that is, and what else it could be."""

from __future__ import annotations

from pathlib import Path

from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.report.notes import told_and_folded
from pipeline.settings import DiagnoseSettings
from pipeline.stages.criticism import Judged, each_motor


def main(settings: DiagnoseSettings) -> Outcome:
    """Writes `diagnosis/MOTOR.json`, its page and the ladder's recording for every motor.

    Where structure is left that no effect explains, an effect to start from is written as well:
    `diagnosis/effects/MOTOR_unknown.py`.
    """
    return each_motor(settings, _judge, "pipeline.criticism.diagnosis")


def _judge(
    campaign: Campaign, spec: ModelSpec, start: Constants, output: Path, watch: Stopwatch
) -> Judged:
    from pipeline.criticism.diagnosis import diagnose

    with watch.stage("diagnose"):
        result = diagnose(campaign, spec, start)
    stem = file_stem(campaign.motor_id)
    write_whole(output / "diagnosis" / f"{stem}.json", canonical_json(result.document()))
    if result.unknown is not None and result.unknown.sketch:
        effect = output / "diagnosis" / "effects" / f"{result.unknown.effect}.py"
        write_whole(effect, result.unknown.source.encode())
    from pipeline.report.ladder_page import render_ladder

    with watch.stage("page"):
        page = render_ladder(result)
        write_whole(output / "diagnosis" / f"{stem}.html", page.encode())
    if result.ladder:
        from pipeline.io.recordings.ladder import write_ladder_recording

        with watch.stage("recording"):
            write_ladder_recording(result, output / "recordings" / f"ladder-{stem}.rrd")
    return Judged("\n".join(_lines(result)), result.verdict == "insufficient")


def _lines(result: Diagnosis) -> list[str]:
    """The verdict, the ladder and what to do next, in a few lines."""
    missing = ", ".join(result.missing)
    lines = [f"{result.motor_id}: {result.verdict}" + (f": {missing}" if missing else "")]
    for step in result.ladder:
        added = ", ".join(step.effects) or result.whole_model
        lines.append(f"  {added}: held-out error {step.held_out:.4g} of the noise floor")
    for ranked in result.ranking[: len(result.missing)]:
        if ranked.confused_with:
            others = ", ".join(ranked.confused_with)
            lines.append(f"  {ranked.effect} could as well be {others}; {ranked.experiment}")
        lines.extend(
            f"    against {one.against}: {one.experiment}, predicted power {one.power:.0%}"
            for one in ranked.separation
            if one.power is not None
        )
    if result.verdict in ("adequate", "missing"):
        lines.extend(f"  {one.effect} is {one.shortfall}" for one in result.ranking if one.slight)
    if result.unknown is not None:
        lines.append(f"  left over in {result.unknown.signal}: {result.unknown.shape}")
    if result.unknown is not None and result.unknown.sketch:
        lines.append(f"  {result.unknown.expression}")
        lines.append(f"  an effect to start from: diagnosis/effects/{result.unknown.effect}.py")
    lines.extend(f"  {note}" for note in told_and_folded(result)[0])
    return lines
