"""Tasks of the survey: workers identify files, each file under its limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from pipeline.execution.jobs import OfFiles
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.io.ingest.files import size_bytes
from pipeline.io.ingest.guard import ReadLimits, died, reading
from pipeline.io.ingest.identification import Answer, Question, identify
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

LARGEST_BATCH = 64
SMALLEST_BATCH = 16


@dataclass(frozen=True, slots=True)
class SurveyTask(OfFiles):
    """Files to identify in one task."""

    folder: str
    questions: tuple[Question, ...]
    sources: Mapping[str, SourceMap]
    recover: bool
    limits: ReadLimits

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"the survey of {self.questions[0].path} and {len(self.questions) - 1} more files"


def survey_files(task: SurveyTask) -> tuple[Answer, ...]:
    """The answers to a task's questions, in their order.

    Parameters
    ----------
    task
        The files, and how to read them.

    """
    folder, refused = Path(task.folder), dict(task.refused)
    answers = []
    for question in task.questions:
        try:
            if question.path in refused:
                raise died(refused[question.path])
            with reading(question.path, size_bytes(folder / question.path), task.limits):
                answer = identify(folder, question, task.sources, recover=task.recover)
        except CaptureError as fault:
            answer = Answer(question.path, None, None, (Finding.refusal(question.path, fault),))
        answers.append(answer)
    return tuple(answers)


def survey_with(
    workers: WorkerPool,
    folder: Path,
    sources: Mapping[str, SourceMap],
    limits: ReadLimits,
    questions: Sequence[Question],
    *,
    recover: bool,
) -> list[Answer]:
    """The answers of the workers.

    Parameters
    ----------
    workers
        The workers.
    folder
        The input folder.
    sources
        Source maps by name.
    limits
        Time [s] and memory [MB] that reading one file may take.
    questions
        One a file: the file and its row of the manifest.
    recover
        Whether damaged MCAP files are read up to the damage.

    Raises
    ------
    MachineError
        A batch of files fails as a whole.

    """
    share = -(-len(questions) // (4 * workers.count)) if questions else 1
    size = min(max(share, SMALLEST_BATCH), LARGEST_BATCH)
    tasks = [
        SurveyTask(str(folder), tuple(questions[at : at + size]), sources, recover, limits)
        for at in range(0, len(questions), size)
    ]
    return list(chain.from_iterable(workers.all_of(survey_files, tasks)))
