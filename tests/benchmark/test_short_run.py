"""A short run of the blind benchmark: the product on a few sealed cases, marks and speed."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.benchmark.blind import product
from tests.benchmark.cases import Case
from tests.benchmark.drawing import cases
from tests.benchmark.running import Book, code_digest, run
from tests.benchmark.scoring import judged
from tests.benchmark.sealing import blind_campaign
from tests.benchmark.table import table

LINES = {("null", "clean"), ("size", "1 typical"), ("gap", "test missing"), ("outside", None)}


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    """One case a line, of least digest."""
    drawn = list(cases(11, tmp_path_factory.mktemp("sensitivity")))
    return [
        min(
            (c for c in drawn if c.family == family and line in (None, c.line)),
            key=lambda c: c.key,
        )
        for family, line in sorted(LINES, key=str)
    ]


@pytest.mark.slow
def test_a_short_run_names_nothing_wrongly(chosen: list[Case], tmp_path: Path) -> None:
    book = Book(tmp_path, code_digest())
    assert run(chosen, book, product) == len(chosen)
    pairs = [(case, book.document(case) or {}) for case in chosen]
    marks = {case.line: judged(case, document).mark for case, document in pairs}
    assert "failed" not in marks.values(), pairs
    assert "wrong" not in marks.values(), table(pairs, "short run")
    for _, document in pairs:
        assert document["schema"] == "model-diagnosis/1"


def test_a_campaign_is_recorded_in_a_second_and_a_half(chosen: list[Case]) -> None:
    """CPU time of recording one campaign, once the simulator is compiled [s]."""
    blind_campaign(chosen[0])
    for case in chosen:
        start = time.process_time()
        blind_campaign(case)
        assert time.process_time() - start < 1.5
