"""The source map of one file or a folder: what is known is filled in, what is asked a comment."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

from pipeline.io.inspection.file_names import NamePatterns
from pipeline.io.inspection.proposals import FieldSeen, StreamSeen
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect

_LONGEST_HEADER = 400
_KEY_WORDS = {"motor_id": "the serial number", "test": "one of the contract's"}


@dataclass(frozen=True, slots=True)
class Shape:
    """Files of one shape: how they are laid out and recognised, and what they hold.

    `header` is the line that names the columns, None where there is none; `suffixes` are those of
    the files without one; `reader` names the plug-in of a form that is no text.
    """

    streams: tuple[StreamSeen, ...]
    dialect: CsvDialect = CONTRACT_DIALECT
    header: str | None = None
    topics: tuple[str, ...] = ()
    suffixes: tuple[str, ...] = ()
    reader: str | None = None
    marked: bool = False
    """Whether the file begins with a byte order mark."""

    @property
    def fields(self) -> tuple[FieldSeen, ...]:
        """The fields of all streams."""
        return tuple(field for stream in self.streams for field in stream.fields)

    def joined(self, other: Shape) -> Shape:
        """This shape with what another file of it shows: wraps, units, suffixes.

        Parameters
        ----------
        other
            The shape of the other file.

        """
        streams = tuple(
            replace(
                one,
                fields=tuple(map(_clearer, one.fields, two.fields)),
                parts=(*one.parts, *two.parts),
            )
            for one, two in zip(self.streams, other.streams, strict=True)
        )
        suffixes = tuple(dict.fromkeys([*self.suffixes, *other.suffixes]))
        marked = self.marked or other.marked
        return replace(self, streams=streams, suffixes=suffixes, marked=marked)

    def key(self) -> tuple[object, ...]:
        """What files of one shape have in common."""
        names = tuple((s.name, f.name) for s in self.streams for f in s.fields)
        return self.dialect, self.header, self.topics, self.reader, names


def _clearer(one: FieldSeen, other: FieldSeen) -> FieldSeen:
    """The field of two files that leaves less open, with the wrap that either shows."""
    clear, vague = (other, one) if one.question and not other.question else (one, other)
    if clear.wraps is None and clear.column == vague.column and vague.wraps is not None:
        return replace(clear, wraps=vague.wraps, why=vague.why)
    return clear


def map_text(
    shapes: Sequence[Shape],
    names: NamePatterns | None = None,
    answers: Mapping[str, str] | None = None,
    *,
    by_name: bool = False,
) -> str:
    """A source map in YAML for files of these shapes.

    `answers` are metadata, `increment_s` and `captures`. `by_name`: the file says `contract` and so
    has to name the map that it is to be read by.

    Parameters
    ----------
    shapes
        At least one; several become variants.
    names
        Patterns of their file names.
    answers
        Metadata, `increment_s`, and `captures`, with which files are cut into the parts seen.
    by_name
        Whether the file states `contract`, so that it must name the map that it is read by.

    Returns
    -------
    str
        What must be asked is a comment.

    """
    answered = dict(answers or {})
    increment = answered.pop("increment_s", None)
    cut = answered.pop("captures", None) is not None
    lines = ["# A source map. Lines that are comments wait for an answer; docs/source-maps.md."]
    if by_name:
        text = "`# source: NAME` among its first lines"
        in_text = shapes[0].header is not None
        where = text if in_text else "`source: NAME` in its metadata or NAME.meta.yaml"
        lines.append(f"# The file itself must name it: {where}.")
    names = names or NamePatterns()
    lines += _metadata_lines(answered, names)
    if len(shapes) == 1:
        lines += _shape_lines(shapes[0], increment) + _capture_lines(shapes[0], cut)
    else:
        lines.append("variants:")
        for shape in shapes:
            lines_of_shape = _shape_lines(shape, increment) + _capture_lines(shape, cut)
            lines += [f"  - {lines_of_shape[0]}", *(f"    {line}" for line in lines_of_shape[1:])]
    return "\n".join(lines) + "\n"


def _metadata_lines(given: Mapping[str, str], names: NamePatterns) -> Iterator[str]:
    yield "metadata:"
    yield from (f"  {key}: {_quoted(value)}" for key, value in given.items() if "." not in key)
    for key, words in _KEY_WORDS.items():
        if key not in given and key not in names.keys:
            yield f"  # {key}: {words}"
    if "station" not in given:
        yield "  station: unknown"
    if names.patterns:
        yield "file_names:"
        yield from (f"  - {_quoted(pattern)}" for pattern in names.patterns)
    if names.values:
        yield "values:"
        for key, values in names.values.items():
            pairs = ", ".join(f"{_quoted(word)}: {value}" for word, value in values.items())
            yield f"  {key}: {{{pairs}}}"


def _shape_lines(shape: Shape, increment: str | None) -> list[str]:
    lines = ["recognise:", f"  {_recognise(shape)}"]
    if shape.reader:
        lines.append(f"reader: {shape.reader}")
    lines += _layout_lines(shape.dialect)
    lines.append("fields:")
    lines += [f"  {_field_line(field)}" for field in shape.fields]
    if not any(field.column == "t_s" for field in shape.fields):
        if shape.topics:
            stamped = all(stream.stamped for stream in shape.streams if stream.fields)
            lines += ["time:", f"  from: {'stamp' if stamped else 'log'}"]
        elif increment:
            lines += ["time:", "  from: increment", f"  increment_s: {increment}"]
        else:
            lines.append("# time: {from: increment, increment_s: }   # s from row to row")
    return lines


def _capture_lines(shape: Shape, cut: bool) -> list[str]:
    """Parts that the rows show, as comments where nobody asked for them."""
    parts = [part for stream in shape.streams for part in stream.parts]
    if not parts:
        return []
    lines = ["captures:   # parts that the rows show; without them each file is one capture"]
    lines += [f"  {one.line}   # {one.why}" for one in parts if one.test is not None]
    return lines if cut else [f"# {line}" for line in lines]


def _recognise(shape: Shape) -> str:
    if shape.header is not None and shape.reader is None:
        pattern = header_pattern(shape.header, shape.dialect.encoding, marked=shape.marked)
        return f"header: {_quoted(pattern)}"
    if shape.topics:
        return f"topics: [{', '.join(_quoted(topic) for topic in sorted(set(shape.topics)))}]"
    return f"files: [{', '.join(_quoted('*' + suffix) for suffix in shape.suffixes or ('.csv',))}]"


def header_pattern(header: str, encoding: str = "utf-8", *, marked: bool = False) -> str:
    """A regular expression of a header line, whatever the bytes of what is not ASCII in it.

    Parameters
    ----------
    header
        The line.
    encoding
        Of the file. Where letters have bytes that are ASCII, as in Shift JIS, any bytes stand for
        them.
    marked
        Whether a mark may stand before it, such as of the byte order.

    """
    text = header.strip()
    fits = len(re.escape(text)) <= _LONGEST_HEADER
    pattern = re.escape(text if fits else text[: _LONGEST_HEADER // 2])
    pattern = re.sub(r"(?:\\?[^\x00-\x7F])+", lambda _: r"[^\\x00-\\x7F]+", pattern)
    pattern = pattern.replace("[^\\\\x00-\\\\x7F]", "[^\\x00-\\x7F]").replace("\\\t", "\\t")
    if any(byte < 128 for c in text if not c.isascii() for byte in c.encode(encoding, "ignore")):
        pattern = pattern.replace("[^\\x00-\\x7F]+", ".+")
    begin = r"^[^\x00-\x7F]*" if marked else "^"
    return begin + pattern + (r"\s*$" if fits else "")


def _field_line(seen: FieldSeen) -> str:
    why = f"; {seen.why}" if seen.why else ""
    if seen.column is None:
        remark = f"asked: {seen.question[1]}" if seen.question else "not recognised"
        return f"# {_quoted(seen.name)}: {{column: , unit: }}   # {remark}{why}"
    parts = [f"column: {seen.column}"]
    if seen.question is not None:
        line = f"{_quoted(seen.name)}: {{{parts[0]}, unit: }}"
        return f"# {line}   # asked: {seen.question[1]}{why}"
    parts += [f"unit: {_quoted(seen.unit)}"] if seen.unit else []
    parts += [f"scale: {seen.scale!r}"] if seen.scale else []
    parts += [f"times: {_quoted(seen.times)}"] if seen.times else []
    parts += [f"wraps: {seen.wraps:.12g}"] if seen.wraps else []
    parts += ["per_pole_pair: true"] if seen.per_pole_pair else []
    note = "" if seen.certain else "   # probably: check column, unit and sign"
    return f"{_quoted(seen.name)}: {{{', '.join(parts)}}}{note}{why if note else ''}"


def _layout_lines(dialect: CsvDialect) -> list[str]:
    lines: list[str] = []
    for part in fields(CsvDialect):
        value = getattr(dialect, part.name)
        if value == getattr(CONTRACT_DIALECT, part.name):
            continue
        if isinstance(value, bool):
            text = str(value).lower()
        elif isinstance(value, tuple):
            text = f"[{', '.join(_quoted(name) for name in value)}]"
        elif isinstance(value, str):
            text = _quoted({"\t": "tab", " ": "space"}.get(value, value))
        else:
            text = str(value)
        lines.append(f"  {part.name}: {text}")
    return ["layout:", *lines] if lines else []


def _quoted(text: str) -> str:
    """YAML text in single quotes; control characters cannot be in a name that was printed."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return "'" + plain.replace("'", "''") + "'"
