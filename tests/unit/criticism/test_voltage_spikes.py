"""Rows that show a controller's kick for an instant, and not how long it lasted."""

from __future__ import annotations

import numpy as np

import pipeline
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.noise_floors import reading_error
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from tests.unit.criticism.machines import BASE, machine
from tests.unit.estimation.signals import capture

R_OHM, L_H, PSI_WB, PAIRS = 0.1, 2e-4, 0.0125, 11
LOOP_S, ROW_S = 2e-4, 0.02


def telemetry(seed: int) -> pipeline.Recordings:
    """A drive of slow rows whose set points of i_d change at a row: the voltage of that row is the
    kick that turns the current within a millisecond.
    """
    rng = np.random.default_rng(seed)
    t = ROW_S * np.arange(3000)
    targets = np.repeat(rng.uniform(-5.0, 5.0, 60), 50)
    before = np.concatenate([targets[:1], targets[:-1]])
    i_d, kick = before, L_H / LOOP_S * (targets - before)
    speed = 6.0 * np.sin(2.0 * np.pi * 0.11 * t) + 3.0 * np.sin(2.0 * np.pi * 0.043 * t + 1.0)
    i_q = 3.0 * np.sin(2.0 * np.pi * 0.071 * t) + np.sign(speed)
    flux = PAIRS * speed
    v_d = R_OHM * i_d - flux * L_H * i_q + kick
    v_q = R_OHM * i_q + flux * (PSI_WB + L_H * i_d) + L_H * np.gradient(i_q, ROW_S)
    noise = rng.normal(0.0, 1.0, (4, t.size))
    log = capture(
        "drive",
        "log",
        pole_pairs=PAIRS,
        voltage_kind="commanded",
        t_s=t,
        id_a=i_d + 0.02 * noise[0],
        iq_a=i_q + 0.02 * noise[1],
        vd_v=v_d + 0.01 * noise[2],
        vq_v=v_q + 0.01 * noise[3],
        omega_mech_rad_s=speed,
    )
    return pipeline.Recordings({"m": Campaign("m", (log,))})


def test_a_kick_of_one_row_is_nothing_that_a_model_lacks() -> None:
    (found,) = pipeline.diagnose(telemetry(1)).motors.values()
    assert found.verdict == "insufficient"
    assert not found.remainder
    assert found.ladder[-1].held_out < 1.0


def test_the_q_axis_alone_allows_for_a_kick_of_its_whole_height() -> None:
    """Volts for a row, in the windows that have one; none is in a log without."""
    t, kick = ROW_S * np.arange(900), 3.0
    rng = np.random.default_rng(4)
    speed = 6.0 * np.sin(2.0 * np.pi * 0.11 * t)
    errors = []
    for height in (0.0, kick):
        kicks = np.where(np.arange(t.size) % 47 == 30, height, 0.0)
        volts = PAIRS * PSI_WB * speed + kicks + rng.normal(0.0, 0.01, t.size)
        current = 1.0 + 0.5 * np.sin(2.0 * np.pi * 0.071 * t) + rng.normal(0.0, 0.01, t.size)
        log = capture(
            "drive", "log", voltage_kind="commanded", t_s=t, iq_a=current, vq_v=volts,
            omega_mech_rad_s=speed,
        )  # fmt: skip
        found = segments(Campaign("m", (log,)), machine(PAIRS))
        (q_axis,) = [one for one in found if "vq_v" in one.channels]
        model = Model(machine(PAIRS), ())
        errors.append(reading_error(q_axis, model, BASE)[q_axis.channels.index("vq_v"), :, 0])
    assert q_axis.weak is not None
    window = q_axis.weak.functions[0, 0]
    assert errors[0].max() < 0.02 * kick * window.max()
    assert errors[1].max() > 0.9 * kick * window.max()
