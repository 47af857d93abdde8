"""Shared by `compare` and `diagnose`: judge every motor of a folder, and return one exit code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from pipeline.api.options import check_constants
from pipeline.criticism.policy.policy import policy_changes
from pipeline.execution.tasks.start import start_constants
from pipeline.execution.workers.segment_worker import SegmentWorker, segment_worker
from pipeline.io.ingest.files import input_folder
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.storage.publish import output_folder
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.naming import printable
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.report.text.waiting import waiting
from pipeline.settings import CompareSettings
from pipeline.stages.steps.campaigns import campaigns, outcome_of


@dataclass(frozen=True, slots=True)
class Judged:
    """One motor's result: the text to print, whether the captures were too few to decide, the
    document that was written, and the command that follows, without the program.
    """

    text: str
    undecided: bool
    document: Mapping[str, Any]
    next: str = ""


@dataclass(frozen=True, slots=True)
class Task:
    """One motor to judge: its captures of `folder`, the model, where to write, whose seconds, and
    the worker that may do something aside.
    """

    campaign: Campaign
    spec: ModelSpec
    start: Constants
    folder: str
    output: Path
    watch: Stopwatch
    worker: SegmentWorker


Judge = Callable[[Task], Judged]


def each_motor(
    settings: CompareSettings, judge: Judge, needs: str, folder: str, recording: str
) -> Outcome:
    """Runs `judge` on every motor of `input`; it writes under the folder that it is given.

    While workers read the captures, the module that the judge `needs` is imported. `folder` is
    where under the output it writes.

    Parameters
    ----------
    settings
        The keys of `compare` or `diagnose`.
    judge
        Makes and writes the result of one motor.
    needs
        Dotted name of the module that `judge` needs.
    folder
        Folder under the output that results are written to.
    recording
        Dotted name of the module that the worker records the result with.

    """
    input_folder(settings.input)
    if settings.model.effects or settings.effects_path is not None:
        from pipeline.criticism.library.registry import known_effects

        known_effects(settings.model.effects, settings.effects_path)
    changes = policy_changes(settings.policy)
    check_constants(settings.constants)
    limits = ReadLimits(settings.read_seconds, settings.read_memory_mb)
    watch, output = Stopwatch(), output_folder(settings.output)
    with (
        waiting("reading") as line,
        segment_worker(settings.effects_path, recording) as worker,
    ):
        with watch.stage("read"):
            # a daemon, so that an interrupt need not wait for it
            aside = Thread(target=import_module, args=(needs,), daemon=True)
            aside.start()
            read = campaigns(
                settings.input, settings.source, settings.motor, limits, settings.config_dir
            )
            aside.join()
        effects = tuple(settings.model.effects)
        spec = ModelSpec(settings.model.name, effects, settings.effects_path, changes)
        judged = []
        stated = [replace(one, stated=settings.constants) for one in read.campaigns]
        for number, campaign in enumerate(stated, 1):
            line.say(f"{printable(campaign.motor_id)}, motor {number} of {len(stated)}")
            with worker.campaign():
                start = start_constants(campaign)
                task = Task(campaign, spec, start, settings.input, output, watch, worker)
                judged.append(judge(task))
    undecided = not judged or any(motor.undecided for motor in judged)
    outcome = outcome_of(
        settings.input, read, [motor.text for motor in judged], undecided=undecided
    )
    return replace(
        outcome,
        timings=watch.table(),
        result=[motor.document for motor in judged],
        wrote=f"{output}/{folder}" if judged else "",
        next=next((motor.next for motor in judged if motor.next), ""),
    )
