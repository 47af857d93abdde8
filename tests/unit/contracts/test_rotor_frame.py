"""Phase currents and voltages of a log become dq columns by its electrical angle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.validate import validate
from pipeline.criticism.data.instruments import stated_u
from pipeline.criticism.machine.model import Model
from pipeline.records.capture import U_ZERO, Capture, CaptureMeta
from pipeline.records.errors import CaptureError
from tests.unit.criticism.machines import machine

THIRD = 2.0 * math.pi / 3.0
N = 4000
T_S = 1e-3 * np.arange(N)
EPS = 30.0 * T_S + 4.0 * np.sin(3.0 * T_S) + 0.7
DQ = {
    "id_a": -1.5 + 0.5 * np.sin(2.0 * T_S),
    "iq_a": 4.0 * np.cos(3.0 * T_S),
    "vd_v": 0.8 * np.sin(4.0 * T_S),
    "vq_v": 6.0 + 2.0 * np.cos(T_S),
}


def phases(d: np.ndarray, q: np.ndarray) -> list[np.ndarray]:
    """Phases a, b, c, each by the projection of the vector on its axis."""
    return [d * np.cos(EPS - k * THIRD) - q * np.sin(EPS - k * THIRD) for k in range(3)]


def log(*without: str, test: str = "drive", **more: np.ndarray) -> Capture:
    """What a scope and an encoder record of `DQ`, with what voltages have in common."""
    columns = {"t_s": T_S, "theta_elec_rad": EPS, "theta_mech_rad": EPS / 7.0}
    for letter, current, volts in zip(
        "abc", phases(DQ["id_a"], DQ["iq_a"]), phases(DQ["vd_v"], DQ["vq_v"]), strict=True
    ):
        columns |= {f"i{letter}_a": current, f"v{letter}_v": volts + 3.0}
    v = [columns[f"v{x}_v"] for x in "abc"]
    columns |= {"vab_v": v[0] - v[1], "vbc_v": v[1] - v[2], "vca_v": v[2] - v[0]} | more
    table = pl.DataFrame({n: x for n, x in columns.items() if n not in without})
    meta = CaptureMeta("m", test, pole_pairs=7)
    return Capture("log.csv", "0" * 64, "verified", meta, (table,))


LINES, STAR = ("vab_v", "vbc_v", "vca_v"), ("va_v", "vb_v", "vc_v")


@pytest.mark.parametrize(
    "without", [LINES, STAR, (*STAR, "vbc_v"), ("ic_a", *LINES), ("ia_a", *STAR, "vca_v")]
)
def test_any_two_of_three_give_the_rotor_frame(without: tuple[str, ...]) -> None:
    capture, findings = validate(log(*without), {})
    turned = capture.arrays(*DQ)
    for name, true in DQ.items():
        assert turned[name] == pytest.approx(true, abs=1e-9), name
    (said,) = [f for f in findings if f.code == "rotor_frame"]
    assert "id_a, iq_a, vd_v, vq_v" in said.message


def test_currents_alone_are_turned_without_voltages() -> None:
    capture, _ = validate(log(*LINES, *STAR), {})
    assert capture.has("id_a", "iq_a")
    assert not capture.has("vq_v")


def test_a_drive_s_own_dq_voltages_leave_the_currents_to_its_phases() -> None:
    own = {name: DQ[name] + 0.1 for name in ("vd_v", "vq_v")}
    capture, findings = validate(log(*LINES, **own), {})
    for name, true in {**DQ, **own}.items():
        assert capture.arrays(name)[name] == pytest.approx(true, abs=1e-9), name
    (said,) = [f for f in findings if f.code == "rotor_frame"]
    assert said.message.startswith("id_a, iq_a are made")


def test_what_the_drive_logs_itself_stays() -> None:
    own = {"iq_a": DQ["iq_a"] + 0.1}
    capture, findings = validate(log(**own), {})
    assert capture.arrays("iq_a")["iq_a"] == pytest.approx(own["iq_a"])
    assert not capture.has("id_a")
    assert "rotor_frame" not in {f.code for f in findings}


def test_without_an_electrical_angle_the_refusal_asks_for_one() -> None:
    with pytest.raises(CaptureError, match="theta_elec_rad, 0 with the magnet on phase a"):
        validate(log("theta_elec_rad"), {})


def test_a_test_that_holds_no_dq_is_left_alone() -> None:
    capture, _ = validate(log("ia_a", "ib_a", "ic_a", test="open_circuit"), {})
    assert not capture.has("vq_v")


RATE_HZ, PAIRS, OFFSET_RAD = 5000.0, 5, 0.8


def motor(
    omega: Callable[[np.ndarray], np.ndarray], late_s: float = 0.0, **stated: int
) -> tuple[Capture, dict[str, np.ndarray]]:
    """Phases and the shaft's angle of a salient motor at a speed [rad/s] of time, the magnet off
    the angle's zero, voltages `late_s`; and its true dq currents.
    """
    t = np.arange(20000) / RATE_HZ
    speed = omega(t)
    theta = np.cumsum(speed) / RATE_HZ
    i_d, i_q = 1.5 * np.sin(2.3 * t), 6.0 * np.sin(1.7 * t) + np.sign(speed)
    electrical = PAIRS * speed
    rates = [np.gradient(i, t) for i in (i_d, i_q)]
    v_d = 0.2 * i_d + 4e-4 * rates[0] - electrical * 7e-4 * i_q
    v_q = 0.2 * i_q + 7e-4 * rates[1] + electrical * (4e-4 * i_d + 8e-3)
    rng = np.random.default_rng(3)
    axis = PAIRS * theta + OFFSET_RAD
    turn = np.exp(1j * axis)
    vectors = {
        "i": (i_d + 1j * i_q) * turn,
        "v": (v_d + 1j * v_q) * turn * np.exp(1j * electrical * late_s),
    }
    columns = {"t_s": t, "theta_mech_rad": theta + rng.normal(0.0, 1e-4, t.size)}
    for kind, unit in (("i", "a"), ("v", "v")):
        for k, letter in enumerate("abc"):
            seen = np.real(vectors[kind] * np.exp(-1j * k * THIRD))
            columns[f"{kind}{letter}_{unit}"] = seen + rng.normal(0.0, 0.02, t.size)
    meta = CaptureMeta("m", "drive", **stated)
    capture = Capture("log.csv", "0" * 64, "verified", meta, (pl.DataFrame(columns),))
    return capture, {"id_a": i_d, "iq_a": i_q}


def both_ways(t: np.ndarray) -> np.ndarray:
    """A speed that swings through both senses."""
    return 90.0 * np.sin(1.1 * t) + 20.0 * np.sin(3.7 * t)


@pytest.mark.parametrize("late_s", [0.0, 2e-4])
@pytest.mark.parametrize("stated", [{}, {"pole_pairs": PAIRS}])
def test_the_back_emf_shows_an_angle_that_is_not_logged(
    late_s: float, stated: dict[str, int]
) -> None:
    capture, true = motor(both_ways, late_s, **stated)
    capture, findings = validate(capture, {})
    for name, current in true.items():
        error = capture.arrays(name)[name] - current
        assert np.sqrt(np.mean(error**2)) < 0.05, name
    (said,) = [f for f in findings if f.code == "rotor_frame"]
    count, _, zero = said.message.split("made of the phases by ")[1].split()[:3]
    assert int(count) == PAIRS
    assert float(zero) == pytest.approx(OFFSET_RAD, abs=3e-3)


def test_stated_pole_pairs_that_the_voltages_contradict_are_named() -> None:
    with pytest.raises(CaptureError, match=r"voltages turn 5 times .* pole_pairs states 4"):
        validate(motor(both_ways, pole_pairs=4)[0], {})


def test_exchanged_phases_are_named() -> None:
    capture, _ = motor(lambda t: both_ways(-t))
    table = capture.tables[0].rename(
        {"va_v": "vb_v", "vb_v": "va_v", "ia_a": "ib_a", "ib_a": "ia_a"}
    )
    with pytest.raises(CaptureError, match="exchange two phases"):
        validate(replace(capture, tables=(table,)), {})


def test_one_speed_does_not_show_the_angle() -> None:
    """The current's voltage and a delay's are not parted from the magnet's."""
    with pytest.raises(CaptureError, match="turn in both senses, at changing speed"):
        validate(motor(lambda t: 60.0 + 0.0 * t)[0], {})


def test_the_doubt_of_a_zero_that_the_back_emf_shows_goes_with_the_capture() -> None:
    """Few milliradians, which an alignment of one does not cover."""
    shown, _ = validate(motor(both_ways, pole_pairs=PAIRS)[0], {})
    u_rad = float(shown.meta.extra[U_ZERO])
    assert 1e-5 < u_rad < 0.02
    assert stated_u((shown,))["zero_angle_rad"] == u_rad
    logged, _ = validate(log(), {})
    assert U_ZERO not in logged.meta.extra
    assert "zero_angle_rad" not in stated_u((logged,))


@pytest.mark.parametrize(("u_rad", "prior"), [(6e-3, 6e-3), (1e-4, 1e-3)])
def test_a_zero_is_known_as_well_as_the_voltages_show_it_and_no_better_than_a_drives(u_rad, prior):
    stated = replace(machine(), stated_u={"zero_angle_rad": u_rad})
    assert Model(stated, ()).priors()["zero_angle_rad"] == (0.0, prior)
