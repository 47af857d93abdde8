"""`diagnose`: which physical effect a model lacks, how sure that is, and what else it could be."""

from __future__ import annotations

from pathlib import Path

from pipeline.criticism.diagnosis import diagnose
from pipeline.io.publish import canonical_json, write_whole
from pipeline.records.comparison import ModelSpec
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome, Stopwatch, first_that_applies
from pipeline.settings import DiagnoseSettings
from pipeline.stages.campaigns import campaigns, start_constants


def main(settings: DiagnoseSettings) -> Outcome:
    """Writes `diagnosis/MOTOR.json` for every motor of `input`.

    Where structure is left that no effect explains, an effect to start from is written as well:
    `diagnosis/effects/MOTOR_unknown.py`.
    """
    watch, output = Stopwatch(), Path(settings.output)
    with watch.stage("read"):
        found, findings = campaigns(settings.input, settings.source, settings.motor)
    spec = ModelSpec(settings.model.name, tuple(settings.model.effects), settings.effects_path)
    lines, undecided = [], not found
    for campaign in found:
        with watch.stage("diagnose"):
            result = diagnose(campaign, spec, start_constants(campaign))
        path = output / "diagnosis" / f"{file_stem(campaign.motor_id)}.json"
        write_whole(path, canonical_json(result.document()))
        if result.unknown is not None and result.unknown.sketch:
            effect = output / "diagnosis" / "effects" / f"{result.unknown.effect}.py"
            write_whole(effect, result.unknown.source.encode())
        lines.extend(_lines(result))
        undecided = undecided or result.verdict == "insufficient"
    refused = any(finding.severity == "refused" for finding in findings)
    return Outcome(
        first_that_applies(3 if refused else 0, 4 if undecided else 0),
        "\n".join(lines) + "\n",
        tuple(finding.line() for finding in findings),
        watch.table(),
    )


def _lines(result: Diagnosis) -> list[str]:
    """The verdict, the ladder and what to do next, in a few lines."""
    missing = ", ".join(result.missing)
    told = [f"{result.motor_id}: {result.verdict}" + (f": {missing}" if missing else "")]
    for rung in result.ladder:
        added = ", ".join(rung.effects) or f"model {result.model}"
        told.append(f"  {added}: held-out error {rung.held_out:.4g} of the noise floor")
    for ranked in result.ranking[: len(result.missing)]:
        if ranked.confused_with:
            others = ", ".join(ranked.confused_with)
            told.append(f"  {ranked.effect} could as well be {others}; {ranked.experiment}")
    if result.unknown is not None:
        told.append(f"  left over in {result.unknown.signal}: {result.unknown.shape}")
    if result.unknown is not None and result.unknown.sketch:
        told.append(f"  {result.unknown.expression}")
        told.append(f"  an effect to start from: diagnosis/effects/{result.unknown.effect}.py")
    told.extend(f"  {note}" for note in result.notes)
    return told
