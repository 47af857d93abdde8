"""Coasts of one shaft with and without something coupled to it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.estimators import spin_down
from pipeline.estimation.mechanical.setups import setups_of
from pipeline.records.capture import Capture
from tests.unit.estimation.signals import capture, estimates


def _coast(name: str, coulomb: float, viscous: float, top: float, *, angle: bool) -> Capture:
    """Closed form of -dw/dt = coulomb + viscous w, to rest."""
    rest = np.log1p(viscous * top / coulomb) / viscous
    t = np.arange(0.0, rest, 2e-3)
    fall = np.exp(-viscous * t)
    speed = (top + coulomb / viscous) * fall - coulomb / viscous
    if not angle:
        return capture("spin_down", name, t_s=t, omega_mech_rad_s=np.round(speed, 1))
    theta = (top + coulomb / viscous) * (1.0 - fall) / viscous - coulomb / viscous * t
    return capture("spin_down", name, t_s=t, theta_mech_rad=np.round(theta, 3))


@pytest.mark.parametrize("angle", [True, False])
def test_a_chain_on_and_off_are_two_set_ups_and_none_is_averaged(angle: bool) -> None:
    free = [_coast(f"off_{k}", 20.0, 0.1, 300.0 + 40.0 * k, angle=angle) for k in range(2)]
    chain = [_coast(f"on_{k}", 35.0, 0.15, 320.0 + 10.0 * k, angle=angle) for k in range(2)]
    setups = setups_of([free[0], chain[0], free[1], chain[1]])
    assert [{c.path for c in s.captures} for s in setups] == [
        {c.path for c in free},
        {c.path for c in chain},
    ]
    found = estimates(spin_down.ESTIMATOR, free[0], chain[0], free[1], chain[1])
    for name, values in (("coast_coulomb_rad_s2", "20 35"), ("coast_viscous_1_s", "0.1 0.15")):
        assert found[name].value is None
        assert f"{free[0].path}, {free[1].path} | {chain[0].path}" in found[name].note
        told = [float(w.split(" ± ")[0]) for w in found[name].note.split(f"{name} ")[1:]]
        assert told == pytest.approx([float(v) for v in values.split()], rel=1e-2)


def test_a_bearing_that_warms_is_no_other_set_up() -> None:
    cold = _coast("cold", 20.0, 0.1, 300.0, angle=True)
    warm = _coast("warm", 18.5, 0.093, 310.0, angle=True)
    assert len(setups_of([cold, warm])) == 1
    found = estimates(spin_down.ESTIMATOR, cold, warm)
    assert 18.0 < found["coast_coulomb_rad_s2"].number < 20.5


def test_coasts_without_a_speed_in_common_are_not_parted() -> None:
    fast = _coast("fast", 20.0, 0.1, 300.0, angle=True)
    table = fast.tables[0]
    cut = table.filter(table["t_s"] < 0.3 * table["t_s"].max())
    slow = _coast("slow", 35.0, 0.15, 60.0, angle=True)
    from dataclasses import replace

    assert len(setups_of([replace(fast, tables=(cut,)), slow])) == 1
