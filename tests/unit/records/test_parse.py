"""The one place where numbers and texts of files are converted: what it takes and refuses."""

from __future__ import annotations

import ast
from datetime import UTC, datetime
from pathlib import Path

import pytest

import pipeline
from pipeline.records.parse import (
    ParseError,
    decoded,
    is_text,
    json_value,
    number,
    utc_moment,
    whole,
)

ROOT = Path(pipeline.__file__).parent


@pytest.mark.parametrize(
    ("text", "value"),
    [("0", 0), ("0042", 42), ("+7", 7), ("9" * 18, 10**18 - 1), ("0" * 300 + "5", 5)],
)
def test_whole_numbers(text: str, value: int) -> None:
    assert whole(text) == value


@pytest.mark.parametrize(
    "text",
    ["", "9" * 5000, "9" * 20, "-1", "1.0", "1_000", "٣", "²", "0x10", " 1", "1\n", "nan", "1e3"],
)
def test_what_no_bench_counts_is_no_whole_number(text: str) -> None:
    """5,000 digits made Python's `int` raise, and the run end with exit 5."""
    assert whole(text) is None


def test_limits_of_a_whole_number() -> None:
    assert whole("-3", -5, 5) == -3
    assert whole("-6", -5, 5) is None
    assert whole("6", -5, 5) is None


@pytest.mark.parametrize(
    ("text", "value"), [("1.5", 1.5), ("-2.5e-3", -0.0025), (".5", 0.5), ("7.", 7.0), (" 8 ", 8.0)]
)
def test_numbers(text: str, value: float) -> None:
    assert number(text) == value


@pytest.mark.parametrize(
    "text",
    ["", ".", "nan", "inf", "-Infinity", "1e999", "1_000", "٣", "1,5", "9" * 5000, "1e", "e5"],
)
def test_what_no_instrument_says_is_no_number(text: str) -> None:
    assert number(text) is None


def test_moments() -> None:
    assert utc_moment("2026-03-01T12:00+02:00") == datetime(2026, 3, 1, 10, tzinfo=UTC)
    assert utc_moment("2026-03-01") == datetime(2026, 3, 1, tzinfo=UTC)
    for text in ("", "soon", "9" * 5000, "0001-01-01T00:00+23:00", "9999-12-31T23:59-14:00"):
        assert utc_moment(text) is None


def test_bytes_that_are_no_text() -> None:
    assert decoded("Ω".encode()) == "Ω"
    for data, encoding in ((b"\xff", "utf-8"), (b"a", "utf-99"), (b"\xed\xa0\x80", "utf-8")):
        with pytest.raises(ParseError):
            decoded(data, encoding)
    assert is_text("Ω")
    assert not is_text("a\ud800")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b'{"a": "\\ud800"}', "surrogate"),
        (b'{"\\udfff": 1}', "surrogate"),
        (b'{"a": ' + b"9" * 5000 + b"}", "5000 digits"),
        (b"[" * 200_000, "too deep"),
        (b'{"a": 1, "a": 2}', "a key twice"),
        (b"\xff", "not UTF-8"),
        (b"{", "cannot be read"),
        (b"", "cannot be read"),
    ],
)
def test_json_that_no_recorder_writes(data: bytes, says: str) -> None:
    """Half a surrogate pair ended in UnicodeEncodeError, and the run with exit 5."""
    with pytest.raises(ParseError, match=says):
        json_value(data, unique_keys=True)


def test_json_keeps_what_it_is() -> None:
    assert json_value(b'{"n": 9007199254740993, "t": "\\ud83d\\ude00"}') == {
        "n": 9007199254740993,
        "t": "\U0001f600",
    }
    assert json_value(b"1" + b"0" * 30) == 1e30


# Where bytes of strangers come in; the registry and the notes are the project's own, under seals.
GUARDED = ("io/mcap", "io/readers", "contracts")
GUARDED_FILES = (
    "io/tables/csv_table.py",
    "io/ingest/metadata.py",
    "io/storage/plain_yaml.py",
    "io/maps/source_map.py",
    "io/maps/map_file.py",
    "io/ingest/survey.py",
    "io/inspection/describe.py",
    "io/inspection/sniff.py",
    "io/maps/columns.py",
)
# latin-1 and `replace` take any byte.
HARMLESS = {"decode": ("latin-1", "replace")}


def _conversions(source: str) -> list[str]:
    """Calls that raise on hostile text: json.loads, .decode(...), fromisoformat."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        name, words = node.func.attr, [a.value for a in node.args if isinstance(a, ast.Constant)]
        stream = "decoder" in ast.unparse(node.func.value)
        if name in ("loads", "fromisoformat"):
            found.append(f"{name} in line {node.lineno}")
        if name == "decode" and not stream and not set(words) & set(HARMLESS["decode"]):
            found.append(f"decode in line {node.lineno}")
    return found


def test_readers_convert_text_in_the_guarded_place_alone() -> None:
    files = [f for place in GUARDED for f in sorted((ROOT / place).rglob("*.py"))]
    files += [ROOT / name for name in GUARDED_FILES]
    told = {str(f.relative_to(ROOT)): _conversions(f.read_text(encoding="utf-8")) for f in files}
    assert {name: calls for name, calls in told.items() if calls} == {}
    assert _conversions("json.loads(x)\ny.decode()\ndatetime.fromisoformat(z)") != []
