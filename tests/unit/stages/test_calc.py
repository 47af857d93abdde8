"""Calculators: worked cases, both directions, contradictions, units."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.records.errors import UsageError
from pipeline.stages.calc import KINDS, answered

POSITIVE = st.floats(1e-5, 1e4)


def answers(line: str) -> dict[str, float]:
    """The printed answers of one command line, by name."""
    kind, *words = line.split()
    text = answered(kind, dict(word.split("=", 1) for word in words))[0]
    rows = re.findall(r"^  (\S.*?) += (\S+)", text, flags=re.MULTILINE)
    return {name: float(value) for name, value in rows}


def refusal(line: str) -> str:
    with pytest.raises(UsageError) as caught:
        answers(line)
    assert caught.value.exit_code == 2
    return str(caught.value)


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("wye-delta r_ll=1.000 winding=wye", "r_phase_ohm", 0.5),
        ("wye-delta r_ll=1.000 winding=delta", "r_phase_ohm", 0.5),
        ("wye-delta r_ll=1.000 winding=delta", "r_delta_ohm", 1.5),
        ("copper r=0.500 from=20 to=70 alpha=0.00393 alpha_at=20", "r_ohm", 0.598),
        ("copper r=0.500 from=20 to=70", "r_ohm", 0.598),
        ("ke-kt ke=0.1", "kt_nm_a", 0.1),
        ("ke-kt ke=0.1", "ke_v_krpm", 10.47),
        ("ke-kt v=4.0,8.0 omega=100,200", "ke_v_s_rad", 0.040),
        ("grip kt=0.020 torque=0.010", "current_a", 0.5),
        ("grip kt=0.020 torque=0.020", "current_a", 1.0),
        ("saliency l_pole_axis=1.8mH l_quadrature=3.6mH", "saliency_ratio", 2.0),
        ("saliency l_pole_axis=1.8mH l_quadrature=3.6mH", "lq_h", 3.6e-3),
        ("pole-pairs cycles=7 speed_ratio=7", "pole_pairs", 7),
        ("pole-pairs cycles=7 speed_ratio=7", "poles", 14),
        ("pole-pairs cycles=7 speed_ratio=7", "told", 1),
        ("kv kv=304 pole_pairs=7", "psi_pm_wb", 2.5908e-3),
        ("kv kv=304", "kt_peak_nm_a", 8.27 / 304),
        ("kv kv=304", "kt_dc_nm_a", 9.549 / 304),
        ("kv kv=304", "kv_six_step_rpm_v", 318.3),
    ],
)
def test_worked_cases(line: str, name: str, value: float) -> None:
    assert answers(line)[name] == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("wye-delta r_phase=0.5", "r_ll_ohm", 1.0),
        ("wye-delta r_delta=1.5", "r_ll_ohm", 1.0),
        ("wye-delta l_delta=3mH", "l_phase_h", 1e-3),
        ("wye-delta r_a=0.45 r_b=0.55 r_c=0.65", "r_bc_ohm", 1.2),
        ("wye-delta r_ab=1 r_bc=1.2 r_ca=1.1", "r_a_ohm", 0.45),
        ("copper r=0.5 from=20 r_hot=0.598232", "to_degc", 70.0),
        ("copper r=0.5 from=20 r_hot=0.59825 to=70", "alpha_1_k", 0.00393),
        ("copper alpha=0.003854 alpha_at=25 to=20", "alpha_1_k", 0.00393),
        ("ke-kt kt=0.1", "ke_v_s_rad", 0.1),
        ("ke-kt ke=0.031412 reading=ll_peak", "kt_peak_nm_a", 0.027204),
        ("ke-kt ke=0.022212 reading=ll_rms", "kt_peak_nm_a", 0.027204),
        ("ke-kt v=4,8 omega=100,200 reading=phase_peak", "kt_peak_nm_a", 0.06),
        ("ke-kt kt_rms=0.038472 r_phase=0.5", "motor_constant_nm_sqrt_w", 0.031413),
        ("ke-kt psi=2.5908mWb p=7", "kv_ll_peak_rpm_v", 304.0),
        ("kv kt_peak=0.027204", "kv_ll_peak_rpm_v", 304.0),
        ("kv kv=318.348 reading=six_step", "kv_ll_peak_rpm_v", 304.0),
        ("kv v=10 speed=3040rpm", "kv_ll_peak_rpm_v", 304.0),
        ("kv kv=304 v=10", "speed_rpm", 3040.0),
        ("kv kv=304 speed=3040rpm", "v_v", 10.0),
        ("kv kv=100 reading=dc", "kt_nm_a", 0.095493),
        ("grip kt=0.02 current=0.5", "torque_nm", 0.01),
        ("grip torque=0.01 current=0.5", "kt_nm_a", 0.02),
        ("grip kt=0.02 torque=0.01 current=0.5", "kt_nm_a", 0.02),
        ("pole-pairs poles=14 told=1", "speed_ratio", 7.0),
        ("pole-pairs told=1 speed_ratio=7.01", "pole_pairs", 7),
        ("pole-pairs f_elec=70 f_mech=600rpm", "pole_pairs", 7),
        ("pole-pairs cycles=21 turns=3", "pole_pairs", 7),
        ("saliency ld=1mH ratio=1.5", "lq_h", 1.5e-3),
        ("saliency lq=1.5mH ratio=1.5", "ld_h", 1e-3),
        ("saliency ld=1mH lq=3mH theta=-30", "lab_h", 2e-3),
        ("saliency lab=2mH lbc=5mH lca=5mH", "l_low_h", 1e-3),
        ("saliency lab=2mH lbc=5mH lca=5mH", "theta_low_deg", 150.0),
    ],
)
def test_other_directions(line: str, name: str, value: float) -> None:
    assert answers(line)[name] == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize(
    ("line", "least"), [("kv kv=304 pole_pairs=0", "above 0"), ("kv kv=-1", "above 0 rpm/V")]
)
def test_the_least_value_is_named_with_its_unit(line: str, least: str) -> None:
    """A count has no unit: `1` is none, and read as part of the number."""
    assert refusal(line).endswith(f"it must be {least}")


@pytest.mark.parametrize("line", ["lab=2mH lbc=2mH lca=2mH", "lab=2mH lbc=2.001mH lca=2mH"])
def test_equal_inductances_have_no_low_axis(line: str) -> None:
    """Neither exactly equal ones nor those that a bridge reads as equal."""
    found = answers(f"saliency {line}")
    assert found["saliency_ratio"] == pytest.approx(1.0, abs=1e-3)
    assert "theta_low_deg" not in found
    assert "theta_low_deg" in answers("saliency lab=2mH lbc=2.01mH lca=2mH")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("wye-delta r_ll=1 r_phase=1", "contradict each other (ratio 2.0000"),
        ("ke-kt ke_ll_peak=0.0314 kt_peak=0.0314", "1.1547"),
        ("ke-kt ke=0.1 kt=0.0866", "contradict"),
        ("ke-kt ke=0.1 kt_peak=0.15", "does not say its convention"),
        ("ke-kt ke=0.1 kt=0.1 reading=ll_peak", "kt_nm_a is DC-equivalent"),
        ("ke-kt v=4,8 omega=100", "2 voltages and 1 speeds"),
        ("ke-kt pole_pairs=7", "nothing to work out"),
        ("copper r=0.5 from=20 to=70 alpha=0.00393", "temperature it is referred to"),
        ("copper r=0.5 from=20", "nothing to work out"),
        ("copper r=0.5 from=20 to=-300", "above -234.5"),
        ("grip kt=0.02", "two of kt, torque and current"),
        ("grip kt=0.02 torque=0.01 current=0.25", "on 2:"),
        ("grip kt=-0.02 torque=0.01", "above 0"),
        ("grip kt=nan torque=0.01", "no number"),
        ("grip kt=0.02V torque=0.01", "no number of N·m/A"),
        ("grip kt=1,2 torque=0.01", "is a list"),
        ("grip kt=1 kt_nm_a=1 torque=0.01", "given twice"),
        ("grip torqeu=1 kt=1", "did you mean torque=?"),
        ("pole-pairs cycles=6.5", "not within 0.02 of a whole number"),
        ("pole-pairs cycles=7 poles=12", "contradict"),
        ("saliency ld=1mH", "two of ld, lq and ratio"),
        ("saliency ld=1mH lq=2mH ratio=3", "contradict"),
        ("saliency lab=1mH lbc=9mH lca=1mH", "no three-phase winding"),
        ("wye-delta r_ab=1 r_bc=5 r_ca=1", "exceed the sum"),
        ("wye-delta r_ab=1 r_bc=1", "nothing to work out"),
        ("wye-delta r_ll=1 winding=star", "one of wye, delta"),
        ("dance x=1", "known are wye-delta"),
    ],
)
def test_refusals_say_what_is_wrong(line: str, said: str) -> None:
    assert said in refusal(line)


@pytest.mark.parametrize(
    ("typed", "henry"),
    [("0.0018", 1.8e-3), ("1.8mH", 1.8e-3), ("1800µH", 1.8e-3), ("1.8e-3H", 1.8e-3)],
)
def test_units_and_multiples(typed: str, henry: float) -> None:
    assert answers(f"saliency ld={typed} lq=3.6mH")["ld_h"] == pytest.approx(henry)


def test_volts_per_thousand_rpm_where_volt_seconds_are_asked() -> None:
    direct = answers("ke-kt ke_ll_peak_v_krpm=3.289")
    assert answers("ke-kt ke_ll_peak=3.289V/krpm") == pytest.approx(direct)


@given(r=POSITIVE)
def test_wye_delta_round_trip(r: float) -> None:
    delta = answers(f"wye-delta r_ll={r!r}")["r_delta_ohm"]
    assert answers(f"wye-delta r_delta={delta!r}")["r_ll_ohm"] == pytest.approx(r, rel=1e-4)


@given(kv=st.floats(1.0, 1e4), reading=st.sampled_from(["ll_peak", "six_step"]))
def test_kv_round_trip(kv: float, reading: str) -> None:
    kt = answers(f"kv kv={kv!r} reading={reading}")["kt_rms_nm_a"]
    back = answers(f"kv kt_rms={kt!r}")[f"kv_{reading}_rpm_v"]
    assert back == pytest.approx(kv, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_lists_its_keys(kind: str) -> None:
    text = answered(kind, {})[0]
    for name in KINDS[kind].shown_names():
        assert re.search(rf"^  {name} ", text, flags=re.MULTILINE)
    assert kind in answered("", {})[0]


def test_short_names_mean_one_key() -> None:
    for kind, calculator in KINDS.items():
        shown = calculator.shown_names()
        assert len(shown) == len(calculator.keys), kind
        for name, key in shown.items():
            assert calculator.index()[name] is key


def test_the_answer_names_formula_and_convention() -> None:
    text = answered("copper", {"r": "0.5", "from": "20", "to": "70"})[0]
    assert "R0·(234.5 + T)/(234.5 + T0)" in text
    assert "convention: annealed copper" in text
    assert "DC-equivalent" in answered("ke-kt", {"ke": "0.1"})[0]
    assert "wye equivalent" in answered("wye-delta", {"r_ll": "1"})[0]
    assert math.isclose(
        0.5 * 304.5 / 254.5, answers("copper r=0.5 from=20 to=70")["r_ohm"], rel_tol=1e-5
    )
