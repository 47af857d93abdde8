"""Which files of a folder are captures, and what is stated of each.

What is asked of one file (`Question`) and what is found (`Answer`) are plain data, so that
untrusted bytes can be parsed in another process (`identification`) than the one that puts the
batch together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.files import list_files, read_whole
from pipeline.io.ingest.guard import refusing
from pipeline.io.ingest.identification import Answer, Question, identify
from pipeline.io.ingest.metadata import (
    MANIFEST,
    MAX_MANIFEST_BYTES,
    SIDECAR_SUFFIX,
    is_about_others,
    manifest,
)
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding


@dataclass(frozen=True, slots=True)
class Survey:
    """Captures sorted by path, what was found wrong, and the files that are no captures."""

    entries: tuple[Entry, ...]
    findings: tuple[Finding, ...]
    others: tuple[str, ...]

    @property
    def motors(self) -> dict[str, tuple[Entry, ...]]:
        """Captures of every motor, in the order of their serial numbers."""
        of_motor: dict[str, list[Entry]] = {}
        for entry in self.entries:
            of_motor.setdefault(entry.stated["motor_id"], []).append(entry)
        return {motor_id: tuple(of_motor[motor_id]) for motor_id in sorted(of_motor)}

    @property
    def note(self) -> str:
        """One line that counts and names the files that are no captures, or an empty text."""
        if not self.others:
            return ""
        many = f"{len(self.others)} files are no captures and were"
        words = "1 file is no capture and was" if len(self.others) == 1 else many
        return f"{words} left alone: {', '.join(self.others)}"


Ask = Callable[[Sequence[Question]], Sequence[Answer]]


def survey(
    folder: Path, sources: Mapping[str, SourceMap], ask: Ask | None = None, *, recover: bool = False
) -> Survey:
    """Identifies every file of a folder once, in the order of its path.

    Parameters
    ----------
    folder
        The input folder.
    sources
        Source maps by name.
    ask
        Answers the questions in their order, such as in a pool of workers; without it they are
        answered in this process.
    recover
        Whether the good part of an MCAP file that is cut off is used.

    Returns
    -------
    Survey
        Captures, findings, and files that are no captures; a bad file is a finding. Of files with
        the same bytes, one is used.

    Raises
    ------
    UsageError
        There is no such folder.

    """
    listing = list_files(folder)
    findings = list(listing.findings)
    manifests = _manifests(folder, listing.paths, findings)
    listed = frozenset(listing.paths)
    questions = [
        Question(path, _sidecar(path, listed), tuple(manifests.get(path, {}).items()))
        for path in listing.paths
        if not is_about_others(path)
    ]
    if ask is None:
        answers: Sequence[Answer] = [
            identify(folder, q, sources, recover=recover) for q in questions
        ]
    else:
        answers = ask(questions)
    entries: dict[str, Entry] = {}
    not_captures: list[str] = []
    for answer in answers:
        findings += answer.findings
        entry = answer.entry
        if any(finding.severity == "refused" for finding in answer.findings):
            continue
        if entry is None:
            not_captures.append(answer.path)
        else:
            first = entries.setdefault(entry.sha256, entry)
            if first is not entry:
                preferred, other = _preferred(folder, first, entry)
                entries[entry.sha256] = preferred
                findings.append(_duplicate(other.path, preferred.path))
    findings += [_absent(path) for path in sorted(set(manifests) - listed)]
    parts = [part for entry in entries.values() for part in _parts(entry)]
    captures = tuple(sorted(parts, key=lambda entry: entry.capture_path))
    return Survey(captures, tuple(sorted(findings, key=Finding.order)), tuple(not_captures))


def _parts(entry: Entry) -> list[Entry]:
    """An entry for each capture that the source map cuts the file into, or the one."""
    parts = () if entry.source is None else entry.source.parts_of(entry.path)
    if not parts:
        return [entry]
    stated = [tuple(sorted((entry.stated | dict(part.metadata)).items())) for part in parts]
    return [replace(entry, part=p, metadata=keys) for p, keys in zip(parts, stated, strict=True)]


def _preferred(folder: Path, first: Entry, second: Entry) -> tuple[Entry, Entry]:
    """Of two files of the same bytes the one to use, which is no link if one of them is a file."""
    if (folder / first.path).is_symlink() and not (folder / second.path).is_symlink():
        return second, first
    return first, second


def question_of(path: Path) -> Question:
    """The question of one file by itself, with the sidecar and the manifest that lie beside it.

    Parameters
    ----------
    path
        The file.

    """
    siblings = frozenset(other.name for other in path.parent.iterdir() if other.is_file())
    listed = _manifests(path.parent, sorted(siblings & {MANIFEST}), []).get(path.name, {})
    return Question(path.name, _sidecar(path.name, siblings), tuple(listed.items()))


def _duplicate(path: str, first: str) -> Finding:
    return Finding(
        path,
        "warning",
        "duplicate_content",
        f"it holds the same bytes as {first} and is used once",
        "remove one of the two",
    )


def _absent(path: str) -> Finding:
    return Finding(
        path,
        "warning",
        "manifest_missing_file",
        f"the {MANIFEST} names it, but it is not there",
        f"add the file or remove its row from the {MANIFEST}",
    )


def _manifests(
    folder: Path, paths: Iterable[str], findings: list[Finding]
) -> dict[str, dict[str, str]]:
    """What all manifests say, by path; a manifest that cannot be read is a finding."""
    stated: dict[str, dict[str, str]] = {}
    for path in paths:
        if PurePosixPath(path).name == MANIFEST:
            try:
                home = PurePosixPath(path).parent.as_posix()
                content = read_whole(folder / path, MAX_MANIFEST_BYTES + 1)
                with refusing():
                    rows = manifest(content, "" if home == "." else home)
            except CaptureError as fault:
                findings.append(Finding.refusal(path, fault))
                continue
            for file, values in rows.items():
                stated[file] = values | stated.get(file, {})
    return stated


def _sidecar(path: str, siblings: frozenset[str]) -> str | None:
    """The sidecar of a file: NAME.meta.yaml for NAME.csv, or NAME.csv.meta.yaml."""
    stem = PurePosixPath(path).with_suffix("").as_posix()
    return next((c for c in (path + SIDECAR_SUFFIX, stem + SIDECAR_SUFFIX) if c in siblings), None)
