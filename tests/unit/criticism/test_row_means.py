"""Telemetry: means of currents and voltages over a row, and a motion that is read at its end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.diagnosis import base_fit, diagnose
from pipeline.criticism.selection.other_readings import (
    _may_hold_means,
    by_best_readings,
    reading_notes,
)
from pipeline.criticism.selection.requested_model import BaseFit
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture

ROW_S, PARTS = 4e-3, 40
PAIRS, PSI_WB, LD_H, LQ_H, R_OHM = 4, 0.05, 2e-3, 4e-3, 0.2
J_KGM2, DRY_NM, VISCOUS = 2e-3, 0.1, 1e-3


def telemetry(seed: int, means: bool, late_s: float = 0.0, timing: str = "instant") -> Capture:
    """Eight seconds of a free shaft that sways in one sense, with d current, at 250 Hz."""
    rng, step_s = np.random.default_rng(seed), ROW_S / PARTS
    t = step_s * np.arange(round(8.0 / step_s))
    speed, theta, alpha = np.full(t.size, 90.0), 90.0 * t, np.zeros(t.size)
    for hz in rng.uniform(0.3, 9.0, 7):
        w, phase, rad_s = 2.0 * np.pi * hz, rng.uniform(0.0, 6.0), 45.0 / (1.0 + hz)
        speed += rad_s * np.sin(w * t + phase)
        theta -= rad_s / w * np.cos(w * t + phase)
        alpha += rad_s * w * np.cos(w * t + phase)
    i_d = -3.0 + 2.0 * np.sin(2.3 * t)
    torque = J_KGM2 * alpha + DRY_NM * np.sign(speed) + VISCOUS * speed
    i_q = torque / (1.5 * PAIRS * (PSI_WB + (LD_H - LQ_H) * i_d))
    omega = PAIRS * speed
    columns = {
        "id_a": i_d,
        "iq_a": i_q,
        "vd_v": R_OHM * i_d + LD_H * np.gradient(i_d, t) - omega * LQ_H * i_q,
        "vq_v": R_OHM * i_q + LQ_H * np.gradient(i_q, t) + omega * (LD_H * i_d + PSI_WB),
    }
    last = slice(PARTS - 1, None, PARTS)
    if means:
        columns = {n: c.reshape(-1, PARTS).mean(axis=1) for n, c in columns.items()}
    else:
        late = {n: np.interp(t - late_s, t, c) for n, c in columns.items() if n.startswith("i")}
        columns = {n: c[last] for n, c in (columns | late).items()}
    noisy = {n: c + 2e-3 * rng.standard_normal(c.size) for n, c in columns.items()}
    count = 2.0 * np.pi / 65536
    return capture(
        "drive",
        f"drive_{seed}",
        pole_pairs=PAIRS,
        pwm_hz=10000.0,
        vdc_v=96.0,
        voltage_kind="commanded",
        voltage_timing=timing,
        t_s=t[last],
        theta_mech_rad=count * np.round(theta[last] / count),
        temp_winding_degc=np.full(t[last].size, 25.0),
        temp_magnet_degc=np.full(t[last].size, 25.0),
        **noisy,
    )


def found(**how):
    logs = tuple(telemetry(seed, **how) for seed in (1, 2))
    return diagnose(Campaign("m", logs), ModelSpec(), Constants())


def test_means_up_to_the_end_of_a_row_are_no_late_current() -> None:
    """A sound motor was named `current_delay` of half a row."""
    diagnosis = found(means=True)
    assert diagnosis.missing == ()
    assert any("means over the row" in note for note in diagnosis.notes)


@pytest.mark.parametrize(("late_s", "missing"), [(0.0, ()), (0.8e-3, ("current_delay",))])
def test_samples_are_read_as_samples(late_s: float, missing: tuple[str, ...]) -> None:
    diagnosis = found(means=False, late_s=late_s)
    assert diagnosis.missing == missing
    assert not any("means over the row" in note for note in diagnosis.notes)


def test_every_hundredth_row_of_a_log_holds_no_voltage_until_the_next() -> None:
    """The metadata are of the whole log. A motor of bench B was read as means of a row instead,
    with a `current_delay` that undid it for the currents.
    """
    log = Campaign("m", (telemetry(1, means=False, timing="held"),))
    base = base_fit(log, ModelSpec(), Constants())
    assert isinstance(base, BaseFit)
    fit = by_best_readings(base.system).fit
    (drive,) = (s.instrument for s in fit.segments if "vd_v" in s.channels)
    assert (drive.single, drive.behind) == ("held", 0.0)
    assert "one PWM period each" in reading_notes(fit)[0]


@pytest.mark.parametrize(
    ("timing", "pwm_s", "may"),
    [
        ("instant", 1e-4, True),
        ("held", 1e-4, True),
        ("centred", 1e-4, False),
        ("instant", ROW_S, False),
    ],
)
def test_a_stated_mean_about_its_instant_is_not_read_as_one_before_it(timing, pwm_s, may) -> None:
    """Nor are rows as fast as the PWM."""
    segment = SimpleNamespace(
        fixed={"pwm_s": pwm_s},
        ts_s=ROW_S,
        instrument=SimpleNamespace(timing=timing),
        recorded={"iq_a": ()},
    )
    assert _may_hold_means(cast(Segment, segment), 0.5) is may
