"""The cache of a run: answers of the survey, finished motors, the whole batch.

Each entry is keyed by a digest of everything that it depends on, and holds no clock. So an entry
of other inputs, code or libraries is never found. Results are not stored twice: an entry names the
files of the output folder with their digests, and is valid only while they match.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.execution.caches.keys import AnswerParts, AnswersParts, key_of
from pipeline.execution.caches.versions import SURVEY, tools
from pipeline.execution.jobs import Files, Finished
from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.identification import Answer, Question
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.storage.checksummed import keep_checksummed, read_checksummed
from pipeline.io.storage.identity import Identities, Identity, notes_folder
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome
from pipeline.records.plain_form import record_of

FOLDER = ".cache"


def motor_note(output: Path, motor_id: str) -> Path:
    """The cache entry of a finished motor.

    Parameters
    ----------
    output
        The output folder of a run.
    motor_id
        The motor.

    """
    return output / FOLDER / "motors" / f"{file_stem(motor_id)}.json"


@dataclass(frozen=True, slots=True)
class Batch:
    """A finished batch: the outcome of the command, and what its registry must hold.

    `contents` are ((motor, version), sha256) of the datasheets.
    """

    outcome: Outcome
    contents: tuple[tuple[tuple[str, str], str], ...]


def note_motor(output: Path, motor_id: str, key: str, finished: Finished) -> None:
    """Records that a motor is done; its files are on the disk already.

    Parameters
    ----------
    output
        The output folder of a run.
    motor_id
        The motor.
    key
        The key, a digest of all that the result depends on.
    finished
        What the motor came to.

    """
    keep_checksummed(
        motor_note(output, motor_id),
        {
            "key": key,
            "findings": [finding.document() for finding in finished.findings],
            "files": [list(file) for file in finished.files],
        },
    )


def note_files(output: Path, motor_id: str, files: Files) -> None:
    """Updates the digests of a finished motor's files; does nothing without an entry.

    An entry that cannot be written is no failure: the motor is then processed again.

    Parameters
    ----------
    output
        The output folder of a run.
    motor_id
        The motor.
    files
        Digest of each file by name.

    """
    path = motor_note(output, motor_id)
    entry = read_checksummed(path)
    if entry is None:
        return
    changed = dict(files)
    entry["files"] = [[name, changed.get(name, sha256)] for name, sha256 in entry["files"]]
    keep_checksummed(path, entry)


class RunCache:
    """The cache of one output folder for one input folder; `on` False neither reads nor writes."""

    def __init__(self, folder: Path, output: Path, *, on: bool) -> None:
        self.on = on
        self._folder = folder
        self._notes = output / FOLDER
        home = notes_folder() if on else None
        self._inputs = Identities(folder, home)
        self._outputs = Identities(output, home)
        self._before: dict[str, Identity | None] = {}
        self._valid: dict[str, Mapping[str, Any]] = {}
        self._survey = ""

    def known_answers(
        self,
        questions: Sequence[Question],
        sources: Mapping[str, SourceMap],
        limits: ReadLimits,
        *,
        recover: bool,
    ) -> dict[int, Answer]:
        """Answers by the number of the question, for files that have not changed.

        Parameters
        ----------
        questions
            One a file: the file and its row of the manifest.
        sources
            Source maps by name.
        limits
            Time [s] and memory [MB] that reading one file may take.
        recover
            Whether damaged MCAP files are read up to the damage.

        """
        entries = (read_checksummed(self._notes / "survey.json") if self.on else None) or {}
        self._survey = key_of(AnswersParts(tools(SURVEY), sources, limits, recover))
        known = {}
        for number, question in enumerate(questions):
            self._before[question.path] = self._inputs.identity(question.path)
            sha256 = self._inputs.sha256(question.path)
            note = entries.get(question.path)
            if sha256 and note and note["key"] == self._key(question, sha256):
                known[number] = _answer(question.path, sha256, note, sources)
                self._valid[question.path] = note
        return known

    def keep_answers(self, questions: Sequence[Question], answers: Sequence[Answer]) -> None:
        """Stores the survey's answer on each file.

        Parameters
        ----------
        questions
            One a file: the file and its row of the manifest.
        answers
            The answer to each question, in order.

        """
        if not self.on:
            return
        notes = {}
        for question, answer in zip(questions, answers, strict=True):
            if answer.sha256 is None:
                continue
            before = self._before[answer.path]
            if before == self._inputs.identity(answer.path):
                self._inputs.note(answer.path, before, answer.sha256)
                notes[answer.path] = self._valid.get(answer.path) or _answer_note(
                    self._key(question, answer.sha256), answer
                )
        keep_checksummed(self._notes / "survey.json", notes)
        self._inputs.save()

    def _key(self, question: Question, sha256: str) -> str:
        beside = None
        if question.sidecar is not None:
            try:
                beside = hashlib.sha256((self._folder / question.sidecar).read_bytes()).hexdigest()
            except OSError:
                beside = ""
        return key_of(AnswerParts(self._survey, question, sha256, beside))

    def finished(self, motor_id: str, key: str) -> Finished | None:
        """The finished motor of this key, or None where a file of it is missing or changed.

        Parameters
        ----------
        motor_id
            The motor.
        key
            The motor's key.

        """
        entry = read_checksummed(motor_note(self._notes.parent, motor_id)) if self.on else None
        if entry is None or entry["key"] != key:
            return None
        files = tuple((name, sha256) for name, sha256 in entry["files"])
        if not all(self._outputs.holds(name, sha256) for name, sha256 in files):
            return None
        return Finished(tuple(record_of(Finding, f) for f in entry["findings"]), files)

    def outcome(self, key: str) -> Batch | None:
        """The finished batch of this key, or None where a file of it is missing or changed.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.

        """
        entry = read_checksummed(self._notes / "run.json") if self.on else None
        if entry is None or entry["key"] != key:
            return None
        if not all(self._outputs.holds(name, sha256) for name, sha256 in entry["files"]):
            return None
        outcome = Outcome(
            entry["exit_code"], entry["text"], tuple(entry["errors"]), next=entry.get("next", "")
        )
        contents = (((motor, version), sha256) for motor, version, sha256 in entry["contents"])
        return Batch(outcome, tuple(contents))

    def keep_outcome(self, key: str, batch: Batch, files: Files) -> None:
        """Stores a batch that ended without an error.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.
        batch
            What the batch came to.
        files
            Digest of each file by name.

        """
        if not self.on:
            return
        self._note_outputs(files)
        entry = {
            "key": key,
            "exit_code": batch.outcome.exit_code,
            "text": batch.outcome.text,
            "errors": list(batch.outcome.errors),
            "next": batch.outcome.next,
            "files": [list(file) for file in files],
            "contents": [[*key, sha256] for key, sha256 in batch.contents],
        }
        keep_checksummed(self._notes / "run.json", entry)

    def forget_others(self, motors: Sequence[str]) -> None:
        """Removes the entries of motors that are no longer in the batch.

        Parameters
        ----------
        motors
            The motors of the batch.

        """
        wanted = {motor_note(self._notes.parent, motor_id).name for motor_id in motors}
        for path in (self._notes / "motors").glob("*.json") if self.on else ():
            if path.name not in wanted:
                path.unlink(missing_ok=True)

    def _note_outputs(self, files: Files) -> None:
        for name, sha256 in files:
            self._outputs.note(name, self._outputs.identity(name), sha256)
        self._outputs.save()


def _answer_note(key: str, answer: Answer) -> dict[str, Any]:
    entry = answer.entry
    return {
        "key": key,
        "findings": [finding.document() for finding in answer.findings],
        "entry": None
        if entry is None
        else {
            "form": entry.form,
            "source": None if entry.source is None else entry.source.name,
            "metadata": [list(pair) for pair in entry.metadata],
            "recovered": entry.recovered,
        },
    }


def _answer(
    path: str, sha256: str, note: Mapping[str, Any], sources: Mapping[str, SourceMap]
) -> Answer:
    findings = tuple(record_of(Finding, document) for document in note["findings"])
    stated = note["entry"]
    if stated is None:
        return Answer(path, sha256, None, findings)
    source = None if stated["source"] is None else sources[stated["source"]]
    metadata = tuple((key, value) for key, value in stated["metadata"])
    entry = Entry(path, sha256, stated["form"], source, metadata, stated["recovered"])
    return Answer(path, sha256, entry, findings)
