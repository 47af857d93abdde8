"""Friction of coasts where the inertia is stated and nothing else gives it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.estimation.estimators.coast_friction import ESTIMATOR
from pipeline.estimation.estimators.spin_down import ESTIMATOR as SPIN_DOWN
from pipeline.records.constants import Constants
from tests.simulated import design
from tests.unit.estimation.mechanical import chain, recorded
from tests.unit.estimation.signals import known_value

MOTOR = design("gimbal-5208")
SHARE = 0.02
STATED = replace(
    known_value("j_rotor_kgm2", MOTOR.j_rotor_kgm2, SHARE * MOTOR.j_rotor_kgm2, "kg·m²"),
    status="stated",
)


@pytest.mark.parametrize("name", ["torque_coulomb_nm", "b_visc_nm_s_rad"])
def test_a_stated_inertia_gives_the_friction_of_coasts(name: str) -> None:
    known = chain(
        recorded("", tests=("spin_down",)),
        SPIN_DOWN,
        ESTIMATOR,
        known=Constants().adding((STATED,)),
    )
    found = known.best(name)
    assert found is not None
    assert (found.method, found.status) == ("coast_friction", "measured")
    assert found.number == pytest.approx(getattr(MOTOR, name), rel=2e-3)
    assert found.u >= SHARE * found.number
    assert "rests on the stated j_rotor_kgm2" in found.note


def test_an_inertia_that_captures_give_has_its_friction_by_its_own_law() -> None:
    measured = replace(STATED, status="measured")
    for known in (Constants(), Constants().adding((measured,))):
        coasts = chain(recorded("", tests=("spin_down",)), SPIN_DOWN, ESTIMATOR, known=known)
        assert coasts.best("torque_coulomb_nm") is None
        assert "state j_rotor_kgm2" in coasts.all_of("torque_coulomb_nm")[0].note
