"""A drive log of current and of the drive's own speed, which an observer shows late."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import cast

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.diagnosis import UNSTATED, _may_be_observer_noise, base_fit, diagnose
from pipeline.criticism.equations.motion import TORQUE
from pipeline.criticism.search import SearchResult
from pipeline.criticism.selection.requested_model import BaseFit
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

PERIOD_S, FINER = 5e-4, 8
PSI_WB, PAIRS = 0.016, 4
R_OHM, L_H, VOLTAGE_NOISE_V = 0.5, 1e-3, 0.02
J_KGM2, DRY_NM, VISCOUS = 9e-5, 0.012, 3e-5
OBSERVER_RAD_S, DAMPING = 2.0 * math.pi * 60.0, 0.7
LATE_S, BEND_S2 = 2.0 * DAMPING / OBSERVER_RAD_S, OBSERVER_RAD_S**-2
SPEED_NOISE_RAD_S, CURRENT_NOISE_A = 0.02, 0.01


def log(seed: int, windage: float, volts: bool = False, tracks: bool = False) -> Capture:
    """Three seconds of a shaft that levels of current turn either way; `windage` [N·m s²]. With the
    voltages of both axes where asked for. A loop that `tracks` the angle has no lag at a constant
    acceleration.
    """
    random, step = np.random.default_rng(seed), PERIOD_S / FINER
    levels = random.uniform(0.3, 2.2, 20) * np.tile((1.0, 1.0, -1.0, -1.0), 5)
    level = np.repeat(levels, round(0.15 / step))
    omega = seen = change = error = current = 0.0
    rows = []
    for number, wanted in enumerate(level):
        slope = (wanted - 0.01 * omega - current) / 2e-3
        if number % FINER == 0:
            electrical = PAIRS * omega
            induced = R_OHM * current + L_H * slope + electrical * PSI_WB
            rows.append((number * step, current, seen, -electrical * L_H * current, induced))
        current += step * slope
        drag = DRY_NM * math.tanh(omega / 0.05) + VISCOUS * omega + windage * omega * abs(omega)
        omega += step / J_KGM2 * (1.5 * PAIRS * PSI_WB * current - drag)
        error += step * (omega - seen)
        if tracks:
            change += step * OBSERVER_RAD_S**2 * error
            seen = change + 2.0 * DAMPING * OBSERVER_RAD_S * error
            continue
        change += step * (
            OBSERVER_RAD_S**2 * (omega - seen) - 2.0 * DAMPING * OBSERVER_RAD_S * change
        )
        seen += step * change
    t_s, i_q, speed, v_d, v_q = np.array(rows).T
    table = pl.DataFrame(
        {
            "t_s": t_s,
            "id_a": CURRENT_NOISE_A * random.standard_normal(t_s.size),
            "iq_a": i_q + CURRENT_NOISE_A * random.standard_normal(t_s.size),
            "omega_mech_rad_s": speed + SPEED_NOISE_RAD_S * random.standard_normal(t_s.size),
        }
    )
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS)
    if volts:
        noisy = {
            name: v + VOLTAGE_NOISE_V * random.standard_normal(v.size)
            for name, v in (("vd_v", v_d), ("vq_v", v_q))
        }
        table = table.with_columns(**{name: pl.Series(v) for name, v in noisy.items()})
        meta = replace(meta, voltage_kind="measured", voltage_timing="instant")
    return Capture(f"drive_{seed}.csv", f"{seed}", "verified", meta, (table,))


@cache
def campaign(windage: float = 0.0, stated: bool = True) -> Campaign:
    known = {"psi_pm_wb": PSI_WB, "u_psi_pm_wb": 1e-3 * PSI_WB} if stated else {}
    return Campaign("m", tuple(log(seed, windage) for seed in (1, 2)), known)


def test_the_observer_s_lag_is_known_to_the_second_order() -> None:
    base = base_fit(campaign(), ModelSpec(), Constants({}))
    assert isinstance(base, BaseFit)
    values = base.system.fit.values
    assert float(base.system.reduced_chi2(base.system.residual).max()) < 1.5
    assert values["late_speed_s"] == pytest.approx(LATE_S, rel=0.1)
    assert values["bend_speed_s2"] == pytest.approx(BEND_S2, rel=0.15)
    assert values["j_kgm2"] == pytest.approx(J_KGM2, rel=0.005)


@pytest.mark.slow
def test_nothing_is_missing_where_nothing_is() -> None:
    found = diagnose(campaign(), ModelSpec(), Constants({}))
    assert found.missing == ()
    assert found.verdict in ("adequate", "insufficient")


@pytest.mark.slow
def test_an_effect_of_the_speed_is_named_without_an_angle_or_a_voltage() -> None:
    found = diagnose(campaign(windage=5e-7), ModelSpec(), Constants({}))
    assert found.missing == ("windage",)
    assert found.ladder[0].held_out > 2.0 * found.ladder[-1].held_out
    assert found.ladder[-1].held_out < 1.3


@pytest.mark.slow
def test_a_drag_is_named_by_a_speed_beside_voltages() -> None:
    """The voltages say the flux, and the speed what the current does not turn."""
    found = diagnose(Campaign("m", (log(1, 5e-7, volts=True),)), ModelSpec(), Constants({}))
    assert found.missing == ("windage",)
    assert found.ladder[0].held_out > 2.0 * found.ladder[-1].held_out
    assert found.ladder[-1].held_out < 1.3


def test_a_speed_beside_voltages_shows_inertia_and_friction() -> None:
    base = base_fit(Campaign("m", (log(1, 0.0, volts=True),)), ModelSpec(), Constants({}))
    assert isinstance(base, BaseFit)
    assert float(base.system.reduced_chi2(base.system.residual).max()) < 1.5
    values = base.system.fit.values
    assert values["psi_wb"] == pytest.approx(PSI_WB, rel=0.003)
    assert values["j_kgm2"] == pytest.approx(J_KGM2, rel=0.01)
    assert values["coulomb_friction.torque_nm"] == pytest.approx(DRY_NM, rel=0.02)


def test_a_loop_that_tracks_the_angle_is_behind_by_what_accelerates() -> None:
    """Its speed is that of the angle that it tracks, and follows the acceleration with a lag."""
    base = base_fit(
        Campaign("m", (log(1, 0.0, volts=True, tracks=True),)), ModelSpec(), Constants({})
    )
    assert isinstance(base, BaseFit)
    assert float(base.system.reduced_chi2(base.system.residual).max()) < 1.5
    values = base.system.fit.values
    assert values["late_speed_s"] == pytest.approx(0.0, abs=0.05 * LATE_S)
    assert values["bend_speed_s2"] == pytest.approx(BEND_S2, rel=0.1)
    assert values["lag_speed_s"] == pytest.approx(LATE_S, rel=0.2)
    assert values["j_kgm2"] == pytest.approx(J_KGM2, rel=0.01)


def test_without_a_torque_constant_it_is_asked_for() -> None:
    found = diagnose(campaign(stated=False), ModelSpec(), Constants({}))
    assert found.verdict == "insufficient"
    assert UNSTATED in found.notes


@pytest.mark.parametrize(
    ("left_in", "signal", "may_be"),
    [
        ((), TORQUE, False),
        (("by_speed.csv",), TORQUE, True),
        (("by_speed.csv",), "vq_v", False),
        (("by_speed.csv", "x"), TORQUE, False),
    ],
)
def test_only_what_an_observer_alone_shows_may_be_its_noise(
    left_in: tuple[str, ...], signal: str, may_be: bool
) -> None:
    """A model that explains nothing is unknown even where no group is over its floor."""
    segments = [SimpleNamespace(capture="by_speed.csv", fixed={"bend_speed_s2": 1.0})]
    segments.append(SimpleNamespace(capture="x", fixed={}))
    step = SimpleNamespace(system=SimpleNamespace(segments=segments))
    left_over = [SimpleNamespace(capture=path, signal=signal) for path in left_in]
    ladder = SimpleNamespace(steps=[step])
    end = SimpleNamespace(
        freed=(), sketch=None, change=None, ladder=ladder, remainders=tuple(left_over)
    )
    assert _may_be_observer_noise(cast("SearchResult", end)) is may_be
