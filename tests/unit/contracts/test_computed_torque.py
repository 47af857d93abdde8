"""A drive's torque that is its current in other units is no load of its shaft."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.validate import validate
from pipeline.numerics.alike import same_but_for_noise
from pipeline.records.capture import Capture, CaptureMeta

KT_NM_A = 0.048


def log(friction_nm: float = 0.0, inertia: float = 0.0, noise_a: float = 0.02) -> Capture:
    """A free shaft's log; with friction or inertia its torque is a transducer's."""
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, 8.0, 2e-3)
    omega = 60.0 * np.sin(2.1 * t_s) + 25.0 * np.sin(7.3 * t_s)
    current = 3.0 * np.sin(1.3 * t_s) + 2.0 * np.sin(5.1 * t_s)
    torque = KT_NM_A * current - friction_nm * np.sign(omega) - inertia * np.gradient(omega, t_s)
    table = pl.DataFrame(
        {
            "t_s": t_s,
            "iq_a": current + noise_a * rng.normal(size=t_s.size),
            "torque_shaft_nm": np.round(torque, 5),
            "theta_mech_rad": np.cumsum(omega) * 2e-3 + 1e-4 * rng.normal(size=t_s.size),
        }
    )
    return Capture("log.csv", "0" * 64, "verified", CaptureMeta("m", "drive"), (table,))


@pytest.mark.parametrize("noise_a", [0.0, 0.005, 0.05])
def test_a_torque_that_the_drive_computes_is_set_aside_and_named(noise_a: float) -> None:
    """Whatever the noise of the current that is logged beside it."""
    capture, findings = validate(log(noise_a=noise_a), {})
    (one,) = [f for f in findings if f.code == "computed_torque"]
    assert float(one.message.split()[2]) == pytest.approx(KT_NM_A, rel=1e-3)
    assert not capture.has("torque_shaft_nm")
    assert capture.has("iq_a", "theta_mech_rad")


@pytest.mark.parametrize(("friction_nm", "inertia"), [(2e-3, 0.0), (0.0, 1e-5)])
def test_a_transducer_shows_friction_or_inertia(friction_nm: float, inertia: float) -> None:
    """A hundredth of the torque's range is enough; the column stays."""
    capture, findings = validate(log(friction_nm, inertia), {})
    assert capture.has("torque_shaft_nm")
    assert "computed_torque" not in {one.code for one in findings}


def test_too_few_rows_and_constants_say_nothing() -> None:
    few = np.sin(np.arange(40.0))
    assert same_but_for_noise(2.0 * few, few) is None
    assert same_but_for_noise(np.ones(1000), np.ones(1000)) is None
    assert same_but_for_noise(np.zeros(1000), np.arange(1000.0)) is None
