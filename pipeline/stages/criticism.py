"""What `compare` and `diagnose` share: every motor of a folder judged, files written, one code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from pipeline.io.files import input_folder
from pipeline.io.guard import ReadLimits
from pipeline.io.publish import output_folder
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.settings import CompareSettings
from pipeline.stages.campaigns import campaigns, outcome_of
from pipeline.stages.fleet.start import start_constants
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
    input_folder(settings.input)
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


def known_effects(wanted: Sequence[str], effects_path: str | None = None) -> None:
    """Refuses the name of an effect that there is not, also of one to take away, or is twice."""
    if not wanted and effects_path is None:
        return
    from pipeline.criticism.registry import chosen

    names = tuple(name.removeprefix("-") for name in wanted)
    chosen(names, effects_path)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise UsageError(f"model.effects names {twice[0]} twice", "name it once")
