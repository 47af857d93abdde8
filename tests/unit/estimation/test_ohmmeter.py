"""Resistance as an ohmmeter gives it: a table against temperature, or readings in time."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.validate import validate
from pipeline.estimation.estimators import resistance, soak
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from tests.unit.estimation.signals import capture, estimates

R25_OHM, ALPHA_1_K = 0.34, 0.003854
PAIRS = ("ab", "bc", "ca")


def table(seed: int, *pairs: str, noise_ohm: float = 5e-4) -> Capture:
    """Seven temperatures of an oven; the pairs differ by their noise alone."""
    rng = np.random.default_rng(seed)
    degc = np.array([-10.0, 5.0, 25.0, 45.0, 65.0, 85.0, 105.0])
    line_ohm = 2.0 * R25_OHM * (1.0 + ALPHA_1_K * (degc - 25.0))
    columns = {f"r{one}_ohm": line_ohm + noise_ohm * rng.normal(size=7) for one in pairs}
    return capture("resistance", "oven.csv", temp_winding_degc=degc, **columns)


def test_a_table_gives_resistance_of_every_pair_and_the_copper_coefficient() -> None:
    found = estimates(resistance.ESTIMATOR, table(1, *PAIRS))
    for name in ("r_ab_ohm", "r_bc_ohm", "r_ca_ohm", "r_ll_ohm"):
        assert abs(found[name].number - 2.0 * R25_OHM) < 2.0 * found[name].u, name
    assert found["r_phase_ohm"].u < 0.02 * R25_OHM
    assert found["resistance_imbalance"].known
    assert not found["voltage_offset_v"].known


def test_intervals_of_a_table_hold_over_seeds() -> None:
    """The scatter is all that is known of the noise; by chance, eight of 60 miss at the most."""
    missed = 0
    for seed in range(60):
        (alpha,) = estimates(soak.ESTIMATOR, table(seed, "ab")).values()
        low, high = alpha.interval()
        missed += not low < ALPHA_1_K < high
        assert alpha.u < 0.02 * ALPHA_1_K
    assert missed <= 8


def test_a_table_needs_no_clock_and_no_current_but_a_temperature() -> None:
    assert validate(table(2, "bc"), {})[1] == ()
    cold = capture("resistance", "oven.csv", rab_ohm=np.array([0.7, 0.7, 0.7]))
    with pytest.raises(CaptureError, match="needs temp_winding_degc"):
        validate(cold, {})


@pytest.mark.parametrize("warmth", [{"temp_winding_degc": np.full(12, 45.0)}, {}])
def test_readings_in_time_are_used_as_a_table_is(warmth: dict[str, np.ndarray]) -> None:
    """A meter with a data logger: the rows have a clock, and no current is recorded."""
    line_ohm = 2.0 * R25_OHM * (1.0 + ALPHA_1_K * 20.0)
    ohms = line_ohm * (1.0 + 3e-4 * np.random.default_rng(3).normal(size=12))
    logged = capture("resistance", "meter.csv", t_s=np.arange(12.0), rab_ohm=ohms, **warmth)
    assert validate(logged, {})[1] == ()
    r_phase = estimates(resistance.ESTIMATOR, logged)["r_phase_ohm"]
    assert abs(r_phase.number - R25_OHM) < 2.0 * r_phase.u
    if not warmth:  # taken at ambient, within 20 K
        assert r_phase.u > 0.05 * R25_OHM


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 30])
def test_rows_at_one_temperature_are_brought_to_25_by_copper(rows: int) -> None:
    """Readings that scatter at one temperature say nothing of the coefficient."""
    rng = np.random.default_rng(rows)
    line_ohm = 2.0 * R25_OHM * (1.0 + ALPHA_1_K * 20.0)
    columns = {f"r{one}_ohm": line_ohm * (1.0 + 3e-4 * rng.normal(size=rows)) for one in PAIRS}
    degc = 45.0 + 0.1 * rng.normal(size=rows)
    table = capture("resistance", "shop.csv", temp_winding_degc=degc, **columns)
    r_phase = estimates(resistance.ESTIMATOR, table)["r_phase_ohm"]
    assert abs(r_phase.number - R25_OHM) < 2.0 * r_phase.u < 0.1 * R25_OHM
