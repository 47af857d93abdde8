"""Stated pole pairs against what the voltages at speed say of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.crosscheck.registry import check_all
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.simulator.truth import truth
from tests.simulated import design
from tests.unit.estimation.mechanical import recorded

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
RIGHT = MOTOR.pole_pairs
ON_POLE_PAIRS = ("psi_pm_wb", "ld_rated_h", "lq_rated_h")


def judged(campaign: Campaign, *stated: int) -> tuple[Constants, Check]:
    """Constants and the check of pole pairs, of captures that state these in turn."""
    captures = [
        replace(c, meta=replace(c.meta, pole_pairs=stated[k % len(stated)]))
        for k, c in enumerate(campaign.captures)
    ]
    campaign = replace(campaign, captures=tuple(captures))
    constants = fit_all(campaign, {})[0]
    checks = check_all(constants, campaign, {})
    return constants, next(one for one in checks if one.name == "pole_pairs_nameplate")


@pytest.mark.parametrize(
    ("tests", "stated"),
    [
        pytest.param(("current_step", "torque_map"), RIGHT + 3, marks=pytest.mark.slow),
        (("lcr", "drive"), 2 * RIGHT),
    ],
)
def test_stated_pole_pairs_that_voltages_contradict(tests: tuple[str, ...], stated: int) -> None:
    """The flux was Ke over any stated number, with the uncertainty of Ke, and no check spoke."""
    constants, check = judged(recorded(tests=tests), stated)
    for name in ON_POLE_PAIRS:
        assert constants.best(name) is None, name
    (reason,) = (e.note for e in constants.all_of("psi_pm_wb") if e.method == "back_emf_names")
    assert f"state {stated} pole pairs" in reason
    assert "correct `pole_pairs`" in reason
    assert check.status == "fail"
    assert f"stated {stated}, where {RIGHT} is nearest" in (check.suspect or "")
    assert constants.best("ke_phase_peak_v_s_rad") is not None


def test_right_pole_pairs_of_iron_that_bends() -> None:
    """Inductances that differ by 20 % at speed and at standstill contradict nothing."""
    campaign = recorded(tests=("lcr", "torque_map"))
    bent = [
        replace(
            c,
            tables=tuple(
                t.with_columns(t[n] * factor for n in ("lab_h", "lbc_h", "lca_h") if n in t.columns)
                for t in c.tables
            ),
        )
        for factor in (0.8, 1.25)
        for c in campaign.of("lcr")
    ]
    for lcr in bent:
        captures = (lcr, *campaign.of("torque_map"))
        constants, check = judged(replace(campaign, captures=captures), RIGHT)
        for name in ON_POLE_PAIRS:
            assert constants.best(name) is not None, name
        assert check.status == "not_evaluated"


def test_voltages_say_the_pole_pairs_of_a_sound_motor() -> None:
    """Within what iron may part inductances by, and the flux says on what it rests."""
    constants, check = judged(recorded(tests=("current_step", "torque_map")), RIGHT)
    seen, flux = constants.best("pole_pairs_by_voltage"), constants.best("psi_pm_wb")
    assert seen is not None
    assert abs(seen.number - RIGHT) < 0.03 * RIGHT
    assert 0.05 * RIGHT < seen.u < 0.13 * RIGHT
    assert flux is not None
    assert f"rests on the {RIGHT} pole pairs that the captures state" in flux.note
    assert check.status == "not_evaluated"


def test_pole_pairs_that_nothing_counts() -> None:
    """The flux says that it rests on the nameplate alone."""
    flux = judged(recorded(tests=("drive",)), RIGHT + 3)[0].best("psi_pm_wb")
    assert flux is not None
    assert "nothing recorded counts them" in flux.note


@pytest.mark.slow
def test_one_wrong_nameplate_of_many_is_named() -> None:
    campaign = recorded(tests=("current_step", "torque_map"))
    stated = [2 * RIGHT] + [RIGHT] * (len(campaign.captures) - 1)
    check = judged(campaign, *stated)[1]
    assert check.status == "fail"
    assert campaign.captures[0].path in (check.suspect or "")
