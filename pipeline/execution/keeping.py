"""What a run need not do again: answers of the survey, finished motors, the whole batch.

Everything is named by a digest of all that it was made from and holds no clock, so a note of
another work, of other code or of other libraries is never found. Results are not kept twice: a
note names the files of the output folder with their digests, and counts only while they hold.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.execution.jobs import Files, Finished
from pipeline.execution.keys import answer_parts, key_of
from pipeline.execution.versions import LOOK, tools
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.survey import Answer, Entry, Question
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.storage.identity import Identities, Identity, identity, notes_folder
from pipeline.io.storage.sealed import keep_sealed, read_sealed
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome

FOLDER = ".cache"


def motor_note(output: Path, motor_id: str) -> Path:
    """Where it is noted that a motor is finished."""
    return output / FOLDER / "motors" / f"{file_stem(motor_id)}.json"


@dataclass(frozen=True, slots=True)
class Batch:
    """A whole batch that is done: what the command said, and what its registry must hold.

    `contents` are ((motor, version), sha256) of the datasheets.
    """

    outcome: Outcome
    contents: tuple[tuple[tuple[str, str], str], ...]


def note_motor(output: Path, motor_id: str, key: str, finished: Finished) -> None:
    """Notes that a motor is done; its files are on the disk already."""
    keep_sealed(
        motor_note(output, motor_id),
        {
            "key": key,
            "findings": [finding.document() for finding in finished.findings],
            "files": [list(file) for file in finished.files],
        },
    )


def note_files(output: Path, motor_id: str, files: Files) -> None:
    """Notes that some files of a motor that is done have other bytes; nothing where none is noted.

    A note that cannot be written is no failure: the motor is done anew then.
    """
    path = motor_note(output, motor_id)
    said = read_sealed(path)
    if said is None:
        return
    changed = dict(files)
    said["files"] = [[name, changed.get(name, sha256)] for name, sha256 in said["files"]]
    keep_sealed(path, said)


class Keeping:
    """The notes of one output folder on one input folder; `on` False neither reads nor writes."""

    def __init__(self, folder: Path, output: Path, *, on: bool) -> None:
        self.on = on
        self._folder = folder
        self._notes = output / FOLDER
        home = notes_folder() if on else None
        self._inputs = Identities(folder, home)
        self._outputs = Identities(output, home)
        self._before: dict[str, Identity | None] = {}

    def known_answers(
        self,
        questions: Sequence[Question],
        sources: Mapping[str, SourceMap],
        limits: ReadLimits,
        *,
        recover: bool,
    ) -> dict[int, Answer]:
        """Answers by the number of the question, for files that have not changed."""
        said = (read_sealed(self._notes / "survey.json") if self.on else None) or {}
        self._context = partial(
            answer_parts, tools(LOOK), sources=sources, limits=limits, recover=recover
        )
        known = {}
        for number, question in enumerate(questions):
            self._before[question.path] = identity(self._folder / question.path)
            sha256 = self._inputs.sha256(question.path)
            note = said.get(question.path)
            if sha256 and note and note["key"] == self._key(question, sha256):
                known[number] = _answer(question.path, sha256, note, sources)
        return known

    def keep_answers(self, questions: Sequence[Question], answers: Sequence[Answer]) -> None:
        """Keeps what the survey found of each file."""
        if not self.on:
            return
        notes = {}
        for question, answer in zip(questions, answers, strict=True):
            if answer.sha256 is None:
                continue
            before = self._before[answer.path]
            if before == identity(self._folder / answer.path):
                self._inputs.note(answer.path, before, answer.sha256)
                notes[answer.path] = _answer_note(self._key(question, answer.sha256), answer)
        keep_sealed(self._notes / "survey.json", notes)
        self._inputs.save()

    def _key(self, question: Question, sha256: str) -> str:
        beside = None
        if question.sidecar is not None:
            try:
                beside = hashlib.sha256((self._folder / question.sidecar).read_bytes()).hexdigest()
            except OSError:
                beside = ""
        return key_of(self._context(question, sha256, beside))

    def finished(self, motor_id: str, key: str) -> Finished | None:
        """A motor of this key whose files are whole, or None."""
        said = read_sealed(motor_note(self._notes.parent, motor_id)) if self.on else None
        if said is None or said["key"] != key:
            return None
        files = tuple((name, sha256) for name, sha256 in said["files"])
        if not all(self._outputs.holds(name, sha256) for name, sha256 in files):
            return None
        return Finished(tuple(Finding.of(f) for f in said["findings"]), files)

    def outcome(self, key: str) -> Batch | None:
        """The batch of this key, if all its files are whole."""
        said = read_sealed(self._notes / "run.json") if self.on else None
        if said is None or said["key"] != key:
            return None
        if not all(self._outputs.holds(name, sha256) for name, sha256 in said["files"]):
            return None
        outcome = Outcome(said["exit_code"], said["text"], tuple(said["errors"]))
        contents = (((motor, version), sha256) for motor, version, sha256 in said["contents"])
        return Batch(outcome, tuple(contents))

    def keep_outcome(self, key: str, batch: Batch, files: Files) -> None:
        """Keeps a batch that ended well."""
        if not self.on:
            return
        self._note_outputs(files)
        said = {
            "key": key,
            "exit_code": batch.outcome.exit_code,
            "text": batch.outcome.text,
            "errors": list(batch.outcome.errors),
            "files": [list(file) for file in files],
            "contents": [[*key, sha256] for key, sha256 in batch.contents],
        }
        keep_sealed(self._notes / "run.json", said)

    def forget_others(self, motors: Sequence[str]) -> None:
        """Forgets the motors that are no more in the batch."""
        wanted = {motor_note(self._notes.parent, motor_id).name for motor_id in motors}
        for path in (self._notes / "motors").glob("*.json") if self.on else ():
            if path.name not in wanted:
                path.unlink(missing_ok=True)

    def _note_outputs(self, files: Files) -> None:
        for name, sha256 in files:
            self._outputs.note(name, identity(self._notes.parent / name), sha256)
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
    findings = tuple(Finding.of(said) for said in note["findings"])
    said = note["entry"]
    if said is None:
        return Answer(path, sha256, None, findings)
    source = None if said["source"] is None else sources[said["source"]]
    metadata = tuple((key, value) for key, value in said["metadata"])
    entry = Entry(path, sha256, said["form"], source, metadata, said["recovered"])
    return Answer(path, sha256, entry, findings)
