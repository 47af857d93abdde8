"""Conventions against worked cases, independent phase-wise computation and round trips."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.physics.copper import (
    COPPER_COEFFICIENT_25_1_K,
    coefficient_at_1_k,
    copper_resistance_ohm,
    copper_temperature_degc,
    linear_resistance_ohm,
)
from pipeline.physics.coupling import (
    COUPLINGS,
    CouplingName,
    coupling_as,
    coupling_from,
    motor_constant_nm_sqrt_w,
)
from pipeline.physics.pole_pairs import pole_pairs_from
from pipeline.physics.suspects import CONVENTIONS, convention_suspect
from pipeline.physics.windings import (
    delta_from_wye,
    delta_windings_ohm,
    line_from_phase,
    line_resistances_ohm,
    phase_from_line,
    phase_resistances_ohm,
    saliency_words,
    terminal_inductance_h,
    unaligned_inductances_h,
    wye_from_delta,
)

# The worked example: 7 pole pairs, 304 rpm/V of line-line peak back-EMF.
K_EXAMPLE = 0.018136
EXAMPLE: dict[CouplingName, float] = {
    "ke_phase_peak_v_s_rad": 0.018136,
    "ke_ll_peak_v_s_rad": 0.031412,
    "ke_ll_peak_v_krpm": 3.289,
    "ke_ll_rms_v_s_rad": 0.022212,
    "ke_ll_rms_v_krpm": 2.326,
    "kv_ll_peak_rpm_v": 304.0,
    "kv_six_step_rpm_v": 318.3,
    "kt_peak_nm_a": 0.027204,
    "kt_rms_nm_a": 0.038472,
    "kt_power_invariant_nm_a": 0.022212,
    "kt_six_step_nm_a": 0.029996,
}
POSITIVE = st.floats(1e-6, 1e3)
ANGLE = st.floats(-10.0, 10.0)


def test_every_convention_has_a_worked_value() -> None:
    assert set(EXAMPLE) == set(COUPLINGS)


@pytest.mark.parametrize(("name", "value"), EXAMPLE.items())
def test_coupling_example(name: CouplingName, value: float) -> None:
    assert coupling_as(name, K_EXAMPLE) == pytest.approx(value, rel=2e-4)
    assert coupling_from(name, value) == pytest.approx(K_EXAMPLE, rel=2e-4)


@given(k=POSITIVE)
def test_couplings_invert(k: float) -> None:
    for name in COUPLINGS:
        assert coupling_from(name, coupling_as(name, k)) == pytest.approx(k, rel=1e-12)


def test_couplings_from_the_waveforms_themselves() -> None:
    """Phase voltages of a turning rotor, read as an instrument would, give each Ke and Kt."""
    k, omega = 0.4, 50.0
    turn = np.arange(6000) * 2.0 * np.pi / 6000.0
    phases = [-k * omega * np.sin(turn - shift) for shift in (0.0, 2 * np.pi / 3, -2 * np.pi / 3)]
    line = phases[0] - phases[1]
    assert coupling_as("ke_ll_peak_v_s_rad", k) == pytest.approx(line.max() / omega, rel=1e-6)
    rms = math.sqrt(float(np.mean(line**2)))
    assert coupling_as("ke_ll_rms_v_s_rad", k) == pytest.approx(rms / omega, rel=1e-9)
    # One ampere (peak) in phase with the back-EMF: torque is the air-gap power over the speed.
    power = sum(e * (-np.sin(turn - s)) for e, s in zip(phases, (0, 2.0944, -2.0944), strict=True))
    assert coupling_as("kt_peak_nm_a", k) == pytest.approx(power.mean() / omega, rel=1e-5)
    # Six-step: the DC ampere runs through the two phases of the highest line-line voltage.
    envelope = np.max([abs(phases[i] - phases[j]) for i, j in ((0, 1), (1, 2), (2, 0))], axis=0)
    assert coupling_as("kt_six_step_nm_a", k) == pytest.approx(envelope.mean() / omega, rel=1e-5)
    krpm_rad_s = 1000.0 * 2.0 * math.pi / 60.0
    assert coupling_as("ke_ll_peak_v_krpm", k) == pytest.approx(math.sqrt(3) * k * krpm_rad_s)
    volts_per_rpm = line.max() / (omega * 60.0 / (2.0 * math.pi))
    assert coupling_as("kv_ll_peak_rpm_v", k) == pytest.approx(1.0 / volts_per_rpm, rel=1e-6)


def test_motor_constant_is_torque_over_root_of_loss() -> None:
    kt, r, i_peak = 0.3, 0.7, 2.0
    loss_w = 3.0 * (i_peak / math.sqrt(2.0)) ** 2 * r
    assert motor_constant_nm_sqrt_w(kt, r) == pytest.approx(kt * i_peak / math.sqrt(loss_w))


def test_one_ohm_line_to_line_is_half_an_ohm_a_phase() -> None:
    assert phase_from_line(1.0) == 0.5
    assert line_from_phase(0.5) == 1.0
    # The delta winding of 1.5 ohm reads 1.5 against 3 in parallel: 1 ohm.
    winding = delta_from_wye(0.5)
    assert winding == 1.5
    assert 1.0 / (1.0 / winding + 1.0 / (2.0 * winding)) == pytest.approx(1.0)
    assert wye_from_delta(winding) == 0.5


@given(ra=POSITIVE, rb=POSITIVE, rc=POSITIVE)
def test_unbalanced_resistances(ra: float, rb: float, rc: float) -> None:
    """Round trip, and the delta of the same terminals read pair by pair."""
    lines = line_resistances_ohm(ra, rb, rc)
    assert phase_resistances_ohm(*lines) == pytest.approx(
        (ra, rb, rc), rel=1e-9, abs=1e-12 * max(ra, rb, rc)
    )
    ab, bc, ca = delta_windings_ohm(ra, rb, rc)
    assert 1.0 / (1.0 / ab + 1.0 / (bc + ca)) == pytest.approx(lines[0], rel=1e-9)
    assert 1.0 / (1.0 / bc + 1.0 / (ca + ab)) == pytest.approx(lines[1], rel=1e-9)
    assert 1.0 / (1.0 / ca + 1.0 / (ab + bc)) == pytest.approx(lines[2], rel=1e-9)


def test_copper_half_an_ohm_at_70_degc() -> None:
    assert float(copper_resistance_ohm(0.5, 70.0, 20.0)) == pytest.approx(0.598, abs=5e-4)
    by_coefficient = linear_resistance_ohm(0.5, 20.0, 70.0, 0.00393, 20.0)
    assert by_coefficient == pytest.approx(0.5 * (1.0 + 0.00393 * 50.0), rel=1e-12)
    many = copper_resistance_ohm(0.5, np.array([20.0, 70.0]), 20.0)
    assert many == pytest.approx([0.5, 0.5 * 304.5 / 254.5])


@given(r=POSITIVE, temp=st.floats(-60.0, 250.0), reference=st.floats(-60.0, 250.0))
def test_copper_forms_agree_and_invert(r: float, temp: float, reference: float) -> None:
    hot = float(copper_resistance_ohm(r, temp, reference))
    assert float(copper_resistance_ohm(hot, reference, temp)) == pytest.approx(r, rel=1e-12)
    assert copper_temperature_degc(hot, r, reference) == pytest.approx(temp, abs=1e-9)
    alpha = coefficient_at_1_k(COPPER_COEFFICIENT_25_1_K, 25.0, 80.0)
    linear = linear_resistance_ohm(r, reference, temp, alpha, 80.0)
    assert linear == pytest.approx(hot, rel=1e-9)


def test_copper_coefficient_at_20_and_25_degc() -> None:
    assert pytest.approx(0.003854, abs=5e-7) == COPPER_COEFFICIENT_25_1_K
    at_20 = coefficient_at_1_k(COPPER_COEFFICIENT_25_1_K, 25.0, 20.0)
    assert at_20 == pytest.approx(0.00393, abs=1e-6)


def _terminal_inductance_h(ld: float, lq: float, theta: float, pair: str) -> float:
    """Independent: unit current through two phases, flux in dq, and its linkage with the pair."""
    axes = {"a": 0.0, "b": 2.0 * math.pi / 3.0, "c": -2.0 * math.pi / 3.0}
    plus, minus = (cmath.exp(1j * axes[name]) for name in pair)
    current = 2.0 / 3.0 * (plus - minus) * cmath.exp(-1j * theta)
    flux = complex(ld * current.real, lq * current.imag) * cmath.exp(1j * theta)
    return (flux * plus.conjugate()).real - (flux * minus.conjugate()).real


@given(ld=POSITIVE, lq=POSITIVE, theta=ANGLE)
def test_terminal_inductance_of_each_pair(ld: float, lq: float, theta: float) -> None:
    for pair in ("ab", "bc", "ca"):
        expected = _terminal_inductance_h(ld, lq, theta, pair)
        got = float(terminal_inductance_h(ld, lq, theta, pair))
        assert got == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_terminal_inductance_at_the_axes() -> None:
    at = np.deg2rad([-30.0, 150.0, 60.0, 240.0])
    assert terminal_inductance_h(1.0, 3.0, at, "ab") == pytest.approx([2.0, 2.0, 6.0, 6.0])
    assert float(terminal_inductance_h(1.0, 3.0, 0.5 * math.pi, "bc")) == pytest.approx(2.0)


@given(low=st.floats(1e-5, 1.0), ratio=st.floats(1.01, 5.0), theta=st.floats(0.0, math.pi))
def test_three_pairs_at_an_unknown_angle(low: float, ratio: float, theta: float) -> None:
    read = [float(terminal_inductance_h(low, low * ratio, theta, p)) for p in ("ab", "bc", "ca")]
    found = unaligned_inductances_h(*read)
    assert found.low_h == pytest.approx(low, rel=1e-9)
    assert found.high_h == pytest.approx(low * ratio, rel=1e-9)
    off = (found.theta_low_rad - theta + math.pi / 2.0) % math.pi - math.pi / 2.0
    assert off == pytest.approx(0.0, abs=1e-6)
    mean = sum(read) / 3.0
    swing = math.sqrt(2.0 / 3.0 * sum((value - mean) ** 2 for value in read))
    assert found.high_h - found.low_h == pytest.approx(swing, rel=1e-6)


def test_saliency_words() -> None:
    assert saliency_words(3.6 / 1.8) == "interior magnets, salient"
    assert saliency_words(1.04) == "surface magnets, not salient"
    assert saliency_words(1.2, u=0.2) == "surface magnets, not salient"
    assert "exchanged" in saliency_words(0.5)


@pytest.mark.parametrize(
    ("electrical", "mechanical", "expected"),
    [(7.0, 1.0, 7), (-70.1, 10.0, 7), (7.03, 1.0, None), (0.01, 1.0, None), (50.0, 25.0, 2)],
)
def test_pole_pairs(electrical: float, mechanical: float, expected: int | None) -> None:
    found = pole_pairs_from(electrical, mechanical)
    assert found.number == expected
    assert found.ratio == pytest.approx(abs(electrical / mechanical))


@pytest.mark.parametrize(
    ("ratio", "label"),
    [
        (1.1547, "1.1547"),
        (1.4142, "1.4142"),
        (1.7321, "1.7321"),
        (1.2247, "1.2247"),
        (1.5, "1.5"),
        (2.0, "2"),
        (2.1213, "2.1213"),
        (1.1027, "1.1027"),
        (1.0472, "1.0472"),
        (6.2832, "2*pi"),
        (9.5493, "9.5493"),
        (11.0, "the pole pairs (11)"),
    ],
)
def test_a_ratio_on_a_magic_number_names_it(ratio: float, label: str) -> None:
    direct = convention_suspect(ratio, 0.004, "coupling", 11)
    inverse = convention_suspect(1.0 / ratio, 0.004 / ratio, "coupling", 11)
    assert direct is not None
    assert direct.startswith(f"{label}: ")
    assert inverse is not None
    assert inverse.startswith(f"1/{label}: ")


def test_a_power_of_voltages_by_the_wrong_full_modulation_names_it() -> None:
    """A drive's duty of Vdc/√3 that was taken of Vdc/2, or the other way."""
    named = convention_suspect(1.1532, 0.0057, "power", 4)
    assert named is not None
    assert named.startswith("1.1547: full modulation")


@pytest.mark.parametrize("ratio", [1.0, 1.005, 1.08, 0.85, 2.5, 4.0, -1.1547, math.nan, 0.0])
def test_other_ratios_name_nothing(ratio: float) -> None:
    assert convention_suspect(ratio, 0.002, "coupling", 7) is None


def test_an_uncertain_ratio_names_the_nearest_two() -> None:
    named = convention_suspect(1.12, 0.06, "coupling")
    assert named is not None
    assert [part.split(":")[0] for part in named.split(" or ")][:2] == ["1.1027", "1.1547"]


def test_nothing_outside_the_interval_is_named() -> None:
    """2 pi lies 0.317 below 6.6."""
    assert convention_suspect(6.6, 0.31, "coupling") is None
    assert convention_suspect(6.6, 0.32, "coupling") is not None


@pytest.mark.parametrize(
    ("ratio", "half_width"),
    [(0.968, 0.006), (1.037, 0.006), (1.0 / 1.0472 + 0.0061, 0.006), (0.8948, 0.0039)],
)
def test_told_as_1_0472_or_1_1027_though_the_interval_excluded_it(
    ratio: float, half_width: float
) -> None:
    """Published: 0.968 +- 0.006 told as 1/1.0472 = 0.955, and 1.037 +- 0.006 as 1.0472."""
    assert convention_suspect(ratio, half_width, "coupling", 7) is None


def test_told_as_torque_per_dc_ampere_though_no_torque_is_in_a_time_constant() -> None:
    """Published: tau over L/R 0.9026 +- 0.018, told as 1/1.1027 = 0.9069, which it does hold."""
    assert convention_suspect(0.9026, 0.018, "time_constant") is None
    assert convention_suspect(0.9026, 0.018, "coupling") is not None
    halved = convention_suspect(0.501, 0.01, "time_constant")
    assert halved == "1/2: line-line against phase impedance"
    assert convention_suspect(1.7321, 0.01, "impedance", 7) is None
    assert convention_suspect(7.0, 0.01, "power", 7) is not None
    assert convention_suspect(7.0, 0.01, "time_constant", 7) is None


def test_two_pole_pairs_are_ambiguous_with_two() -> None:
    named = convention_suspect(2.0, 0.001, "coupling", 2)
    assert named is not None
    assert "the pole pairs (2)" in named
    assert "poles against pole pairs" in named


def test_the_labels_are_their_numbers() -> None:
    assert all(convention.enters for convention in CONVENTIONS)
    for number, label, _, _ in CONVENTIONS:
        value = 2.0 * math.pi if label == "2*pi" else float(label)
        assert number == pytest.approx(value, abs=5e-5)


def test_copper_at_25_degrees() -> None:
    """1/259.5 = 0.003854 a kelvin; 0.500 ohm at 20 degC is 0.598 ohm at 70 (0.00393 at 20)."""
    assert pytest.approx(0.003854, abs=5e-7) == COPPER_COEFFICIENT_25_1_K
    at_20 = COPPER_COEFFICIENT_25_1_K / (1.0 - 5.0 * COPPER_COEFFICIENT_25_1_K)
    assert at_20 == pytest.approx(0.00393, abs=5e-6)


@pytest.mark.parametrize(
    ("ratio", "u", "word"),
    [
        (1.09, 0.0, "surface"),
        (1.11, 0.0, "interior"),
        (0.91, 0.0, "surface"),
        (0.89, 0.0, "exchanged"),
        (1.29, 0.15, "surface"),
        (1.31, 0.15, "interior"),
        (0.69, 0.15, "exchanged"),
    ],
)
def test_saliency_beyond_a_tenth_and_two_u(ratio: float, u: float, word: str) -> None:
    assert word in (saliency_words(ratio, u) if u else saliency_words(ratio))


@pytest.mark.parametrize(("off", "number"), [(0.0199, 7), (0.0201, None)])
def test_pole_pairs_within_two_hundredths(off: float, number: int | None) -> None:
    for count in (7.0 - off, 7.0 + off):
        assert pole_pairs_from(count * 10.0, 10.0).number == number
    assert pole_pairs_from(0.01, 10.0).number is None
    assert pole_pairs_from(-10.0, 10.0).number == 1
