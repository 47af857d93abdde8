"""The torque constant of a loaded drive that has a transducer, and no torque map beside."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.estimators.drive_torque import ESTIMATOR, EXPERIMENT
from pipeline.estimation.registry import fit_all
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Campaign, Capture
from tests.unit.estimation.signals import capture, estimates

KT_NM_A, J_KGM2, COULOMB_NM, VISCOUS = 0.12, 6e-4, 0.03, 2e-4
TRUE = {
    "kt_peak_nm_a": KT_NM_A,
    "j_rotor_kgm2": J_KGM2,
    "torque_coulomb_nm": COULOMB_NM,
    "b_visc_nm_s_rad": VISCOUS,
}


def log(
    seed: int,
    load_nm: float = 0.4,
    noise_nm: float = 2e-3,
    computed: bool = False,
    amps: float = 0.0,
    force: float = 0.0,
    **meta: float,
) -> Capture:
    """Speed of both senses under a load of steps; `computed`: torque is Kt times the current;
    `amps` and `force` are gains of the sensors, less one.
    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 16.0, 1e-3)
    rates, phases = rng.uniform(1.0, 12.0, 5), rng.uniform(0.0, 2 * np.pi, 5)
    omega = 25.0 * np.sin(np.outer(t_s, rates) + phases).sum(axis=1)
    theta = trapezoid(t_s, omega)
    gain = np.gradient(omega, t_s)
    load = load_nm * np.repeat(rng.uniform(-1.0, 1.0, 40), 400)
    drag = COULOMB_NM * np.sign(omega) + VISCOUS * omega
    current = (J_KGM2 * gain + drag + load) / KT_NM_A
    noisy = current + 5e-3 * rng.normal(size=t_s.size)
    torque = KT_NM_A * noisy if computed else load + noise_nm * rng.normal(size=t_s.size)
    step = 2 * np.pi / 16384
    return capture(
        "drive",
        f"d{seed}",
        t_s=t_s,
        iq_a=noisy * (1.0 + amps),
        id_a=0.0 * t_s,
        theta_mech_rad=np.round(theta / step) * step,
        torque_shaft_nm=torque * (1.0 + force),
        temp_magnet_degc=np.full(t_s.size, 25.0),
        **meta,
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_kt_inertia_and_friction_follow_from_one_loaded_drive(seed: int) -> None:
    """Each within its interval, and the intervals of use; the torque constant is the drive's."""
    known = fit_all(Campaign("m", (log(seed),)), {})[0]
    for name, true in TRUE.items():
        one = known.best(name)
        assert one is not None, name
        assert abs(one.number - true) < 2.0 * one.u, name
        assert one.u < 0.05 * true, name
    kt = known.best("kt_peak_nm_a")
    assert kt is not None
    assert kt.method == "drive_torque"


def test_gains_are_in_the_budget_with_their_signs() -> None:
    """A transducer that shows more makes Kt larger, a current sensor that does makes it smaller."""
    parts = {p.source: p.u for p in estimates(ESTIMATOR, log(4))["kt_peak_nm_a"].budget}
    by = {source.split("@")[0]: u / KT_NM_A for source, u in parts.items() if "@" in source}
    assert by["torque"] > 0.0
    assert by["current"] < 0.0


def test_noise_that_makes_the_constant_too_small_is_in_its_uncertainty() -> None:
    """A load that is small beside the noise of its columns: the bias of least squares is told."""
    one = estimates(ESTIMATOR, log(5, load_nm=0.03))["kt_peak_nm_a"]
    doubt = {part.source: part.u for part in one.budget}["assumed:noise_of_columns"]
    assert 1e-5 * KT_NM_A < doubt < 0.05 * KT_NM_A
    assert abs(one.number - KT_NM_A) < 2.0 * one.u


@pytest.mark.parametrize(
    ("drive", "why"),
    [
        (log(6, load_nm=0.0), "the load hardly changes"),
        (log(7, computed=True), "as one that a drive computes from its current"),
    ],
)
def test_what_tells_no_torque_constant_gives_none(drive: Capture, why: str) -> None:
    """Nothing coupled to the transducer; and a torque that is the current in other units."""
    one = estimates(ESTIMATOR, drive)["kt_peak_nm_a"]
    assert not one.known
    assert why in one.note
    assert EXPERIMENT in one.note


def test_a_torque_table_is_preferred() -> None:
    """At settled points nothing has to be known of the motion."""
    table = capture("torque_table", "t", iq_a=np.arange(-5.0, 6.0), torque_shaft_nm=np.arange(11.0))
    assert not estimates(ESTIMATOR, log(8), table)["kt_peak_nm_a"].known
