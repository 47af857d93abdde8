"""Plants of others: what an answer is worth, and that their captures keep the contract."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import polars as pl
import pytest

from pipeline import Recordings, diagnose
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.errors import UsageError
from tests.benchmark.command import main, options
from tests.benchmark.worlds.case import WorldCase, marked
from tests.benchmark.worlds.lanes import Lane, run
from tests.benchmark.worlds.programmes import PROGRAMMES, PWM_HZ, Campaigner, Hidden
from tests.benchmark.worlds.rivals import _chosen
from tests.benchmark.worlds.sindy import weak_sindy
from tests.benchmark.worlds.table import beside, by_programme, cases, table
from tests.benchmark.worlds.with_maker import _telemetry, campaign

NULL = WorldCase("motulator", "laboratory", 1)
COGGING = WorldCase("motulator", "laboratory", 1, {"cogging": 1.0})
PAIR = WorldCase("motulator", "laboratory", 1, {"cogging": 1.0, "windage": 0.5})
OUTSIDE = WorldCase("motulator", "laboratory", 1, {"belt": 1.0}, outside=True)


def answer(verdict: str, *names: str, confused: str = "", matters: bool = False) -> dict[str, Any]:
    ranking = [{"effect": n, "confused_with": [confused] if confused else []} for n in names]
    remainder = [{"matters": matters}]
    return {"verdict": verdict, "missing": names, "ranking": ranking, "remainder": remainder}


@pytest.mark.parametrize(
    ("case", "document", "mark"),
    [
        (NULL, answer("adequate"), "right"),
        (NULL, answer("insufficient"), "right"),
        (NULL, answer("missing", "cogging"), "wrong"),
        (NULL, answer("unknown"), "unsure"),
        (COGGING, answer("missing", "cogging"), "right"),
        (COGGING, answer("missing", "unbalance", confused="cogging"), "right"),
        (COGGING, answer("missing", "cogging", "windage"), "half"),
        (COGGING, answer("missing", "windage"), "wrong"),
        (COGGING, answer("unknown", "cogging"), "unsure"),
        (COGGING, answer("adequate"), "silent"),
        (COGGING, {"failure": "ValueError"}, "failed"),
        (PAIR, answer("missing", "cogging"), "half"),
        (PAIR, answer("missing", "windage", "cogging"), "right"),
        (OUTSIDE, answer("unknown", "cogging"), "abstained right"),
        (OUTSIDE, answer("adequate", matters=True), "abstained right"),
        (OUTSIDE, answer("missing", "cogging"), "wrong"),
        (OUTSIDE, answer("adequate"), "silent"),
    ],
)
def test_what_an_answer_is_worth(case: WorldCase, document: dict[str, Any], mark: str) -> None:
    assert marked(case, document) == mark


def test_the_table_counts_marks_by_line_and_lists_what_is_not_right() -> None:
    found = [(NULL, answer("adequate")), (COGGING, answer("missing", "windage"))]
    text = table(found)
    assert "| typical | 1 | 0 | 0 | 0 | 0 | 0 | 1 | 0 |" in text
    assert "| all | 2 | 1 | 0 | 0 | 0 | 0 | 1 | 0 |" in text
    assert "| laboratory | 1 | 1 cogging | wrong | missing | windage |" in text
    assert text.count("| laboratory |") == 1


def test_each_programme_has_its_row_of_what_its_answers_are_worth() -> None:
    other = WorldCase("motulator", "telemetry", 2, {"cogging": 1.0})
    found = [
        (NULL, answer("adequate")),
        (COGGING, answer("unknown")),
        (PAIR, answer("missing", "cogging", "stribeck")),
        (OUTSIDE, answer("unknown")),
        (other, answer("missing", "windage", "stribeck")),
        (other, {"failure": "ValueError"}),
    ]
    text = by_programme(found)
    assert "| laboratory | 4 | 1 | 1 | 0 | 1 | 1 | 1 of 1 |" in text
    assert "| telemetry | 2 | 0 | 0 | 0 | 0 | 2 | 0 of 0 |" in text
    assert "| all | 6 | 1 | 1 | 0 | 1 | 3 | 1 of 1 |" in text


def test_a_world_that_is_unknown_or_not_installed_is_a_wrong_usage(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match="no world"):
        main(options(["world=mars", f"output={tmp_path}"]))
    monkeypatch.setitem(sys.modules, "motulator.drive.model", None)
    monkeypatch.delitem(sys.modules, "tests.benchmark.worlds.with_motulator", raising=False)
    with pytest.raises(UsageError, match="needs motulator"):
        main(options(["world=motulator", f"output={tmp_path}"]))


@pytest.mark.parametrize(("timing", "held"), [("centred", 0.0), ("instant", 1.0)])
def test_a_maker_logs_the_mean_about_a_row_or_the_vector_there(timing: str, held: float) -> None:
    """A voltage that is there in every fortieth PWM period alone, from the first on."""
    pulses = (np.arange(400) % 40 == 0).astype(float)
    ramp = np.arange(400, dtype=float)
    log = {"t_s": 5e-5 * ramp, "vd_v": pulses, "vq_v": ramp, "id_a": ramp, "torque_shaft_nm": ramp}
    slow = _telemetry(log, timing)
    assert sorted(slow) == ["id_a", "t_s", "vd_v", "vq_v"]
    assert np.diff(slow["t_s"]) == pytest.approx(1e-3)
    assert slow["id_a"].tolist() == list(range(0, 400, 20))
    assert slow["vq_v"][1:-1] == pytest.approx(slow["id_a"][1:-1], abs=0.6)
    assert slow["vd_v"][2:-2:2] == pytest.approx(held or 1.0 / 20.0)
    assert slow["vd_v"][3:-2:2] == pytest.approx(0.0)


@pytest.mark.slow
def test_the_gain_of_a_phase_is_named_though_nothing_knows_the_gain_of_all() -> None:
    """By drives, one resistance and a coast, all sensors alike, R and the magnet are one scale.
    A fit that is free along it began far off, and the name was lost.
    """
    recorded = campaign(WorldCase("maker", "maker", 34, {"current_gain": 1.0}))
    found = diagnose(Recordings({recorded.motor_id: recorded}))[recorded.motor_id]
    assert (found.verdict, found.missing) == ("missing", ("current_gain",))


def test_cases_of_a_maker_are_drawn_as_those_of_other_worlds() -> None:
    drawn = cases("maker")
    assert {case.programme for case in drawn} == {"maker"}
    assert len({case.key for case in drawn}) == len(drawn) == 3 + 2 * 11 + 3 + 2 * 3


@pytest.fixture(scope="module")
def place() -> Any:
    pytest.importorskip("motulator", reason="group worlds is not installed")
    from tests.benchmark.worlds import with_motulator

    return with_motulator


@pytest.fixture(scope="module")
def hinge() -> Any:
    pytest.importorskip("mujoco", reason="group worlds is not installed")
    from tests.benchmark.worlds import with_mujoco

    return with_mujoco


@pytest.fixture(scope="module")
def gym() -> Any:
    pytest.importorskip("gym_electric_motor", reason="group worlds is not installed")
    from tests.benchmark.worlds import with_gym

    return with_gym


def driven(place: Any, sizes: dict[str, float], omega: float, i_dq: complex, n: int = 250) -> Any:
    """Motor and means of the last 100 rows: current, voltage, torque, speed, acceleration."""
    motor, hidden = place.motor(3), Hidden(sizes)
    session = Campaigner(place.Plant(motor, hidden), "laboratory", 5).sessions()["torque_map_0"]
    lane = Lane(session, np.full(n, i_dq), np.zeros(n), omega, True, 0.3)
    (rows,) = run(place.Converted([lane], [hidden]), [lane], 1.0 / PWM_HZ)
    turn = np.exp(-1j * motor.pole_pairs * rows[:, 4])
    current = (rows[:, 0] + 1j * rows[:, 1]) * turn / session.instruments.current
    voltage = (rows[:, 2] + 1j * rows[:, 3]) * turn
    slope = (rows[-1, 10] - rows[-100, 10]) * PWM_HZ / 99.0
    speed = rows[-100:, 10].mean()
    return motor, current[-100:].mean(), voltage[-100:].mean(), rows[-100:, 6].mean(), speed, slope


@pytest.mark.parametrize("omega", [60.0, -60.0])
def test_a_machine_of_motulator_keeps_the_contract_of_frame_and_signs(
    place: Any, omega: float
) -> None:
    motor, i, v, torque, turned, slope = driven(place, {}, omega, -1.5 + 3.0j)
    assert i == pytest.approx(-1.5 + 3.0j, abs=0.02)
    assert turned == pytest.approx(omega, abs=3.0)
    omega_e = motor.pole_pairs * turned
    flux = motor.ld_h * i.real + motor.psi_pm_wb + 1j * motor.lq_h * i.imag
    # the mean of a vector that stands while the rotor turns is a little shorter
    short = np.sinc(omega_e / PWM_HZ / 2.0 / np.pi)
    assert v * short == pytest.approx(motor.r_phase_ohm * i + 1j * omega_e * flux, rel=2e-3)
    made = 1.5 * motor.pole_pairs * (np.conj(flux) * i).imag
    drag = motor.torque_coulomb_nm * np.sign(omega) + motor.b_visc_nm_s_rad * turned
    assert torque == pytest.approx(made - drag - motor.j_rotor_kgm2 * slope, rel=2e-3)


def test_both_switches_off_cost_a_share_of_the_link_against_the_current(place: Any) -> None:
    motor, i, v, *_ = driven(place, {"dead_time": 2e-6}, 2.0, 5.0 + 0j, n=400)
    lost = v.real - motor.r_phase_ohm * i.real
    step = 2e-6 * PWM_HZ * motor.vdc_v
    # each phase loses a step of the link against its current: 4/π in space, at most 4/3 in a sector
    assert 1.1 * step < lost < 4.0 / 3.0 * step * 1.02


def test_a_locked_rotor_answers_a_step_with_its_time_constant(place: Any) -> None:
    motor = place.motor(3)
    t = np.linspace(0.0, 0.05, 200)
    along = place.Plant(motor, Hidden({})).locked(lambda _: 10.0, (), t, -np.pi / 2.0)
    tau = motor.lq_h / motor.r_phase_ohm
    assert along == pytest.approx(10.0 / motor.r_phase_ohm * -np.expm1(-t / tau), abs=1e-5)


def test_open_terminals_show_the_magnet_in_the_order_abc(place: Any) -> None:
    motor = place.motor(3)
    theta = np.linspace(0.0, 0.5, 50)
    v = place.Plant(motor, Hidden({})).emf(theta, np.full(50, 80.0))
    eps = motor.pole_pairs * theta
    height = -motor.pole_pairs * 80.0 * motor.psi_pm_wb
    for k in range(3):
        assert v[:, k] == pytest.approx(height * np.sin(eps - 2.0 * np.pi * k / 3.0), rel=1e-9)


def test_a_coast_follows_coulomb_and_viscous_friction(place: Any) -> None:
    motor = place.motor(3)
    path = place.Plant(motor, Hidden({})).coast(0.3, 100.0, 100.0, 200)
    t = np.arange(200) / 100.0
    rate, end = motor.b_visc_nm_s_rad / motor.j_rotor_kgm2, motor.torque_coulomb_nm
    end = end / motor.b_visc_nm_s_rad
    assert path[:, 1] == pytest.approx((100.0 + end) * np.exp(-rate * t) - end, rel=1e-6)
    steps = 0.005 * (path[1:, 1] + path[:-1, 1])
    assert np.diff(path[:, 0]) == pytest.approx(steps, rel=1e-4)


def test_current_follows_from_one_energy_when_iron_saturates(place: Any) -> None:
    """Reciprocity: ∂i_d/∂ψ_q = ∂i_q/∂ψ_d."""
    motor = place.motor(3)
    sizes = Hidden({"saturation": 0.18, "cross_saturation": 0.1})
    current = place._flux_to_current([motor], [sizes])
    at, h = motor.psi_pm_wb - 0.1 + 0.2j, 1e-6
    across = (current(np.array([at + 1j * h])) - current(np.array([at - 1j * h]))).real
    along = (current(np.array([at + h])) - current(np.array([at - h]))).imag
    assert across == pytest.approx(along, rel=1e-5)
    full = current(np.array([motor.psi_pm_wb + 1j * motor.lq_h * motor.current_rated_a]))
    assert full.imag == pytest.approx(1.18 * motor.current_rated_a)


def test_a_programme_is_the_same_bytes_again_and_holds_the_contract(place: Any) -> None:

    from tests.benchmark.worlds.recording import campaigns

    case = WorldCase("motulator", "end of line", 2, {"windage": 1.0})
    one, again = campaigns([case])[0], campaigns([case])[0]
    assert [c.sha256 for c in one.captures] == [c.sha256 for c in again.captures]
    assert [c.path for c in one.captures] == sorted(
        f"{stem}.mcap" for stem, _, _ in PROGRAMMES["end of line"]
    )
    assert {c.meta.motor_type for c in one.captures} == {"unit"}


def hidden_in(hinge: Any, *names: str) -> Any:
    motor = hinge.motor(2)
    return hinge.Plant(motor, Hidden({name: hinge.TYPICAL[name](motor) for name in names}))


def test_the_winding_of_mujoco_is_a_q_axis_of_the_contract(hinge: Any) -> None:
    """Power, torque and back-EMF of v, i are those of v_q = v, i_q = 2/3 i."""
    plant = hidden_in(hinge)
    m, t = plant.motor, np.arange(200) * 1e-4
    amps = plant.locked(lambda _: 1.0, (), t, -np.pi / 2.0)
    rise = -np.expm1(-t * m.r_phase_ohm / m.lq_h) / m.r_phase_ohm
    assert amps == pytest.approx(rise, abs=1e-6)
    rotor = hinge._Rotor(m, Hidden({}), 0.0, 90.0, held=True)
    rotor.on(12.0, 20000)
    emf = m.pole_pairs * m.psi_pm_wb * 90.0
    assert rotor.amps == pytest.approx((12.0 - emf) / m.r_phase_ohm, rel=1e-6)
    made = 1.5 * m.pole_pairs * m.psi_pm_wb * rotor.amps
    drag = m.torque_coulomb_nm + m.b_visc_nm_s_rad * 90.0
    assert rotor.shaft_torque() == pytest.approx(made - drag, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "at"),
    [
        ("windage", lambda m, w, _: m.torque_rated_nm * 0.012 * (w / m.speed_rated_rad_s) ** 2),
        ("constant_load", lambda m, _, __: 0.01 * m.torque_rated_nm),
        ("unbalance", lambda m, _, theta: 0.01 * m.torque_rated_nm * np.cos(theta)),
    ],
)
def test_what_is_hidden_in_mujoco_brakes_a_coast_as_it_is_meant_to(
    hinge: Any, name: str, at: Any
) -> None:
    plant = hidden_in(hinge, name)
    m = plant.motor
    path = plant.coast(0.4, 150.0, 1000.0, 60)
    speed, theta = (0.5 * (path[1:, k] + path[:-1, k]) for k in (1, 0))
    brake = -m.j_rotor_kgm2 * np.diff(path[:, 1]) * 1000.0
    extra = brake - m.torque_coulomb_nm - m.b_visc_nm_s_rad * speed
    assert extra == pytest.approx(at(m, speed, theta), abs=0.03 * 0.012 * m.torque_rated_nm)


@pytest.mark.parametrize("name", ["presliding", "stribeck", "cogging"])
def test_the_current_is_that_of_the_winding_whatever_friction_has_a_state(
    hinge: Any, name: str
) -> None:
    plant = hidden_in(hinge, name)
    m, rotor = plant.motor, hinge._Rotor(plant.motor, plant.hidden, 0.0, 40.0, held=True)
    rotor.on(6.0, 20000)
    emf = m.pole_pairs * m.psi_pm_wb * 40.0
    assert rotor.amps == pytest.approx((6.0 - emf) / m.r_phase_ohm, rel=1e-6)


def test_the_bristles_of_mujoco_hold_before_they_slide(hinge: Any) -> None:
    """LuGre friction builds up over its travel, and is whole far beyond it."""
    plant = hidden_in(hinge, "presliding")
    m, travel = plant.motor, plant.hidden["presliding"]
    rotor = hinge._Rotor(m, plant.hidden, 0.0, 0.01, held=True, powered=False)
    seen = []
    for _ in range(30):
        rotor.on(0.0, round(0.04 / hinge.STEP_S))
        seen.append((float(rotor.data.qpos[0]), -rotor.shaft_torque()))
    theta, brake = np.array(seen).T
    brake = brake - m.b_visc_nm_s_rad * 0.01
    early = theta < 0.3 * travel
    assert early.any()
    assert brake[early] == pytest.approx(m.torque_coulomb_nm * theta[early] / travel, rel=0.2)
    assert brake[-1] == pytest.approx(m.torque_coulomb_nm, rel=0.05)


def test_the_shaft_of_mujoco_turns_under_the_current_of_its_instant(hinge: Any) -> None:
    plant, period = hidden_in(hinge), 2e-4
    m, rotor = plant.motor, hinge._Rotor(plant.motor, Hidden({}), 0.0, 120.0)
    volts = 7.0 + np.cumsum(np.random.default_rng(0).normal(0.0, 0.05, 400))
    rows = []
    for v in volts:
        rotor.on(float(v), round(period / hinge.STEP_S))
        rows.append((rotor.theta, rotor.omega, rotor.amps))
    theta, omega, amps = np.array(rows).T
    bend = amps[2:] - 2.0 * amps[1:-1] + amps[:-2]
    made = 1.5 * m.pole_pairs * m.psi_pm_wb * (amps[1:-1] + bend / 12.0)
    slope = 1.5 * m.pole_pairs * m.psi_pm_wb * np.gradient(amps, period)[1:-1]
    pull = made - m.torque_coulomb_nm - m.b_visc_nm_s_rad * omega[1:-1]
    off = m.j_rotor_kgm2 * (theta[2:] - 2.0 * theta[1:-1] + theta[:-2]) / period**2 - pull
    assert abs(float(off @ slope / (slope @ slope))) < 0.2 * hinge.STEP_S


def test_a_log_of_q_alone_holds_means_around_its_samples(hinge: Any) -> None:
    from tests.benchmark.worlds.programmes import LOG_EVERY, _logged_q

    plant = hidden_in(hinge)
    session = Campaigner(plant, "telemetry", 5).sessions()["drive_0"]
    rows = np.zeros((400, 11))
    # a q voltage that grows evenly: held from k to k + 1 it is k + 1/2 there
    rows[:, 3] = 0.01 * (np.arange(400) + 0.5)
    table = _logged_q(session, rows, "telemetry")
    at = table["t_s"] * PWM_HZ
    assert np.diff(at) == pytest.approx(LOG_EVERY)
    gain = session.instruments.voltage_commanded
    assert table["vq_v"] == pytest.approx(gain * 0.01 * at, abs=session.voltage_step_v)
    assert set(table) == {
        "t_s",
        "iq_a",
        "vq_v",
        "theta_mech_rad",
        "omega_mech_rad_s",
        "temp_winding_degc",
    }


@pytest.mark.parametrize("omega", [90.0, -90.0])
def test_a_machine_of_gym_keeps_the_contract_of_frame_and_signs(gym: Any, omega: float) -> None:
    motor, i, v, torque, turned, slope = driven(gym, {}, omega, -20.0 + 50.0j)
    assert slope == 0.0
    assert turned == omega
    assert i == pytest.approx(-20.0 + 50.0j, abs=0.3)
    omega_e = motor.pole_pairs * omega
    flux = motor.ld_h * i.real + motor.psi_pm_wb + 1j * motor.lq_h * i.imag
    short = np.sinc(omega_e / PWM_HZ / 2.0 / np.pi)
    assert v * short == pytest.approx(motor.r_phase_ohm * i + 1j * omega_e * flux, rel=2e-3)
    made = 1.5 * motor.pole_pairs * (np.conj(flux) * i).imag
    drag = motor.torque_coulomb_nm * np.sign(omega) + motor.b_visc_nm_s_rad * omega
    assert torque == pytest.approx(made - drag, rel=2e-3)


def test_a_leg_of_gym_that_is_dead_follows_its_current(gym: Any) -> None:
    motor, i, v, *_ = driven(gym, {"dead_time": 2e-6}, 2.0, 80.0 + 0j)
    lost = v.real - motor.r_phase_ohm * i.real
    step = 2e-6 * PWM_HZ * motor.vdc_v
    assert 1.1 * step < lost < 4.0 / 3.0 * step * 1.02


def test_a_locked_rotor_and_open_terminals_of_gym_show_inductance_and_magnet(gym: Any) -> None:
    motor = gym.motor(3)
    plant = gym.Plant(motor, Hidden({}))
    t = np.linspace(0.0, 0.2, 100)
    along = plant.locked(lambda _: 0.5, (), t, -np.pi / 2.0)
    tau = motor.lq_h / motor.r_phase_ohm
    assert along == pytest.approx(0.5 / motor.r_phase_ohm * -np.expm1(-t / tau), abs=1e-4)
    theta = np.linspace(0.0, 0.5, 50)
    v = plant.emf(theta, np.full(50, 80.0))
    height = -motor.pole_pairs * 80.0 * motor.psi_pm_wb
    for k in range(3):
        angle = motor.pole_pairs * theta - 2.0 * np.pi * k / 3.0
        assert v[:, k] == pytest.approx(height * np.sin(angle), rel=1e-9)


def test_a_field_winding_of_gym_answers_a_step_at_once_with_less_inductance(gym: Any) -> None:
    motor = gym.motor(3)
    t = np.array([0.0, 1e-5, 2e-5])
    rises = []
    for sizes in ({}, {"field_winding": 0.1}):
        plant = gym.Plant(motor, Hidden(sizes))
        assert plant.emf(t, np.full(3, 80.0)) == pytest.approx(
            gym.Plant(motor, Hidden({})).emf(t, np.full(3, 80.0))
        )
        rises.append(plant.locked(lambda _: 1.0, (), t, 0.0)[-1])
    assert rises[0] / rises[1] == pytest.approx(0.9, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "at"),
    [
        ("windage", lambda m, w, _: m.torque_rated_nm * 0.012 * (w / m.speed_rated_rad_s) ** 2),
        ("constant_load", lambda m, _, __: 0.01 * m.torque_rated_nm),
        ("unbalance", lambda m, _, theta: 0.01 * m.torque_rated_nm * np.sin(theta + 1.1)),
        ("stribeck", lambda m, w, _: 8e-3 * m.torque_rated_nm * np.exp(-((w / 9.0) ** 1.5))),
    ],
)
def test_what_is_hidden_in_gym_brakes_a_coast_as_it_is_meant_to(
    gym: Any, name: str, at: Any
) -> None:
    m = gym.motor(2)
    plant = gym.Plant(m, Hidden({name: gym.TYPICAL[name](m)}))
    path = plant.coast(0.4, 60.0, 1000.0, 500)
    speed, theta = (0.5 * (path[1:, k] + path[:-1, k]) for k in (1, 0))
    brake = -m.j_rotor_kgm2 * np.diff(path[:, 1]) * 1000.0
    extra = brake - m.torque_coulomb_nm - m.b_visc_nm_s_rad * speed
    assert extra == pytest.approx(at(m, speed, theta), abs=0.02 * 0.008 * m.torque_rated_nm)
    still = plant.turned(np.array([0.3]), np.array([5.0]))
    rest = -still - m.torque_coulomb_nm - 5.0 * m.b_visc_nm_s_rad
    assert rest == pytest.approx(at(m, 5.0, 0.3), rel=1e-9)


def test_the_link_of_gym_sags_by_the_power_that_is_drawn(gym: Any) -> None:
    """Rated power costs the share that is hidden; what is asked for is more by as much."""
    asked, lost = [], 0.0
    for sizes in ({}, {"sagging_link": 0.03}):
        motor, i, v, *_ = driven(gym, sizes, 200.0, 60.0j)
        flux = motor.ld_h * i.real + motor.psi_pm_wb + 1j * motor.lq_h * i.imag
        there = motor.r_phase_ohm * i + 1j * motor.pole_pairs * 200.0 * flux
        asked.append(abs(v) / abs(there))
        power = 1.5 * (there * np.conj(i)).real
        lost = 0.03 * power / (motor.torque_rated_nm * motor.speed_rated_rad_s)
    # legs draw the current of an edge until the next, which the ripple puts a tenth off
    assert asked[1] / asked[0] - 1.0 == pytest.approx(lost, rel=0.15)


def test_stepwise_regression_names_the_blocks_that_pay_and_no_other() -> None:
    random = np.random.default_rng(3)
    matrix = random.normal(size=(400, 7))
    target = matrix @ [1.0, 0.5, 0.0, 0.8, 0.0, 0.0, 0.0] + 0.1 * random.normal(size=400)
    blocks = {
        "one": [np.array([1])],
        "none": [np.array([2])],
        "shaped": [np.array([4, 5]), np.array([3, 6])],
    }
    assert set(_chosen(matrix, target, np.array([0]), blocks)) == {"one", "shaped"}


def test_methods_stand_beside_each_other_with_hits_false_names_and_abstentions() -> None:
    ours = [
        (NULL, answer("adequate")),
        (PAIR, answer("missing", "cogging")),
        (OUTSIDE, answer("unknown")),
    ]
    other = [(NULL, answer("missing", "windage")), (OUTSIDE, answer("missing", "cogging"))]
    text = beside({"diagnose": ours, "other": other, "silent": []})
    assert "| `diagnose` | 3 | 1 of 2 | 0 | 1 | 1 of 1 | 1 of 1 |" in text
    assert "| `other` | 2 | 0 of 0 | 2 | 0 | 0 of 1 | 0 of 1 |" in text
    assert "silent" not in text


def test_dry_friction_of_a_joint_opposes_motion_not_acceleration() -> None:
    """MuJoCo's friction loss is a soft constraint: by default its sign is that of the acceleration
    up to 27 rad/s in a motor that brakes hard.
    """
    pytest.importorskip("mujoco", reason="group worlds is not installed")
    from tests.benchmark.worlds import with_mujoco

    m = with_mujoco.motor(1)
    rotor = with_mujoco._Rotor(m, Hidden({}), 0.0, 40.0)
    volts, period = -m.pole_pairs * m.psi_pm_wb * 30.0, 1e-4
    rows = []
    for _ in range(600):
        rows.append((rotor.amps, rotor.theta, rotor.omega))
        rotor.on(volts, round(period / with_mujoco.STEP_S))
    amps, theta, omega = np.array(rows).T
    slope = np.diff(theta, 2) / period**2
    mean = amps[1:-1] + np.diff(amps, 2) / 6.0
    torque = 1.5 * m.pole_pairs * m.psi_pm_wb * mean - m.b_visc_nm_s_rad * omega[1:-1]
    friction = torque - m.j_rotor_kgm2 * slope
    turning = np.abs(omega[1:-1]) > 0.5
    turning[:5] = False
    expected = m.torque_coulomb_nm * np.sign(omega[1:-1])
    assert (omega[1:-1] < -5.0).any()
    assert (omega[1:-1] > 5.0).any()
    assert friction[turning] == pytest.approx(expected[turning], abs=0.02 * m.torque_coulomb_nm)


def turned_by(extra: Any) -> Campaign:
    """A log of a shaft that a q current drives to and fro, with a torque that the model lacks."""
    step, n = 1e-3, 6000
    t = step * np.arange(n)
    iq = 4.0 * np.sin(7.0 * t) + 2.0 * np.sin(31.0 * t)
    theta, omega = np.zeros(n), np.zeros(n)
    for k in range(n - 1):
        # sixty steps a row, so that the sign of a friction turns where it should
        theta[k + 1], omega[k + 1] = theta[k], omega[k]
        for part in range(60):
            i = iq[k] + (iq[k + 1] - iq[k]) * (part + 0.5) / 60.0
            w = omega[k + 1]
            pull = 0.3 * i - 2e-3 * w - 0.05 * np.tanh(w / 0.05) - extra(theta[k + 1], w)
            omega[k + 1] = w + pull / 3e-3 * step / 60.0
            theta[k + 1] += omega[k + 1] * step / 60.0
    noise = np.random.default_rng(5)
    iq, omega = iq + noise.normal(0.0, 0.02, n), omega + noise.normal(0.0, 0.05, n)
    columns = {"t_s": t, "theta_mech_rad": theta, "omega_mech_rad_s": omega, "iq_a": iq}
    meta = CaptureMeta(motor_id="m", test="drive", pole_pairs=2, slots=6)
    capture = Capture("drive.mcap", "", "unverified", meta, (pl.DataFrame(columns),))
    return Campaign("m", (capture,))


@pytest.mark.parametrize(
    ("extra", "names"),
    [
        (lambda _, __: 0.0, ()),
        (lambda theta, _: 0.05 * np.sin(12.0 * theta + 0.4), ("cogging",)),
        (lambda _, w: 2e-5 * w * abs(w), ("windage",)),
    ],
)
def test_sparse_identification_names_the_term_that_moves_the_shaft(
    extra: Any, names: tuple[str, ...]
) -> None:
    pytest.importorskip("pysindy", reason="group worlds is not installed")
    assert weak_sindy(turned_by(extra)) == names
