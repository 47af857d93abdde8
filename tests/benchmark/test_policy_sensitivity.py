"""The table of halved and doubled numbers: what is run, what is counted, what is left open."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.criticism.policy.policy import DEFAULT, policy_of
from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.errors import UsageError
from pipeline.records.policy import entries, policy_digest
from tests.benchmark.cases import Case
from tests.benchmark.drawing import cases
from tests.benchmark.policy_reads import READS, listened, listening
from tests.benchmark.policy_sensitivity import (
    Variant,
    book_of,
    chosen_entries,
    page,
    scaled,
    spread,
)
from tests.benchmark.running import Book


@pytest.fixture(scope="module")
def nulls(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    drawn = cases(3, tmp_path_factory.mktemp("sensitivity"))
    return [case for case in drawn if case.family == "null"][:2]


def keep(book: Book, case: Case, *missing: str, read: tuple[str, ...] = ()) -> None:
    document = {"verdict": "missing" if missing else "adequate", "missing": missing, "ranking": []}
    write_whole(book.result(case), canonical_json({**document, READS: read}))


def test_numbers_are_scaled_and_whole_ones_stay_whole():
    assert scaled(12.0, 0.5) == 6.0
    assert (scaled(3, 0.5), scaled(3, 2.0), scaled(1, 0.5)) == (2, 6, 1)
    assert scaled((1.0, 0.5), 2.0) == (2.0, 1.0)


def test_only_chosen_numbers_are_moved_and_the_wanted_ones_come_first():
    found = chosen_entries(["selection.tie"])
    assert found[0].name == "selection.tie"
    assert {entry.origin.kind for entry in found} == {"chosen"}
    assert len(found) == sum(entry.origin.kind == "chosen" for entry in entries(DEFAULT))
    for name in ("selection.tei", "fit.settled"):  # one that is none, one that is derived
        with pytest.raises(UsageError):
            chosen_entries([name])


def test_cases_are_spread_over_the_list(nulls: list[Case]) -> None:
    many = [replace(nulls[0], number=n) for n in range(10)]
    assert [case.number for case in spread(many, 5)] == [0, 2, 4, 6, 8]
    assert len(spread(many, 50)) == 10


def test_a_number_has_a_row_once_both_its_variants_were_run(
    nulls: list[Case], tmp_path: Path
) -> None:
    """Two captures of sound motors: one is named wrongly once the tie is halved."""
    book, tie = Book(tmp_path, "code"), chosen_entries(["selection.tie"])[0]
    half, twice = (book_of(book, Variant(tie, factor)) for factor in (0.5, 2.0))
    assert half.code != book.code
    for case in nulls:
        keep(book_of(book, Variant()), case, read=("selection.tie",))
        keep(half, case, *["windage"][: case is nulls[0]])
    keep(twice, nulls[0])
    assert "`selection.tie`" not in page(nulls, book, ["selection.tie"], 3)
    keep(twice, nulls[1])
    text = page(nulls, book, ["selection.tie"], 3)
    (row,) = (row for row in text.splitlines() if row.startswith("| `selection.tie`"))
    assert row == "| `selection.tie` | 12.0 | 2 | 1 | 1 | 0 | 1 | 2 | 0 | 0 | 0 |"
    assert "halved or doubled: `selection.tie`." in text
    of_all = len(chosen_entries([]))
    assert f"{of_all} of {of_all} numbers" in text  # no other one is read by these


def test_a_number_that_no_case_reads_moves_nothing(nulls: list[Case], tmp_path: Path) -> None:
    """Without a run of it: the results stay."""
    book = Book(tmp_path, "code")
    for case in nulls:
        keep(book_of(book, Variant()), case, read=("selection.least_share",))
    (row,) = (r for r in page(nulls, book, [], 3).splitlines() if r.startswith("| `selection.tie`"))
    assert row == "| `selection.tie` | 12.0 | 0 | 2 | 0 | 0 | 0 | 2 | 0 | 0 | 0 |"


def test_what_is_read_is_noted_and_a_digest_is_no_reading():
    seen: set[str] = set()
    policy = listening(DEFAULT, seen)
    assert policy_digest(policy) == policy_digest(DEFAULT)
    assert seen == set()
    assert policy.priors.gain == DEFAULT.priors.gain
    assert policy.selection.tie == DEFAULT.selection.tie
    assert seen == {"priors.gain", "selection.tie"}
    with listened() as named:
        assert policy_of(()).fit.halvings == DEFAULT.fit.halvings
    assert named == {"fit.halvings"}
    assert policy_of(()) is DEFAULT
