"""What `compare` and `diagnose` share: every motor of a folder judged, files written, one code."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from pipeline.io.guard import ReadLimits
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.outcome import Outcome, Stopwatch, first_that_applies
from pipeline.settings import CompareSettings
from pipeline.stages.campaigns import campaigns, start_constants
from pipeline.stages.mate import mate


@dataclass(frozen=True, slots=True)
class Judged:
    """One motor's result: the text to print, and whether the captures were too few to tell."""

    text: str
    undecided: bool


Judge = Callable[[Campaign, ModelSpec, Constants, Path, Stopwatch], Judged]


def each_motor(settings: CompareSettings, judge: Judge, needs: str) -> Outcome:
    """Runs `judge` on every motor of `input`; it writes under the folder that it is given.

    While workers read the captures, the module that the judge `needs` is imported.
    """
    watch, output = Stopwatch(), Path(settings.output)
    limits = ReadLimits(settings.read_seconds, settings.read_memory_mb)
    with mate(settings.effects_path) as second:
        with watch.stage("read"), ThreadPoolExecutor(1) as aside:
            asked = settings.input, settings.source, settings.motor, limits
            read = aside.submit(campaigns, *asked)
            import_module(needs)
            found, findings = read.result()
        spec = ModelSpec(settings.model.name, tuple(settings.model.effects), settings.effects_path)
        told = []
        for one in found:
            with second.campaign():
                told.append(judge(one, spec, start_constants(one), output, watch))
    refused = any(finding.severity == "refused" for finding in findings)
    undecided = not told or any(one.undecided for one in told)
    return Outcome(
        first_that_applies(3 if refused else 0, 4 if undecided else 0),
        "\n".join(one.text for one in told) + "\n",
        tuple(finding.line() for finding in findings),
        watch.table(),
    )
