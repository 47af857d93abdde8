"""The gauge study against the worked example of AIAG's manual, and its interval by simulation.

Data: AIAG, Measurement Systems Analysis, 4th ed., III.B: ten parts, three appraisers, three trials.
The table of mean squares and the components are published with it (and by statistical software
that ships the same data): part 9.81799, appraiser 1.58363, interaction 0.01994, equipment 0.04598.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import f

from pipeline.lots.gauge import anova, components, study

A = (
    (0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36),
    (0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25),
    (0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31),
)
B = (
    (0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68),
    (0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62),
    (0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50),
)
C = (
    (0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49),
    (-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77),
    (-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16),
)
READINGS = np.array([A, B, C]).transpose(2, 0, 1)


def test_published_table() -> None:
    table = anova(READINGS)
    assert (table.motors, table.stations, table.repeats) == (10, 3, 3)
    assert table.dof == (9, 2, 18, 60)
    assert table.ms_part == pytest.approx(9.81799, abs=6e-6)
    assert table.ms_station == pytest.approx(1.58363, abs=6e-6)
    assert table.ms_interaction == pytest.approx(0.01994, abs=6e-6)
    assert table.ms_error == pytest.approx(0.04598, abs=6e-6)
    assert table.interaction_p == pytest.approx(0.974, abs=5e-4)


def test_published_components() -> None:
    """With the interaction pooled: repeatability 0.03997, operators 0.05146, part 1.08645."""
    found = components(anova(READINGS))
    assert found.interaction == 0.0
    assert found.repeatability == pytest.approx(0.03997, abs=6e-6)
    assert found.station == pytest.approx(0.05146, abs=6e-6)
    assert found.part == pytest.approx(1.08645, abs=6e-6)
    assert found.rr == pytest.approx(0.09143, abs=6e-6)
    assert 100.0 * found.percent == pytest.approx(27.86, abs=0.005)


def test_unpooled_formulas() -> None:
    """σ²_station = (MSO − MSI)/(P n), σ²_part = (MSP − MSI)/(O n), by hand from the table."""
    found = components(anova(READINGS), pool_from=1.0)
    assert found.repeatability == pytest.approx(0.0459822, abs=1e-6)
    assert found.station == pytest.approx((1.58363 - 0.01994) / 30.0, abs=1e-6)
    assert found.part == pytest.approx((9.81799 - 0.01994) / 9.0, abs=1e-5)


def test_verdict_and_interval() -> None:
    found = study(READINGS)
    assert found.verdict == "acceptable"
    assert found.percent_low < found.percent < found.percent_high
    assert study(READINGS) == found


@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_a_study_has_no_unit(unit: float) -> None:
    """Micro-ohms or kilo-ohms: shares, interval and verdict are the same."""
    here, there = study(READINGS), study(unit * READINGS)
    for name in ("percent", "percent_low", "percent_high"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-9)
    assert there.verdict == here.verdict
    assert there.rr == pytest.approx(unit * here.rr, rel=1e-9)


def test_interval_covers() -> None:
    """95 % intervals of the share cover the truth in 90 to 99.5 % of 150 simulated studies."""
    rng = np.random.default_rng(11)
    part, station, error = 1.0, 0.2, 0.15
    true = 100.0 * np.sqrt((station**2 + error**2) / (part**2 + station**2 + error**2))
    hits = 0
    for _ in range(150):
        readings = (
            part * rng.standard_normal((12, 1, 1))
            + station * rng.standard_normal((1, 4, 1))
            + error * rng.standard_normal((12, 4, 2))
        )
        found = study(readings)
        hits += found.percent_low <= true <= found.percent_high
    assert 0.90 <= hits / 150 <= 0.995


@pytest.mark.parametrize("shape", [(1, 3, 3), (10, 1, 3), (10, 3, 1)])
def test_too_few(shape: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="two"):
        anova(np.zeros(shape))


def test_an_interaction_by_hand() -> None:
    """Two motors, two stations, repeats ±1: cells 0, 4 | 0, 0, so each effect has contrast 2.

    MSP = MSO = MSI = 2 · 4 · 1 = 8 and MSE = 2: interaction (8 - 2)/2 = 3, stations and parts 0.
    """
    cells = np.array([[0.0, 4.0], [0.0, 0.0]])
    table = anova(cells[:, :, None] + np.array([-1.0, 1.0]))
    assert (table.ms_part, table.ms_station, table.ms_interaction) == (8.0, 8.0, 8.0)
    assert table.ms_error == 2.0
    assert table.interaction_p == pytest.approx(float(f.sf(4.0, 1, 4)))
    found = components(table)
    assert table.interaction_p < 0.25
    assert (found.repeatability, found.interaction) == (2.0, 3.0)
    assert (found.station, found.part) == (0.0, 0.0)
    assert (found.rr, found.percent) == (5.0, 1.0)
    pooled = components(table, pool_from=0.1)
    assert pooled.repeatability == pytest.approx((8.0 + 4 * 2.0) / 5.0)
    assert pooled.interaction == 0.0
    assert pooled.station == pytest.approx((8.0 - 3.2) / 4.0)


def test_exact_repeats() -> None:
    """Without scatter an interaction is certain, and none is none."""
    cells = np.array([[0.0, 4.0], [0.0, 0.0]])
    assert anova(np.repeat(cells[:, :, None], 2, axis=2)).interaction_p == 0.0
    additive = np.array([[0.0, 1.0], [2.0, 3.0]])
    exact = anova(np.repeat(additive[:, :, None], 2, axis=2))
    assert exact.interaction_p == 1.0
    assert components(exact).percent == pytest.approx(math.sqrt(0.5 / (0.5 + 2.0)))
    assert components(anova(np.zeros((2, 2, 2)))).percent == 0.0


@pytest.mark.parametrize(
    ("noise", "verdict"),
    [(0.2, "good"), (0.33, "acceptable"), (0.75, "acceptable"), (1.1, "not_acceptable")],
)
def test_verdicts_at_a_tenth_and_three_tenths(noise: float, verdict: str) -> None:
    """Ten motors 0, 1, ..., 9 (variance 55/6) on two equal stations, repeats ±noise.

    MSE = 2 noise² is the gauge; parts are 55/6 (their mean square less the gauge's).
    """
    motors = np.arange(10.0)[:, None, None]
    signs = np.array([[-1.0, 1.0], [-1.0, 1.0]])[None]
    found = study(motors + noise * signs)
    total = 55.0 / 6.0
    # repeats scatter, cells do not: the interaction and station mean squares are zero, so pooled
    pooled = 20 * 2 * noise**2 / 29
    share = math.sqrt(pooled / (pooled + total - pooled / 4))
    assert found.percent == pytest.approx(100.0 * share, rel=1e-6)
    assert found.verdict == verdict
    assert found.repeatability == pytest.approx(math.sqrt(pooled))
    assert found.reproducibility == 0.0


def test_the_interval_narrows_with_its_level() -> None:
    wide, narrow = study(READINGS, 0.95), study(READINGS, 0.5)
    assert wide.percent_low < narrow.percent_low < narrow.percent < narrow.percent_high
    assert narrow.percent_high < wide.percent_high
    assert wide.level == 0.95
