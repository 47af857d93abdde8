"""When two files hold one recording, and which of them counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.contracts import duplicates
from pipeline.contracts.duplicates import _fingerprint, _holds, _same_rows, once
from tests.unit.contracts.test_gate_limits import capture


def rows_of(values, path="a.csv", **meta):
    made = capture("drive", path=path, iq_a=np.asarray(values), meta=meta)
    return replace(made, integrity="unverified")


def test_a_run_that_holds_another() -> None:
    long = np.arange(100.0)
    assert _holds(long, long[40:60])
    assert _holds(long[40:60], long)
    assert _holds(long, long[40:60] + 0.9e-6 * 99.0)
    assert not _holds(long, long[40:60] + 1.1e-6 * 99.0)
    # all but a tenth of the shorter one may run over the end
    assert _holds(long, np.arange(91.0, 101.0))
    assert not _holds(long, np.arange(92.0, 102.0))
    wrong = long[40:60].copy()
    wrong[7] += 1.0
    assert not _holds(long, wrong)
    # the first value stands in other places before, and too near to the end after that
    repeated = np.concatenate([[40.0, 0.0], long])
    assert _holds(repeated, long[40:60])
    often = np.concatenate([np.tile([40.0, 1.0], duplicates.POLICY.begins), long])
    assert not _holds(often, long[40:60])
    assert _holds(often[2:], long[40:60])


def test_rows_are_known_by_columns_of_six_values() -> None:
    few, enough = np.arange(60.0) % 5, np.arange(60.0) % 6
    made = capture("drive", iq_a=few, id_a=enough, vq_v=np.ones(60))
    assert set(_fingerprint(made)) == {"id_a"}
    holed = np.where(np.arange(60) == 3, np.nan, np.arange(60.0))
    assert _fingerprint(capture("drive", iq_a=holed))["iq_a"].size == 59
    one, two = {"a": np.arange(9.0)}, {"a": np.arange(9.0), "b": np.arange(9.0)}
    assert _same_rows(two, one)
    assert _same_rows(one, two)
    assert not _same_rows({"a": one["a"], "c": one["a"]}, two)
    assert not _same_rows({}, two)
    assert not _same_rows({"a": one["a"], "b": 2.0 * one["a"]}, two)


def test_of_two_recordings_the_longer_then_the_verified_then_the_first_counts() -> None:
    values = np.arange(50.0)
    kept, found = once([rows_of(values[:40], "a.csv"), rows_of(values, "b.csv")])
    assert [c.path for c in kept] == ["b.csv"]
    assert "all its rows stand in b.csv" in found[0].message
    sealed = replace(rows_of(values, "c.csv"), integrity="verified")
    kept, found = once([rows_of(values, "b.csv"), sealed])
    assert [c.path for c in kept] == ["c.csv"]
    assert "it holds the rows of c.csv" in found[0].message
    kept, found = once([rows_of(values, "b.csv", lot="L1"), rows_of(values, "a.csv")])
    assert [c.path for c in kept] == ["a.csv"]
    assert "whose lot differ" in found[0].message
    kept, found = once([rows_of(values, "b.csv"), rows_of(values[::-1], "a.csv")])
    assert [c.path for c in kept] == ["a.csv", "b.csv"]
    assert found == ()
