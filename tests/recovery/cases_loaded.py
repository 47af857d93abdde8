"""Loaded drives with a transducer: torque constant, and the balance of power of the supply's side.

The captures are those of the estimators' own tests, with gains drawn from what the station states.
No bound: noise of the speed and of the current is in the regressors.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.estimation.estimators import dc_power, drive_torque
from pipeline.records.capture import Campaign, Capture
from tests.recovery.harness import Case, Trial
from tests.unit.estimation import test_dc_power, test_drive_torque

U_GAIN = 2e-3
U_POWER = 5e-4
"""Standard uncertainties of gains; losses are a difference of two powers, so theirs are smaller."""


def _gains(seed: int, u: float, *names: str) -> dict[str, float]:
    """One gain a sensor, less one."""
    drawn = u * np.random.default_rng([seed, 1]).normal(size=len(names))
    return dict(zip(names, drawn.tolist(), strict=True))


def _campaign(capture: Capture) -> Campaign:
    return Campaign(capture.meta.motor_id, (capture,))


def _torque_trial(seed: int) -> Trial:
    gains = _gains(seed, U_GAIN, "amps", "force")
    capture = test_drive_torque.log(seed, u_rel_current=U_GAIN, u_rel_torque=U_GAIN, **gains)
    true = {"kt_peak_nm_a": test_drive_torque.KT_NM_A}
    seen = {name: v * (1.0 + gains["force"]) / (1.0 + gains["amps"]) for name, v in true.items()}
    return Trial(_campaign(capture), true, seen)


def _power_trial(seed: int) -> Trial:
    gains = _gains(seed, U_POWER, "volts", "amps", "force")
    true = test_dc_power.TRUE
    return Trial(_campaign(test_dc_power.bench(seed, U_POWER, **gains)), true, true)


def _unbounded() -> Mapping[str, float]:
    return {}


CASES = (
    Case("drive_torque", drive_torque.ESTIMATOR, _torque_trial, _unbounded),
    Case("dc_power", dc_power.ESTIMATOR, _power_trial, _unbounded),
)
