"""Blocks of seeds that are done are kept, and only those that a change leaves true are used."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.recovery import kept
from tests.recovery.harness import draw
from tests.recovery.table import cases

CASES = {case.name: case for case in cases()}


@pytest.fixture
def forgetful(monkeypatch):
    """Source digests are computed anew in this test and thrown away after it."""
    monkeypatch.setattr(kept, "_source_digest", kept._source_digest.__wrapped__)


def test_a_block_that_is_done_is_not_drawn_again(tmp_path):
    """The second run simulates nothing and gives the same draws to the last bit."""
    seeds = []

    def counting(seed):
        seeds.append(seed)
        return CASES["lcr"].simulate(seed)

    case = replace(CASES["lcr"], simulate=counting)
    expected = kept.digest(case, range(3))
    first = kept.draws_of(case, range(3), tmp_path, expected)
    again = kept.draws_of(case, range(3), tmp_path, expected)
    assert seeds == [0, 1, 2]
    assert first == again == draw(CASES["lcr"], range(3))


def test_a_block_cut_short_leaves_nothing_behind(tmp_path):
    """A run that stops inside a block draws that block anew."""

    def stopping(seed):
        if seed == 2:
            raise KeyboardInterrupt
        return CASES["lcr"].simulate(seed)

    case = replace(CASES["lcr"], simulate=stopping)
    with pytest.raises(KeyboardInterrupt):
        kept.draws_of(case, range(3), tmp_path, kept.digest(case, range(3)))
    assert list(tmp_path.iterdir()) == []


def test_sources_that_change_during_a_run_end_it(tmp_path):
    """Nothing is kept under a digest that is not that of the code in memory."""
    with pytest.raises(RuntimeError, match="sources changed"):
        kept.draws_of(CASES["lcr"], range(3), tmp_path, "0" * 64)
    assert list(tmp_path.iterdir()) == []


def test_other_seeds_are_another_block():
    """Seeds 0 to 99 are not seeds 100 to 199."""
    assert kept.digest(CASES["lcr"], range(100)) != kept.digest(CASES["lcr"], range(100, 200))


@pytest.mark.parametrize(
    ("changed", "drawn_anew"),
    [
        (
            "pipeline.estimation.estimators.resistance",
            {"resistance", "soak", "heat_run", "thermal"},
        ),
        ("pipeline.estimation.estimators.spin_down", {"spin_down"}),
        ("pipeline.estimation.electrical.step_model", {"current_step"}),
        ("pipeline.simulator.sensors", set(CASES)),
        ("pipeline.records.estimate", set(CASES)),
        ("tests.recovery.harness", set(CASES)),
        ("pipeline.report.charts.chart", set()),
    ],
)
def test_a_change_reaches_the_cases_that_run_through_it(
    changed, drawn_anew, forgetful, monkeypatch
):
    """Those and no others; heat run and thermal take R25 from the resistance estimator."""
    before = {name: kept.digest(case, range(5)) for name, case in CASES.items()}
    true = kept._source
    monkeypatch.setattr(kept, "_source", lambda name: true(name) + "#" * (name == changed))
    after = {name: kept.digest(case, range(5)) for name, case in CASES.items()}
    assert {name for name in CASES if before[name] != after[name]} == drawn_anew
