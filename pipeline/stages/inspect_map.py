"""`inspect` on a folder: one source map for all files, a preview through it, and what follows."""

from __future__ import annotations

import shlex
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pipeline.execution.jobs import OfFile
from pipeline.execution.tasks.inspect_tasks import InspectTask, Looked, in_workers, look_into
from pipeline.io.ingest.files import list_files, size_bytes
from pipeline.io.ingest.guard import ReadLimits, died, reading
from pipeline.io.ingest.metadata import is_about_others
from pipeline.io.inspection.proposals import answer_key
from pipeline.io.storage.publish import write_whole
from pipeline.physics.glossary import METADATA, OHMMETER, TESTS_WITHOUT_CLOCK
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.finding import lines_of
from pipeline.records.naming import counted, printable
from pipeline.records.outcome import Outcome, faults_of, first_that_applies
from pipeline.settings import InspectSettings
from pipeline.stages.inspect_record import file_record, motor_lines, motor_record

if TYPE_CHECKING:
    from pipeline.io.inspection.file_names import NamePatterns
    from pipeline.io.inspection.starter_map import Shape

PREVIEW_ROWS = 3
_QUESTIONS = "asked, for neither names nor numbers say it:"
_STATED = frozenset(METADATA) - {"contract", "sha256_rows"}


@dataclass(frozen=True, slots=True)
class PreviewTask(OfFile):
    """A file to show through a map that is not written yet."""

    map_text: str


def check_answers(settings: InspectSettings) -> None:
    """Raises UsageError for an answer that nothing asks for, or a map that is there already.

    Parameters
    ----------
    settings
        The keys of `inspect`.

    """
    from pipeline.records.stated import may_be_stated

    for key in settings.answers:
        of_field = key.startswith(("unit.", "column.", "scale.", "times."))
        constant = may_be_stated(key.removeprefix("u_"))
        if not (of_field or constant or key in _STATED or key in ("increment_s", "captures")):
            raise UsageError(
                f"inspect: no key or metadata {key!r}",
                "answers are unit.NAME, scale.NAME, times.NAME, column.NAME, increment_s, "
                f"captures, {', '.join(sorted(_STATED))}",
            )
    if settings.map and Path(settings.map).exists():
        raise UsageError(f"map={settings.map} is there already", "remove it, or name another file")


def check_fields(settings: InspectSettings, looked: Sequence[Looked]) -> None:
    """Raises UsageError for an answer on a field that no file has, which would change nothing.

    Parameters
    ----------
    settings
        The keys of `inspect`.
    looked
        The files.

    """
    fields = [f for one in looked for stream in one.report.streams for f in stream.fields]
    names = sorted({answer_key(field.name) for field in fields})
    columns = {answer_key(field.name) for field in fields if field.column}
    for key in settings.answers:
        kind, _, name = key.partition(".")
        if not name or not fields:
            continue
        if name not in names:
            raise UsageError(
                f"{key}: no file has a field {name!r}", f"fields are {', '.join(names)}"
            )
        if kind != "column" and name not in columns:
            raise UsageError(f"{key}: {name!r} is no column yet", f"answer column.{name}= as well")


def folder(settings: InspectSettings) -> Outcome:
    """What the files of a folder hold, by shape, and one map for those that need one.

    Parameters
    ----------
    settings
        The keys of `inspect`.

    """
    paths = [path for path in list_files(Path(settings.file)).paths if not is_about_others(path)]
    if not paths:
        raise UsageError(f"{settings.file} holds no files", "name a folder of recordings")
    limits = _read_limits(settings)
    tasks = [InspectTask(settings.file, path, limits, settings.answers) for path in paths]
    seen = in_workers(_look_or_fault, tasks)
    looked = [one for one in seen if isinstance(one, Looked)]
    check_fields(settings, looked)
    unread = [one for one in seen if isinstance(one, str)]
    unmapped = [one for one in looked if one.report.shape and not one.report.source]
    known = [one for one in looked if one not in unmapped and one.report.streams]
    lines = [f"{settings.file}: {counted(len(paths), 'file')}"]
    lines += _known_lines(known)
    empty = [one.file for one in looked if one not in unmapped and one not in known]
    lines += [f"no table of numbers: {printable(path)}" for path in empty] + unread
    more = finish(settings, settings.file, unmapped, None, known)
    document = {"files": [file_record(one.file, one.report) for one in looked], **more.result}
    text = "\n".join(lines) + "\n" + more.text
    ready = known and not unmapped and not settings.map and not more.exit_code
    next_ = f"run input={shlex.quote(settings.file)}" if ready else ""
    return Outcome(more.exit_code, text, more.errors, result=document, next=next_)


def _known_lines(known: Sequence[Looked]) -> Iterator[str]:
    """Files that need no new map, by the map that reads them, with what stands in their way."""
    by_map: dict[str | None, list[Looked]] = defaultdict(list)
    for one in known:
        by_map[one.report.source].append(one)
    for source, files in by_map.items():
        many = counted(len(files), "file")
        yield f"{many} read {f'by the source map {source}' if source else 'as they are'}"
        faults = Counter(fault for one in files for fault in one.report.faults)
        yield from (f"  {counted(n, 'file')}: {fault}" for fault, n in faults.items())


def _look_or_fault(task: InspectTask) -> Looked | str:
    """What `look_into` finds, or a line on why the file cannot be opened; in a worker."""
    try:
        return look_into(task)
    except CaptureError as fault:
        return f"{printable(task.file)}: {fault.message}"


def _read_limits(settings: InspectSettings) -> ReadLimits:
    return ReadLimits(settings.read_seconds, settings.read_memory_mb)


def finish(
    settings: InspectSettings,
    root: str,
    unmapped: Sequence[Looked],
    only: tuple[str, ...] | None,
    known: Sequence[Looked] = (),
) -> Outcome:
    """The map of all shapes, previewed, written and checked as far as the settings ask for it.

    Files that a map reads already, the `known`, get that map with the answers in its metadata.

    Parameters
    ----------
    settings
        The keys of `inspect`.
    root
        The folder or file that is inspected.
    unmapped
        Files that no map reads yet.
    only
        Files that the map must read; None for all.
    known
        Files that a map reads already.

    """
    lines: list[str] = []
    text = ""
    asked: dict[str, str] = {}
    metadata = {key: value for key, value in settings.answers.items() if "." not in key}
    if unmapped:
        lines, text, asked = _drafted(settings, root, unmapped, metadata, listed=only is None)
    metadata.pop("captures", None)
    if metadata or settings.map or text:
        text = _with_known(known, settings.config_dir, metadata, text)
    if text and settings.map:
        write_whole(Path(settings.map), text.encode())
        lines.append(f"written: {settings.map}; `run input={root} source={settings.map}`")
    elif text and only is None:
        lines += ["the source map (map=PATH writes it):", "", text.rstrip("\n")]
    answer = {"asked": asked, "map": text or None, "motors": None}
    if not settings.check:
        return Outcome(0, "\n".join(lines) + "\n" if lines else "", result=answer)
    checked = _check(settings, root, text, only)
    text = "\n".join([*lines, checked.text]) + "\n"
    answer |= checked.result
    return Outcome(checked.exit_code, text, checked.errors, result=answer)


def _drafted(
    settings: InspectSettings,
    root: str,
    unmapped: Sequence[Looked],
    metadata: Mapping[str, str],
    *,
    listed: bool,
) -> tuple[list[str], str, dict[str, str]]:
    """Lines about files that no map reads, a source map for them, and what must be asked."""
    from pipeline.io.inspection.file_names import name_patterns
    from pipeline.io.inspection.starter_map import map_text

    groups = _groups(unmapped)
    seen = [field.column for shape, _ in groups for field in shape.fields if field.column]
    paths = [one.file for one in unmapped]
    answered = frozenset(settings.answers)
    names = name_patterns(paths, answered, frozenset(seen))
    unanswered = name_patterns(paths, answered - {"test"}, frozenset(seen))
    if "test" not in unanswered.keys:
        # names give the test of some files, and the answer is that of the others
        names = unanswered
    by_name = any("contract" in dict(one.report.metadata) for one in unmapped)
    text = map_text([shape for shape, _ in groups], names, metadata, by_name=by_name)
    lines = _shape_lines(groups, names) if listed else []
    asked = _questions(groups, names, settings)
    if asked:
        lines += [_QUESTIONS, *(f"  {key}=  {words}" for key, words in asked.items())]
    tasks = [PreviewTask(root, files[0], _read_limits(settings), text) for _, files in groups]
    lines += [line for preview in in_workers(preview_of, tasks) for line in preview]
    return lines, text, asked


def _with_known(
    known: Sequence[Looked], config_dir: str | None, metadata: Mapping[str, str], text: str
) -> str:
    """The source map with the maps that read the `known` files in it, if any."""
    from pipeline.io.inspection.adopted import adopted_text
    from pipeline.io.maps.places import map_file

    sources = (name for one in known for name in (one.report.source or "").split(", ") if name)
    files = list(dict.fromkeys(name.partition("/")[0] for name in sources))
    if not files:
        return text
    return adopted_text([map_file(name, config_dir) for name in files], metadata, text)


def _groups(unmapped: Sequence[Looked]) -> list[tuple[Shape, list[str]]]:
    """The shapes of the files, each with its files and what is seen in any of them."""
    shapes: dict[tuple[object, ...], Shape] = {}
    files: dict[tuple[object, ...], list[str]] = defaultdict(list)
    for one in unmapped:
        shape = one.report.shape
        if shape is None:
            continue
        key = shape.key()
        shapes[key] = shapes[key].joined(shape) if key in shapes else shape
        files[key].append(one.file)
    return [(shape, files[key]) for key, shape in shapes.items()]


def _shape_lines(groups: Sequence[tuple[Shape, list[str]]], names: NamePatterns) -> list[str]:
    from pipeline.io.inspection.text import field_line, part_lines

    lines: list[str] = []
    for number, (shape, files) in enumerate(groups, 1):
        listed = ", ".join(printable(file) for file in files[:8])
        more = f" and {len(files) - 8} more" if len(files) > 8 else ""
        lines.append(f"shape {number}: {counted(len(files), 'file')} ({listed}{more})")
        for stream in shape.streams:
            lines.append(f"  {counted(stream.rows, 'row')} in the first{stream.pace}")
            lines += [f"    {field_line(seen)}" for seen in stream.fields]
            lines += part_lines(stream.parts)
    if names.keys:
        lines.append(f"file names give {', '.join(sorted(names.keys))}")
    return lines


def _questions(
    groups: Sequence[tuple[Shape, list[str]]], names: NamePatterns, settings: InspectSettings
) -> dict[str, str]:
    """What must be answered before the map reads every capture, and in what words."""
    questions: dict[str, str] = {}
    for shape, _ in groups:
        questions |= dict(seen.question for seen in shape.fields if seen.question)
        timeless = settings.answers.get("test") in TESTS_WITHOUT_CLOCK or shape.topics
        columns = {seen.column for seen in shape.fields}
        if not timeless and columns.isdisjoint(("t_s", *OHMMETER)):
            questions["increment_s"] = "s from row to row, where rows follow a clock"
        if any(seen.per_pole_pair for seen in shape.fields):
            questions["pole_pairs"] = "electrical speed is divided by them"
    questions |= {"motor_id": "the serial number", "test": "which test of the contract it is"}
    answered = set(settings.answers) | names.keys
    if any(stream.parts for shape, _ in groups for stream in shape.streams):
        questions["captures"] = "whether the files are cut into the parts above: captures=proposed"
    if "captures" in settings.answers:
        answered |= {"test"}
    return {key: text for key, text in questions.items() if key not in answered}


def preview_of(task: PreviewTask) -> list[str]:
    """The first rows of a file through a map, as lines; in a worker, under its limits.

    Parameters
    ----------
    task
        The file and the map.

    """
    from pipeline.io.inspection.preview import preview

    if task.refused is not None:
        raise died(task.refused)
    place = Path(task.folder) / task.file
    with reading(task.file, size_bytes(place), task.limits):
        return preview(Path(task.folder), task.file, task.map_text, PREVIEW_ROWS)


def _check(
    settings: InspectSettings, root: str, text: str, only: tuple[str, ...] | None
) -> Outcome:
    """Every capture read and validated through the map, and what it determines."""
    from pipeline.stages.steps.campaigns import campaigns

    with TemporaryDirectory() as place:
        source = (settings.map if text else None) or "auto"
        if text and not settings.map:
            source = str(Path(place) / "proposed.yaml")
            write_whole(Path(source), text.encode())
        limits = _read_limits(settings)
        read = campaigns(root, source, limits=limits, config_dir=settings.config_dir, only=only)
    motors = [motor_record(campaign) for campaign in read.campaigns]
    lines = [line for motor in motors for line in motor_lines(motor)]
    refused = any(one.severity == "refused" for one in read.findings)
    if not read.campaigns:
        lines.append("no capture can be used yet")
    code = first_that_applies(3 if refused else 0, 0 if read.campaigns else 4)
    errors = tuple(lines_of(read.findings))
    return Outcome(
        code, "\n".join(lines), errors, result={"motors": motors}, faults=faults_of(read.findings)
    )
