"""Large recordings decode in little more than it takes to unpack them."""

from __future__ import annotations

from typing import Any

import pytest

from tests.bench.decoding import PUBLIC, TARGETS, measure


@pytest.mark.slow
@pytest.mark.parametrize("kind", TARGETS)
def test_the_ratio_of_two_hundred_megabytes(kind: str, benchmark: Any) -> None:
    """Targets of the issue, measured in one run on one machine."""
    found = benchmark.pedantic(measure, (kind, 200.0), rounds=1)
    benchmark.extra_info["ratio"] = found.ratio
    assert found.ratio <= TARGETS[kind]


@pytest.mark.slow
@pytest.mark.parametrize("kind", PUBLIC)
def test_the_public_loop_takes_many_times_longer(kind: str, benchmark: Any) -> None:
    found = benchmark.pedantic(measure, (kind, 20.0), {"public": True}, rounds=1)
    benchmark.extra_info["times"] = found.public
    assert found.public is not None
    assert found.public >= PUBLIC[kind]
