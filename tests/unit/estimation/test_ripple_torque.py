"""Torque of ripple currents: harmonics of an EMF whose currents brake, by closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.electrical.operating_points import operating_points
from pipeline.estimation.electrical.ripple_torque import (
    RIPPLE,
    Winding,
    ripple_of,
    ripple_torque,
    winding_of,
)
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

R_OHM, L_H, PSI_WB, PAIRS, GAIN_OHM = 0.6, 1.3e-3, 0.055, 22, 1.7
WINDING = Winding(PAIRS, R_OHM)
KNOWN = Constants(
    (
        known_value("pole_pairs", float(PAIRS)),
        known_value("r_phase_ohm", R_OHM, unit="ohm"),
    )
)
EMF = {6: 0.05 - 0.02j, -6: -0.03 + 0.04j, 12: 0.01j}
"""Harmonics of the EMF in the rotor's frame over that of the magnet's fundamental."""


def harmonics(omega_rad_s: float) -> tuple[dict[int, complex], dict[int, complex], float]:
    """Voltages [V] and currents [A] by order, and their torque [N·m].

    v = R i + L di/dt + j ω L i + e, and a controller that answers v = -G i. The flux that makes the
    EMF turns Re(e i*) into torque.
    """
    w = PAIRS * omega_rad_s
    current = {
        k: -w * PSI_WB * e / (R_OHM + GAIN_OHM + 1j * (k + 1) * w * L_H) for k, e in EMF.items()
    }
    power = sum((w * PSI_WB * EMF[k] * np.conj(i)).real for k, i in current.items())
    return {k: -GAIN_OHM * i for k, i in current.items()}, current, 1.5 * power / omega_rad_s


def columns(omega_rad_s, *, seconds=0.2, rate=16e3, rows=1, iq=3.0, noise=0.0, seed=0, start=0.0):
    """A steady shaft logged every `rows` periods of its PWM, as means of that many."""
    t = np.arange(round(seconds * rate / rows) * rows) / rate
    theta = start + omega_rad_s * t
    voltage, current, _ = harmonics(omega_rad_s)

    def logged(parts, mean):
        whole = mean + sum(a * np.exp(1j * k * PAIRS * theta) for k, a in parts.items())
        means = whole.reshape(-1, rows).mean(axis=1)
        rng = np.random.default_rng(seed)
        return means + noise * (
            rng.standard_normal(means.size) + 1j * rng.standard_normal(means.size)
        )

    v, i = logged(voltage, 5.0j), logged(current, 1j * iq)
    clock, angle = (x.reshape(-1, rows).mean(axis=1) for x in (t, theta))
    return {"t_s": clock, "theta_mech_rad": angle, "vd_v": v.real, "vq_v": v.imag,
            "id_a": i.real, "iq_a": i.imag}  # fmt: skip


def found(data, rows=slice(None), **meta):
    meta = {"voltage_kind": "measured", "voltage_timing": "centred", "pwm_hz": 16e3, **meta}
    return ripple_of(capture("drive", **meta), data, rows, WINDING)


@pytest.mark.parametrize("omega", [4.2, -11.2, 15.0])
def test_the_power_of_harmonics_is_what_the_flux_of_harmonics_makes(omega: float) -> None:
    voltage, current, expected = harmonics(omega)
    orders = list(EMF)
    v, i = (np.array([one[k] for k in orders]) for one in (voltage, current))
    assert ripple_torque(v, i, R_OHM, omega) == pytest.approx(expected, rel=1e-9)
    assert expected * omega < 0.0


@pytest.mark.parametrize("rows", [1, 4, 8])
@pytest.mark.parametrize("omega", [6.0, -11.2])
def test_of_rows_whether_samples_or_means(omega: float, rows: int) -> None:
    torque, u = found(columns(omega, rows=rows))
    assert torque == pytest.approx(harmonics(omega)[2], rel=2e-3)
    # a winding that was not measured, by 10 K or so
    assert 0.0 < abs(u) < 0.05 * abs(torque)


def test_a_held_voltage_is_that_of_the_middle_of_its_period() -> None:
    data, rate = columns(11.2, rate=4e3), 4e3
    middle = data["theta_mech_rad"] + 0.5 * 11.2 / rate
    voltage, _, expected = harmonics(11.2)
    # the vector that stands still over a period, in the frame of its beginning
    turn = np.exp(0.5j * PAIRS * 11.2 / rate)
    v = turn * (5.0j + sum(a * np.exp(1j * k * PAIRS * middle) for k, a in voltage.items()))
    data |= {"vd_v": v.real, "vq_v": v.imag}
    held = found(data, voltage_timing="held", pwm_hz=rate)[0]
    assert held == pytest.approx(expected, rel=2e-3)
    assert abs(found(data, voltage_timing="instant", pwm_hz=rate)[0] / expected - 1.0) > 0.01


def test_a_warm_winding_takes_more_of_the_power() -> None:
    data = columns(8.0)
    _, current, expected = harmonics(8.0)
    square = sum(abs(i) ** 2 for i in current.values())
    warm = found(data | {"temp_winding_degc": np.full(data["t_s"].size, 65.0)})
    more = 1.5 * R_OHM * 40.0 * 3.85e-3 * square / 8.0
    assert warm[0] == pytest.approx(expected - more, rel=2e-3)
    assert abs(warm[1]) < abs(found(data)[1])


def test_noise_of_voltage_and_current_alike_makes_no_torque() -> None:
    """A controller answers noise too; a ripple four times beyond it is one."""
    data = columns(8.0, noise=0.05, seconds=0.1, rows=8)
    assert found(data)[0] == pytest.approx(harmonics(8.0)[2], rel=0.02)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        noise = {name: rng.standard_normal(200) for name in ("id_a", "iq_a")}
        noise |= {"vd_v": -GAIN_OHM * noise["id_a"], "vq_v": -GAIN_OHM * noise["iq_a"]}
        assert found(data | noise, voltage_kind="commanded") == (0.0, 0.0)


def test_a_commanded_voltage_leaves_what_a_dead_time_takes() -> None:
    """Sign of the current of each phase, 1 V of a link of 50 V: 0.35 V of harmonics."""
    data = columns(8.0)
    _, current, _ = harmonics(8.0)
    rms = np.sqrt(sum(abs(i) ** 2 for i in current.values()))
    measured, commanded = (
        found(data, voltage_kind=kind, vdc_v=50.0) for kind in ("measured", "commanded")
    )
    assert commanded[0] == measured[0]
    assert commanded[1] == pytest.approx(1.5 * 0.35 * rms / 8.0, rel=0.05)
    assert found(data, voltage_kind="commanded", vdc_v=100.0)[1] > 1.9 * commanded[1]


def test_a_torque_of_ripple_below_its_own_doubt_is_not_taken_off_and_stands_in_it() -> None:
    """What 2 % of a link of 5 kV may drop is more than all of the ripple's power."""
    data = columns(8.0)
    torque = found(data, voltage_kind="commanded", vdc_v=50.0)[0]
    none, unknown = found(data, voltage_kind="commanded", vdc_v=5000.0)
    _, doubt = found(data, voltage_kind="commanded", vdc_v=4900.0)
    assert none == 0.0
    assert unknown > abs(torque)
    assert unknown**2 - torque**2 == pytest.approx(
        (doubt**2 - torque**2) * (50 / 49) ** 2, rel=1e-3
    )


def test_what_shows_no_ripple_torque() -> None:
    data = columns(8.0)
    blind = {name: column for name, column in data.items() if name != "vd_v"}
    hidden = data | {"iq_a": np.where(np.arange(data["iq_a"].size) == 5, np.nan, data["iq_a"])}
    # a third of a radian of the electrical angle: one ripple is not whole
    short = slice(0, 40)
    assert found(blind) == found(hidden) == found(data, short) == (0.0, 0.0)
    assert ripple_of(capture("drive"), data, slice(None), None) == (0.0, 0.0)
    assert winding_of(None, KNOWN.best("r_phase_ohm")) is None
    assert winding_of(PAIRS, None) is None


def driven(seconds=3.0, speeds=(9.0,)):
    """Stretches at these speeds, with a step of the q current each 50 ms, logged as means of 8."""
    whole, t, turned = [], [], []
    for number, omega in enumerate(speeds):
        data = columns(omega, seconds=seconds, rows=8, start=sum(turned))
        steps = np.where((data["t_s"] // 0.05) % 2 == 0, 2.0, -2.0)
        data["iq_a"] = data["iq_a"] + steps
        data["vd_v"] = data["vd_v"] - PAIRS * omega * L_H * steps
        data["vq_v"] = data["vq_v"] + R_OHM * steps + 3.0 * np.gradient(steps)
        t.append(data["t_s"] + number * seconds)
        turned.append(omega * seconds)
        whole.append(data)
    data = {name: np.concatenate([one[name] for one in whole]) for name in whole[0]}
    data["t_s"] = np.concatenate(t)
    made = capture("drive", voltage_kind="measured", voltage_timing="centred", pwm_hz=16e3, **data)
    return data, made


def test_a_step_of_the_current_is_no_ripple() -> None:
    """In one window it hides the ripple, or looks like one; its phase does not stay."""
    data, made = driven()
    expected = harmonics(9.0)[2]
    alone = [found(data, slice(k, k + 40))[0] / expected - 1.0 for k in range(0, 5960, 20)]
    assert np.max(np.abs(alone)) > 0.9
    rows = shaft_rows([made], {}, winding=WINDING)
    assert rows is not None
    assert rows.ripple_nm == pytest.approx(expected, rel=0.1)
    without = shaft_rows([made], {})
    assert without is not None
    assert not np.any(without.ripple_nm)


def test_steps_and_noise_of_a_drive_without_ripple_leave_it_alone() -> None:
    """A commanded voltage: neither a torque nor what an inverter may drop of a ripple."""
    data, made = driven(seconds=2.0)
    omega, steps = 9.0, np.where((data["t_s"] // 0.05) % 2 == 0, 2.0, -2.0)
    rng = np.random.default_rng(3)
    noise = 0.01 * rng.standard_normal((4, steps.size))
    bare = {
        "id_a": noise[0],
        "iq_a": 3.0 + steps + noise[1],
        "vd_v": -PAIRS * omega * L_H * steps - GAIN_OHM * noise[0],
        "vq_v": 5.0 + R_OHM * steps + 3.0 * np.gradient(steps) - GAIN_OHM * noise[1],
    }
    meta = {"voltage_kind": "commanded", "voltage_timing": "centred", "pwm_hz": 16e3}
    rows = shaft_rows([capture("drive", **meta, **data | bare)], {}, winding=WINDING)
    assert rows is not None
    kept = np.count_nonzero(rows.u_ripple_nm) / rows.count
    assert kept < 0.05
    there = shaft_rows([made], {}, winding=WINDING)
    assert there is not None
    assert np.all(there.u_ripple_nm > 0.0)


def test_torque_of_ripple_over_speed_and_where_no_ripple_was_seen() -> None:
    """Both senses, each with its own phases; at 0.14 rad/s a second has no three ripples."""
    speeds = (9.0, -9.0, 13.0, 0.14)
    _, made = driven(seconds=1.0, speeds=speeds)
    rows = shaft_rows([made], {}, winding=WINDING)
    assert rows is not None
    for number, omega in enumerate(speeds[:3]):
        inside = np.abs(rows.time_s - number - 0.5) < 0.4
        assert rows.ripple_nm[inside] == pytest.approx(harmonics(omega)[2], rel=0.1)
        assert np.abs(rows.u_ripple_nm[inside]).max() < 0.06 * abs(harmonics(omega)[2])
    slow = np.abs(rows.speed_rad_s - 0.14) < 1e-3
    assert np.any(slow)
    share = rows.u_ripple_nm[slow] / np.abs(rows.ripple_nm[slow])
    assert share == pytest.approx(1.0 / np.sqrt(3.0), rel=0.05)


def torque_maps(speeds=(11.2, -11.2, 13.0, -13.0, 15.0, -15.0), b=0.01, coulomb=0.3):
    """Stretches of q current at held speeds, the transducer reading what ripple takes."""
    kt, made = 1.5 * PAIRS * PSI_WB, []
    rng = np.random.default_rng(1)
    for number, omega in enumerate(speeds):
        steps = [columns(omega, seconds=0.25, rows=8, iq=iq) for iq in (-15.0, 0.0, 15.0)]
        t = np.arange(sum(s["t_s"].size for s in steps)) * 8.0 / 16e3
        data = {name: np.concatenate([s[name] for s in steps]) for name in steps[0]}
        turned = np.concatenate(
            [s["theta_mech_rad"] + k * 0.25 * omega for k, s in enumerate(steps)]
        )
        torque = kt * data["iq_a"] + harmonics(omega)[2] - coulomb * np.sign(omega) - b * omega
        torque = torque + 1e-3 * rng.standard_normal(t.size)
        data |= {"t_s": t, "theta_mech_rad": turned, "torque_shaft_nm": torque}
        made.append(capture("torque_map", f"map_{number}", voltage_kind="measured", pwm_hz=16e3,
                            voltage_timing="centred", ambient_degc=25.0, **data))  # fmt: skip
    return made


def test_drag_of_a_torque_map_is_without_the_brake_of_ripple() -> None:
    """Ripple brakes by 0.034 N·m at each of these speeds, which looked like dry friction.

    Without a resistance nothing can be taken off.
    """
    maps = torque_maps()
    points = operating_points(maps, PAIRS, KNOWN.best("r_phase_ohm")).points
    assert [p.ripple_nm for p in points] == pytest.approx(
        [harmonics(p.omega_mech_rad_s)[2] for p in points], rel=0.01
    )
    one = points[0].shifted({RIPPLE: 1.0, "current@s": 0.01})
    assert one.ripple_nm == pytest.approx(1.01 * points[0].ripple_nm + points[0].u_ripple_nm)
    result = estimates(TORQUE_MAP, *maps, known=KNOWN)
    viscous, coulomb = result["b_visc_nm_s_rad"], result["torque_coulomb_nm"]
    assert viscous.number == pytest.approx(0.01, abs=2.0 * viscous.u)
    assert coulomb.number == pytest.approx(0.3, abs=2.0 * coulomb.u)
    assert coulomb.u < 0.005
    assert RIPPLE in {part.source for part in viscous.budget}
    unknown = Constants((KNOWN.best("pole_pairs"),))
    braked = estimates(TORQUE_MAP, *maps, known=unknown)["torque_coulomb_nm"]
    assert braked.number > 0.33
