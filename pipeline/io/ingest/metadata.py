"""What is stated of a capture: in the file, beside it, in the manifest, in the source map."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

from pipeline.io.storage.plain_yaml import load_plain
from pipeline.physics.glossary import METADATA, TESTS
from pipeline.records import parse
from pipeline.records.capture import CaptureMeta
from pipeline.records.errors import CaptureError, merged
from pipeline.records.finding import Finding
from pipeline.records.parse import ParseError, decoded, is_text
from pipeline.records.stated import may_be_stated, number_wanted

MANIFEST = "manifest.csv"
SIDECAR_SUFFIX = ".meta.yaml"


def is_about_others(path: str) -> bool:
    """Whether a file holds metadata of other files.

    Parameters
    ----------
    path
        Its path.

    """
    return PurePosixPath(path).name == MANIFEST or path.endswith(SIDECAR_SUFFIX)


CONTRACT_VERSION = "1"
MAX_MANIFEST_BYTES = 2**22
MAX_SIDECAR_BYTES = 2**17
MOST_KEY_CHARS = 200
MOST_VALUE_CHARS = 2**16
_CHOICES = {
    "winding": ("wye", "delta"),
    "pair": ("ab", "bc", "ca"),
    "voltage_kind": ("measured", "commanded"),
    "voltage_timing": ("instant", "held", "centred"),
}


def merge(
    path: str, sources: Sequence[tuple[str, Mapping[str, str]]]
) -> tuple[dict[str, str], list[Finding]]:
    """The statements of all sources on one capture, the first one counting.

    Parameters
    ----------
    path
        Of the capture, for findings.
    sources
        Name for messages, and texts by key; the strongest first.

    Returns
    -------
    values
        Texts by key.
    findings
        A warning for each contradiction; numbers that are equal do not contradict each other.

    """
    stated: dict[str, str] = {}
    origin: dict[str, str] = {}
    findings: list[Finding] = []
    for name, values in sources:
        for key, value in values.items():
            if key not in stated:
                stated[key], origin[key] = value, name
            elif not _same(stated[key], value):
                findings.append(
                    Finding(
                        path,
                        "warning",
                        "metadata_contradiction",
                        f"{name} says {key} is {value!r}, {origin[key]} says {stated[key]!r}, "
                        f"which counts",
                        "correct one of the two",
                    )
                )
    return stated, findings


def _same(one: str, other: str) -> bool:
    if one.strip() == other.strip():
        return True
    values = parse.number(one), parse.number(other)
    return None not in values and values[0] == values[1]


def sidecar(data: bytes) -> dict[str, str]:
    """The keys of a NAME.meta.yaml, every value as the text that was written.

    Parameters
    ----------
    data
        Bytes of the file.

    Returns
    -------
    dict
        Texts by key.

    Raises
    ------
    CaptureError
        It is no plain YAML (`bad_yaml`), or no mapping of single values (`bad_metadata`).

    """
    stated = load_plain(data, "the sidecar")
    if not isinstance(stated, dict):
        raise CaptureError("bad_metadata", "the sidecar is no list of keys", "write `key: value`")
    nested = [key for key, value in stated.items() if not isinstance(value, str)]
    if nested:
        raise CaptureError(
            "bad_metadata", f"the sidecar's {nested[0]!r} is no single value", "write `key: value`"
        )
    return stated


def manifest(data: bytes, folder: str) -> dict[str, dict[str, str]]:
    """What a manifest.csv says of each file.

    Parameters
    ----------
    data
        Bytes of the file.
    folder
        Where it lies, relative to the input folder.

    Returns
    -------
    dict
        Texts by key, by the path of the file relative to the input folder; empty cells say nothing.

    Raises
    ------
    CaptureError
        It is larger than 4 MiB, no table with `file` as its first column, or names a file or a
        column twice (`bad_manifest`).

    """
    if len(data) > MAX_MANIFEST_BYTES:
        raise _bad_manifest("is larger than 4 MiB")
    try:
        text = decoded(data, "utf-8-sig")
        rows = list(csv.reader(io.StringIO(text, newline=""), strict=True))
    except (ParseError, csv.Error) as fault:
        raise _bad_manifest(f"cannot be read: {fault}") from None
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    if not rows or rows[0][0].strip() != "file":
        raise _bad_manifest("does not have `file` as its first column")
    keys = [key.strip() for key in rows[0]]
    if len(set(keys)) != len(keys):
        raise _bad_manifest("has a column twice")
    by_file: dict[str, dict[str, str]] = {}
    for number, row in enumerate(rows[1:]):
        if len(row) != len(keys):
            raise _bad_manifest(f"has {len(row)} fields in row {number}", (number, number))
        path = (PurePosixPath(folder) / row[0].strip()).as_posix()
        if path in by_file:
            raise _bad_manifest(f"names {row[0]!r} twice", (number, number))
        cells = zip(keys[1:], row[1:], strict=True)
        by_file[path] = {key: cell.strip() for key, cell in cells if cell.strip()}
    return by_file


def _bad_manifest(what: str, rows: tuple[int, int] | None = None) -> CaptureError:
    return CaptureError(
        "bad_manifest", f"the manifest {what}", "write a table with a column `file`", rows
    )


def capture_meta(values: Mapping[str, str]) -> CaptureMeta:
    """The metadata of one capture, each key as its type.

    Parameters
    ----------
    values
        Texts by key.

    Returns
    -------
    CaptureMeta
        Keys that the contract does not know are in `extra`.

    Raises
    ------
    CaptureError
        The contract is another one, or all that is missing, unknown, no number or out of its range.

    """
    if values.get("contract") != CONTRACT_VERSION:
        raise CaptureError(
            "contract_version",
            f"the capture follows contract {values.get('contract')!r}",
            f"this pipeline reads contract {CONTRACT_VERSION}",
        )
    faults = _missing(values)
    known: dict[str, Any] = {}
    extra: dict[str, str] = {}
    for key, value in values.items():
        if key in METADATA and key != "contract":
            if value.strip():
                try:
                    known[key] = _typed(key, value.strip())
                except CaptureError as fault:
                    faults.append(fault)
        elif key != "contract":
            extra[key] = value
            if may_be_stated(key.removeprefix("u_")):
                number = number_wanted(key, parse.number(value))
                faults += [_bad_value(key, value, f"write a {number}")] if number else []
    if faults:
        raise merged(faults)
    return CaptureMeta(**known, extra=dict(sorted(extra.items())))


def check_texts(values: Mapping[str, str]) -> None:
    """Refuses metadata that no output can hold.

    Parameters
    ----------
    values
        Texts by key.

    Raises
    ------
    CaptureError
        A text holds half of a surrogate pair, or a key or value is too long.

    """
    for key, value in values.items():
        if not (is_text(key) and is_text(value)):
            words = f"the text of {key[:60]!r} holds half of a surrogate pair, which is no text"
            raise CaptureError("bad_metadata", words, "write it as UTF-8")
        if len(key) > MOST_KEY_CHARS or len(value) > MOST_VALUE_CHARS:
            words = f"the text of {key[:60]!r} has {len(value)} characters"
            remedy = f"up to {MOST_VALUE_CHARS} are metadata, {MOST_KEY_CHARS} a key"
            raise CaptureError("limit", words, remedy)


def belongs(values: Mapping[str, str]) -> None:
    """Refuses metadata that name no motor: such a file is in no campaign.

    Parameters
    ----------
    values
        Texts by key.

    Raises
    ------
    CaptureError
        As `capture_meta` raises it.

    """
    if not values.get("motor_id", "").strip():
        capture_meta(values)


def _missing(values: Mapping[str, str]) -> list[CaptureError]:
    """One fault for each of the keys that every capture needs and this one lacks."""
    return [
        CaptureError(
            "missing_metadata",
            f"nothing states {key}",
            f"write {key} into the file's metadata, NAME{SIDECAR_SUFFIX} or {MANIFEST}",
        )
        for key in ("motor_id", "test")
        if not values.get(key, "").strip()
    ]


def _typed(key: str, value: str) -> str | int | float:
    """A metadata value in its type, within the glossary's range."""
    term = METADATA[key]
    if key == "test" and value not in TESTS:
        raise CaptureError(
            "unknown_test", f"the test {value[:60]!r} is unknown", f"use {', '.join(TESTS)}"
        )
    if term.unit == "text":
        if value not in _CHOICES.get(key, (value,)):
            raise _bad_value(key, value, f"use one of {', '.join(_CHOICES[key])}")
        return value
    low, high = term.low, term.high
    kind = "a whole number" if term.integer else "a number"
    remedy = f"write {kind} from {low:g} to {high:g} [{term.unit}]"
    number = parse.number(value)
    if number is None:
        raise _bad_value(key, value, remedy)
    inside = (low is None or number >= low) and (high is None or number <= high)
    if not inside or (term.integer and number != int(number)):
        raise _bad_value(key, value, remedy)
    return int(number) if term.integer else number


def _bad_value(key: str, value: str, remedy: str) -> CaptureError:
    return CaptureError("bad_metadata", f"{key} is {value[:60]!r}", f"for {key} {remedy}")
