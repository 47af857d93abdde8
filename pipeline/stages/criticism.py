"""What `compare` and `diagnose` share: every motor of a folder judged, files written, one code."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from pipeline.execution.segment_worker import mate
from pipeline.execution.start import start_constants
from pipeline.io.ingest.files import input_folder
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.storage.publish import output_folder
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.settings import CompareSettings
from pipeline.stages.campaigns import campaigns, outcome_of


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
    input_folder(settings.input)
    if settings.model.effects or settings.effects_path is not None:
        from pipeline.criticism.registry import known_effects

        known_effects(settings.model.effects, settings.effects_path)
    limits = ReadLimits(settings.read_seconds, settings.read_memory_mb)
    watch, output = Stopwatch(), output_folder(settings.output)
    with mate(settings.effects_path) as second:
        with watch.stage("read"), ThreadPoolExecutor(1) as aside:
            asked = settings.input, settings.source, settings.motor, limits
            read = aside.submit(campaigns, *asked)
            import_module(needs)
            found = read.result()
        spec = ModelSpec(settings.model.name, tuple(settings.model.effects), settings.effects_path)
        told = []
        for one in found.campaigns:
            with second.campaign():
                told.append(judge(one, spec, start_constants(one), output, watch))
    undecided = not told or any(one.undecided for one in told)
    outcome = outcome_of(settings.input, found, [one.text for one in told], undecided=undecided)
    return replace(outcome, timings=watch.table())
