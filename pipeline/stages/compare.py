"""`compare`: how far a model is from the recordings, and where."""

from __future__ import annotations

from pathlib import Path

from pipeline.criticism.comparison import compare
from pipeline.io.publish import canonical_json, write_whole
from pipeline.records.comparison import Comparison, ModelSpec
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome, Stopwatch, first_that_applies
from pipeline.settings import CompareSettings
from pipeline.stages.campaigns import campaigns, start_constants


def main(settings: CompareSettings) -> Outcome:
    """Writes `comparison/MOTOR.json` for every motor of `input`."""
    watch, output = Stopwatch(), Path(settings.output)
    with watch.stage("read"):
        found, findings = campaigns(settings.input, settings.source, settings.motor)
    spec = ModelSpec(settings.model.name, tuple(settings.model.effects), settings.effects_path)
    lines, undecided = [], not found
    for campaign in found:
        with watch.stage("compare"):
            result = compare(campaign, spec, start_constants(campaign))
        path = output / "comparison" / f"{file_stem(campaign.motor_id)}.json"
        write_whole(path, canonical_json(result.document()))
        lines.append(_line(result))
        undecided = undecided or not result.errors
    return Outcome(
        _code(findings, undecided=undecided),
        "\n".join(lines) + "\n",
        tuple(finding.line() for finding in findings),
        watch.table(),
    )


def _code(findings: tuple[Finding, ...], *, undecided: bool) -> int:
    refused = any(finding.severity == "refused" for finding in findings)
    return first_that_applies(3 if refused else 0, 4 if undecided else 0)


def _line(result: Comparison) -> str:
    effects = ", ".join(result.effects) or "none"
    if not result.errors:
        return f"{result.motor_id}: {'; '.join(result.notes)}"
    return (
        f"{result.motor_id}: model {result.name} with {effects}: held-out error "
        f"{result.held_out:.4g} (1 is the noise floor)"
    )
