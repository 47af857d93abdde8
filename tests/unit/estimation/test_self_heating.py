"""A winding that its own current warms while nobody logs its temperature."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.crosscheck.registry import check_all
from pipeline.estimation.electrical.direct_current import warming
from pipeline.estimation.estimators import resistance
from pipeline.numerics.plateaus import find_plateaus
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates

R_LL, ALPHA, PERIOD_S = 1.0, 1.0 / 259.5, 0.01


def pairs_in_turn(k_per_j: float, tau_s: float = 60.0, r_c: float = 0.5) -> list[Capture]:
    """Pairs ab, bc and ca one after the other of a winding that warms and cools all the while."""
    rng = np.random.default_rng(1)
    current = np.repeat((0.0, 1.0, 2.0, -1.0, -2.0), 300)
    excess, captures = 0.0, []
    for pair in ("ab", "bc", "ca"):
        r_25 = R_LL + (r_c - 0.5) * (pair != "ab")
        volts = np.empty(current.size)
        for k, amps in enumerate(current):
            volts[k] = r_25 * (1.0 + ALPHA * excess) * amps
            excess += PERIOD_S * (k_per_j * volts[k] * amps - excess / tau_s)
        columns = {
            "t_s": np.arange(current.size) * PERIOD_S,
            f"v{pair}_v": volts + 1e-3 * rng.standard_normal(current.size),
            f"i{pair[0]}_a": current + 1e-3 * rng.standard_normal(current.size),
        }
        captures.append(capture("resistance", f"r_{pair}", pair=pair, **columns))
    return captures


@pytest.mark.parametrize("k_per_j", [0.1, 0.3, 1.0])
def test_a_winding_that_warms_from_pair_to_pair_is_no_imbalance(k_per_j: float) -> None:
    """The phases were apart by 50 times the scatter that was published, and the check failed."""
    captures = pairs_in_turn(k_per_j)
    found = estimates(resistance.ESTIMATOR, *captures)
    imbalance = found["resistance_imbalance"]
    assert imbalance.number > 0.005
    assert imbalance.number < 3.0 * imbalance.u
    assert "log temp_winding_degc" in imbalance.note
    checks = check_all(Constants(tuple(found.values())), Campaign("m", tuple(captures)), {})
    (balance,) = (one for one in checks if one.name == "resistance_balance")
    assert balance.status != "fail"


def test_a_winding_that_stays_as_warm_as_it_is() -> None:
    """Without its temperature an imbalance is found as well as with it."""
    found = estimates(resistance.ESTIMATOR, *pairs_in_turn(0.0, r_c=0.55))["resistance_imbalance"]
    assert found.number == pytest.approx(0.05 / (1.55 / 3.0), abs=3.0 * found.u)
    assert found.u < 0.004
    assert "temp_winding_degc" not in found.note


@pytest.mark.parametrize("tau_s", [4.0, 60.0])
def test_the_rise_of_resistance_within_a_capture(tau_s: float) -> None:
    k_per_j = 1.0
    first = pairs_in_turn(k_per_j, tau_s)[0].arrays("t_s", "vab_v", "ia_a")
    columns = {"t_s": first["t_s"], "v_v": first["vab_v"], "i_a": first["ia_a"]}
    excess, most = 0.0, 0.0
    for amps in columns["i_a"]:
        power = R_LL * (1.0 + ALPHA * excess) * amps**2
        excess += PERIOD_S * (k_per_j * power - excess / tau_s)
        most = max(most, excess)
    rise = warming(columns, find_plateaus(columns["i_a"]))
    assert rise == pytest.approx(ALPHA * most, rel=0.2)
