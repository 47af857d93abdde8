"""File names of motors: injective on any file system, safe, readable where the id is harmless."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pipeline.records.naming import MAX_CHARS, counted, file_stem

SAFE = re.compile(r"[A-Za-z0-9_~][A-Za-z0-9_.~-]*")
DEVICES = {"con", "prn", "aux", "nul"} | {f"{p}{n}" for p in ("com", "lpt") for n in range(10)}
HOSTILE = [
    "",
    ".",
    "..",
    "../x",
    "CON",
    "con",
    "nul.txt",
    "COM1",
    "a",
    "A",
    "a ",
    "a.",
    "~61",
    "<b>",
]
ids = st.one_of(
    st.text(st.characters(), max_size=40),
    st.text("aAbB~.-/\\ 0u", max_size=12),
    st.sampled_from(HOSTILE),
    st.text("xX", min_size=80, max_size=300),
)


def decode(stem: str) -> str:
    """The inverse, written from the docstring alone, on a stem that lost its case."""
    if stem.lower() == "~n":
        return ""
    body, _, mask = stem.lower().partition("~u")
    raw = re.sub(rb"~([0-9a-f]{2})", lambda m: bytes([int(m[1], 16)]), body.encode())
    expected = re.sub(
        r"(?<![a-z])[a-z][a-z]?(?=-?[0-9])",
        lambda m: m[0].upper(),
        raw.decode("utf-8", "surrogatepass"),
    )
    bits, out = int(mask or "0", 16), []
    for char in expected:
        deviates = char.isascii() and char.isalpha() and bits & 1
        bits >>= char.isascii() and char.isalpha()
        out.append(char.swapcase() if deviates else char)
    return "".join(out)


@pytest.mark.parametrize(
    ("motor_id", "stem"),
    [
        ("joint-P0", "joint-P0"),
        ("SN-0012", "SN-0012"),
        ("MN4004-KV300", "MN4004-KV300"),
        ("left_knee.2", "left_knee.2"),
        ("cogging_cw.csv", "cogging_cw.csv"),
        ("resistance_ab_0", "resistance_ab_0"),
        ("p0", "p0~u1"),
        ("Motor", "Motor~u1"),
        ("MOTOR", "MOTOR~u1f"),
        ("", "~n"),
        (".", "~2e"),
        ("..", "~2e~2e"),
        ("../../etc", "~2e.~2f..~2fetc"),
        ("-rf", "~2drf"),
        ("nul", "~6eul"),
        ("index", "~69ndex"),
        ("con.v2", "~63on.v2~u8"),
        ("motor 1", "motor~201"),
        ("é", "~c3~a9"),
        ("A~B", "A~7eB~u3"),
    ],
)
def test_known_ids(motor_id: str, stem: str) -> None:
    assert file_stem(motor_id) == stem


@given(ids, ids)
@example("a", "A")
@example("~61", "a")
@example("con", "CON")
@example("", "~n")
def test_no_two_ids_share_a_name_on_a_file_system_blind_to_case(one: str, other: str) -> None:
    assert (file_stem(one).lower() == file_stem(other).lower()) == (one == other)


@given(ids)
def test_every_name_is_safe_and_the_same_each_time(motor_id: str) -> None:
    stem = file_stem(motor_id)
    assert SAFE.fullmatch(stem)
    assert not stem.endswith(".")
    assert len(stem) <= MAX_CHARS
    assert stem.split(".")[0].lower() not in DEVICES
    assert stem == file_stem(motor_id)


@given(st.text(st.one_of(st.characters(), st.sampled_from("abAB~.-1")), max_size=9))
def test_an_independent_decoder_gets_the_id_back(motor_id: str) -> None:
    assert decode(file_stem(motor_id)) == motor_id


def test_long_ids_keep_a_readable_beginning_and_stay_apart() -> None:
    one, other = "gearbox-" + "x" * 300, "gearbox-" + "x" * 301
    assert file_stem(one).startswith("gearbox-xxx")
    assert file_stem(one) != file_stem(other)
    assert len(file_stem(one)) == MAX_CHARS


def test_a_number_of_things_is_one_thing_or_several() -> None:
    told = [counted(n, noun) for n in (0, 1, 2) for noun in ("motor", "mismatch")]
    assert told == ["0 motors", "0 mismatches", "1 motor", "1 mismatch", "2 motors", "2 mismatches"]
