"""JSON payloads: the fast way and the careful way give what json.loads gives, or refuse."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.io.mcap import json_payload
from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file


def fields(payloads: list[bytes]) -> dict[str, np.ndarray]:
    data = mcap_file([("/s", START_NS + n, p) for n, p in enumerate(payloads)])
    tables = read_tables(scan(data), lambda _topic, _name: True)
    return tables[0].fields if tables else {}


def rows_of(messages: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    return fields([json.dumps(message).encode() for message in messages])


row = st.fixed_dictionaries(
    {"a": st.floats(allow_nan=False, allow_infinity=False)},
    optional={
        "b": st.none() | st.floats(allow_infinity=False) | st.integers(-(2**53), 2**53),
        "c": st.text(max_size=3),
        "d": st.fixed_dictionaries({}, optional={"e": st.floats(-10, 10), 'f"': st.integers(0, 9)}),
    },
)


@given(st.lists(row, min_size=1, max_size=10))
@settings(max_examples=50)
def test_keys_that_come_and_go_are_missing_and_never_shifted(messages: list[Any]) -> None:
    got = rows_of(messages)

    def number(value: Any) -> float:
        return np.nan if value is None else float(value)

    np.testing.assert_array_equal(got["a"], [m["a"] for m in messages])
    if any("b" in m for m in messages):
        np.testing.assert_array_equal(got["b"], [number(m.get("b")) for m in messages])
    for key in ("e", 'f"'):
        if any(key in m.get("d", {}) for m in messages):
            expected = [number(m.get("d", {}).get(key)) for m in messages]
            np.testing.assert_array_equal(got[f"d.{key}"], expected)


def test_equal_messages_take_the_fast_way(monkeypatch: pytest.MonkeyPatch) -> None:
    def careful(*_: Any) -> None:
        raise AssertionError("the careful way was taken")

    monkeypatch.setattr(json_payload, "_one_by_one", careful)
    got = rows_of([{"t_s": n / 8, "m": {"ia_a": [n, None], "s": "x"}} for n in range(5)])
    np.testing.assert_array_equal(got["t_s"], np.repeat(np.arange(5) / 8, 2))
    np.testing.assert_array_equal(got["m.ia_a"], [v for n in range(5) for v in (n, np.nan)])


def test_pretty_printed_messages_are_one_message_each() -> None:
    got = fields([json.dumps({"a": n, "b": [n]}, indent=1).encode() for n in range(3)])
    np.testing.assert_array_equal(got["a"], [0, 1, 2])


def test_whole_nanoseconds_keep_every_digit() -> None:
    times = [1_760_000_000_000_000_001 + 50 * n for n in range(4)]
    np.testing.assert_array_equal(rows_of([{"ns": t} for t in times])["ns"], times)


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"[1]",
        b"5",
        b'{"a": 1',
        b'{"a": 1} {"a": 2}',
        b'{"a": 1, "a": 2}',
        b'{"a": 1e999}',
        b'{"a": -Infinity}',
        b'{"a": "1.5", "b": ["x"]}',
        b'{"a": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
        b'{"a": ' + b'{"a": ' * 100_000 + b"1" + b"}" * 100_001,
        b'{"a": ' + b"9" * 5000 + b"}",
        b'{"a": [1, [2]]}',
        b'{"a": \xff}',
        b"\xff\xfe{\0}\0",
    ],
)
def test_hostile_messages_are_refused(payload: bytes) -> None:
    """Depth, huge numbers, duplicate keys and broken text end in a CaptureError, alone or later."""
    for payloads in ([payload], [b'{"a": 1}', payload], [payload, b'{"a": 1}']):
        with pytest.raises(CaptureError) as refused:
            fields(payloads)
        assert refused.value.code == "bad_message"


def test_a_key_missing_here_and_doubled_there_is_noticed() -> None:
    """Compensating quotes must not fool the fast way."""
    with pytest.raises(CaptureError):
        fields([b'{"a":1,"b":2}', b'{"a":1}', b'{"a":1,"b":2,"b":3}'])
    got = fields([b'{"a":1,"b":2}', b'{"a":1}', b'{"a":"x","b":3}'])
    np.testing.assert_array_equal(got["a"], [1, 1, np.nan])
    np.testing.assert_array_equal(got["b"], [2, np.nan, 3])
