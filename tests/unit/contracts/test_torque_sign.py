"""Every number of the gates of the signs of torque and power from both sides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.contracts.gates import (
    torque_sign,
)
from tests.unit.contracts.test_gate_limits import TURN, capture, said


def blocks(x, y, **more):
    """A hundred blocks of ten rows each."""
    wide = {n: np.repeat(v, 10) for n, v in {"iq_a": x, "torque_shaft_nm": y, **more}.items()}
    return capture("drive" if more else "torque_map", **wide)


@pytest.mark.parametrize(("correlation", "expected"), [(-0.49, ""), (-0.51, "refused"), (0.9, "")])
def test_a_torque_that_falls_with_its_current(correlation: float, expected: str) -> None:
    k = np.arange(100)
    x, other = np.cos(TURN * k / 100.0), np.sin(TURN * k / 100.0)
    y = correlation * x + math.sqrt(1.0 - correlation**2) * other
    assert said("torque_sign", blocks(5.0 * x, 0.3 * y)) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.19, ""), (0.21, "refused")])
def test_a_drive_falls_by_a_fifth_of_what_its_voltage_promises(share: float, expected: str) -> None:
    """1.5 * 2 V / 30 rad/s promise 0.1 N.m an ampere; slow rows promise nothing."""
    k = np.arange(100)
    x = np.cos(TURN * 7 * k / 100.0)
    speed = np.where(k % 3 == 0, 14.0, 30.0)
    volts = np.where(k % 3 == 0, 50.0, 2.0)
    drift = 0.4 * (k / 100.0) ** 2
    made = blocks(x, -share * 0.1 * x + drift, vq_v=volts, omega_mech_rad_s=speed)
    assert said("torque_sign", made) == expected


@pytest.mark.parametrize(("correlation", "expected"), [(-0.94, ""), (-0.96, "refused")])
def test_a_drive_without_a_voltage_falls_with_next_to_no_doubt(
    correlation: float, expected: str
) -> None:
    k = np.arange(100)
    x, other = np.cos(TURN * 7 * k / 100.0), np.cos(TURN * 11 * k / 100.0)
    y = correlation * x + math.sqrt(1.0 - correlation**2) * other
    made = blocks(x, y, theta_mech_rad=k / 10.0)
    assert said("torque_sign", made) == expected


def test_a_parabola_in_time_is_taken_off() -> None:
    t = np.linspace(-1.0, 1.0, 50)
    wave = np.sin(40.0 * t)
    both = np.column_stack([3.0 + 2.0 * t - 5.0 * t**2, wave])
    left = torque_sign._without_drift(both)
    assert left[:, 0] == pytest.approx(0.0, abs=1e-9)
    basis = np.vander(t, 3)
    assert basis.T @ left[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(left[:, 1]).max() > 0.5
    still = np.zeros(5)
    assert torque_sign._promised_nm_a(still, still) == np.inf
    assert torque_sign._promised_nm_a(np.full(5, -2.0), np.full(5, 30.0)) == pytest.approx(0.1)


@pytest.mark.parametrize("test", ["torque_map", "torque_table"])
@pytest.mark.parametrize(
    ("rows", "correlation", "expected"),
    [(3, -1.0, ""), (4, -1.0, "refused"), (50, -0.69, ""), (50, -0.72, "refused"),
     (20, -0.94, ""), (20, -0.96, "refused")],
)  # fmt: skip
def test_fewer_rows_than_blocks_fall_more_surely(
    test: str, rows: int, correlation: float, expected: str
) -> None:
    """A table of the wrong sign was no finding, and missed its floor by hundreds."""
    x, other = np.linalg.qr(np.vander(np.arange(rows) ** 1.1, 3)[:, ::-1])[0][:, 1:].T
    y = correlation * x + math.sqrt(1.0 - correlation**2) * other
    assert said("torque_sign", capture(test, iq_a=x, torque_shaft_nm=y)) == expected
