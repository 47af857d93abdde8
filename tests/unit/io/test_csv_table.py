"""Text tables: what is whole is read exactly, what is cut, packed or foreign is refused."""

from __future__ import annotations

import gzip
import hashlib
import zlib

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from pipeline.io.tables.csv_dialect import CsvDialect
from pipeline.io.tables.csv_table import read_csv
from pipeline.records.errors import CaptureError

HEAD = b"# contract: 1\n# motor_id: 000123\n# test: drive\n"
ROWS = b"t_s,iq_a,vq_v\n0.0,1.5,2\n0.001,,-3e-2\n0.002,nan,4\n"


def with_digest(rows: bytes, count: int | None = None) -> bytes:
    lines = rows.count(b"\n") - 1 if count is None else count
    digest = hashlib.sha256(rows).hexdigest()
    return HEAD + f"# sha256_rows: {digest}/{lines}\n".encode() + rows


def refusal(data: bytes, dialect: CsvDialect | None = None) -> CaptureError:
    with pytest.raises(CaptureError) as refused:
        read_csv(data, dialect or CsvDialect())
    return refused.value


@pytest.mark.parametrize("data", [HEAD + ROWS, with_digest(ROWS), b"\xef\xbb\xbf" + HEAD + ROWS])
def test_numbers_missing_values_and_texts_are_kept_as_written(data: bytes) -> None:
    found = read_csv(data)
    assert found.metadata["motor_id"] == "000123"
    assert found.verified == (b"sha256_rows" in data)
    np.testing.assert_array_equal(found.table.fields["t_s"], [0.0, 0.001, 0.002])
    np.testing.assert_array_equal(found.table.fields["iq_a"], [1.5, np.nan, np.nan])
    np.testing.assert_array_equal(found.table.fields["vq_v"], [2.0, -0.03, 4.0])


def test_crlf_lines_read_the_same_and_the_digest_is_of_the_bytes() -> None:
    rows = ROWS.replace(b"\n", b"\r\n")
    found = read_csv(with_digest(rows))
    assert found.verified
    np.testing.assert_array_equal(found.table.fields["vq_v"], [2.0, -0.03, 4.0])


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=30))
def test_every_float_survives_its_shortest_text(values: list[float]) -> None:
    rows = "ia_a,vab_v\n" + "".join(f"{v!r},0\n" for v in values)
    got = read_csv(rows.encode()).table.fields["ia_a"]
    assert got.tobytes() == np.array(values).tobytes()


def test_unknown_columns_may_hold_any_text() -> None:
    rows = b"t_s,serial,iq_a\n0,000123,1\n1,a b,2\n"
    found = read_csv(rows, wanted=lambda name: name != "serial")
    assert set(found.table.fields) == {"t_s", "iq_a"}


@pytest.mark.parametrize(
    ("data", "code", "rows"),
    [
        (HEAD + ROWS[:-3], "truncated", (2, 2)),
        (HEAD + ROWS + b"0.003,1\n", "ragged_row", (3, 3)),
        (HEAD + ROWS + b"0.003,1,2,3\n", "ragged_row", (3, 3)),
        (HEAD + ROWS + b"\n0.003,1,2\n", "ragged_row", (3, 3)),
        (HEAD + ROWS + b"0.003,abc,1\n", "bad_number", (3, 3)),
        (HEAD + ROWS + b"0.003,1_0,1\n", "bad_number", (3, 3)),
        (HEAD + ROWS + b"0.003,1e999,1\n", "infinite", (3, 3)),
        (HEAD + b"t_s,t_s\n0,1\n", "duplicate_column", None),
        (HEAD, "no_header", None),
        (b"", "no_header", None),
        ((HEAD + ROWS).replace(b"\n", b"\r"), "encoding", None),
        ((HEAD + ROWS).decode().encode("utf-16"), "encoding", None),
        (HEAD + ROWS + b"\0\0,1,2\n", "encoding", None),
        (gzip.compress(HEAD + ROWS, mtime=0), "encoding", None),
        (zlib.compress(HEAD + ROWS), "encoding", None),
        (zstandard.compress(HEAD + ROWS), "encoding", None),
        (HEAD + b"# test: cogging\n" + ROWS, "bad_metadata", None),
        (with_digest(ROWS).replace(b"-3e-2", b"-3e-3"), "corrupt", (0, 2)),
        (with_digest(ROWS).replace(b"iq_a", b"id_a"), "corrupt", (0, 2)),
        (with_digest(ROWS + b"0.003,1,2\n")[: -len(b"0.003,1,2\n")], "truncated", (3, 3)),
        (with_digest(ROWS, 7), "truncated", (3, 6)),
        (HEAD + b"# sha256_rows: 12/3\n" + ROWS, "bad_metadata", None),
    ],
)
def test_what_is_wrong_is_refused_with_its_rows(
    data: bytes, code: str, rows: tuple[int, int] | None
) -> None:
    fault = refusal(data)
    assert (fault.code, fault.rows) == (code, rows)
    assert fault.remedy


def test_every_cut_of_a_file_with_a_digest_is_refused() -> None:
    """0 silent errors: no prefix of a verified table reads as a table (but for its last break)."""
    data = with_digest(ROWS)
    begin = data.index(b"# sha256_rows") + 90
    for stop in range(begin, len(data)):
        refusal(data[:stop])


def test_every_bit_flip_in_the_rows_of_a_file_with_a_digest_is_refused() -> None:
    data = with_digest(ROWS)
    for at in range(data.index(b"t_s,iq_a"), len(data)):
        for bit in range(8):
            flipped = bytearray(data)
            flipped[at] ^= 1 << bit
            refusal(bytes(flipped))


def test_decimal_commas_blanks_and_units_row() -> None:
    dialect = CsvDialect(separator=";", decimal=",", units_row=True, skip_after_header=1)
    found = read_csv(b"t ; I\n[ms];[mA]\n 0,5 ;1,25 \n1;  -2\n", dialect)
    np.testing.assert_array_equal(found.table.fields["t"], [0.5, 1.0])
    np.testing.assert_array_equal(found.table.fields["I"], [1.25, -2.0])
    assert found.table.units == (("t", "[ms]"), ("I", "[mA]"))


def test_a_number_with_a_blank_inside_is_no_number() -> None:
    assert refusal(b"t_s,ia_a\n0,1 000\n").code == "bad_number"


def test_a_units_row_that_nobody_declared_is_named() -> None:
    fault = refusal(b"t_s,ia_a\ns,A\n0,1\n")
    assert (fault.code, fault.rows) == ("bad_number", (0, 0))
    assert "units row" in fault.remedy


@pytest.mark.parametrize(
    ("rows", "layout"),
    [
        (b"t_s;iq_a\n0,0;1,5\n0,1;2\n", "{separator: ';', decimal: ','}"),
        (b"t_s;iq_a\n0.0;1.5\n0.1;2\n", "{separator: ';'}"),
    ],
)
def test_the_remedy_for_a_separator_has_the_decimal_comma_where_there_is_one(
    rows: bytes, layout: str
) -> None:
    assert f"layout: {layout};" in refusal(HEAD + rows).remedy
