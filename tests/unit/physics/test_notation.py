"""Rounding by uncertainty (GUM 7.2.6) and engineering notation, against worked cases."""

from __future__ import annotations

import math
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.physics.notation import MINUS, plain, quantity, reading, scale_for, significant

PREFIX = {"p": -12, "n": -9, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6}


@pytest.mark.parametrize(
    ("value", "u", "unit", "text"),
    [
        (100.02147, 0.000395, "W", "100.02147 ± 0.00079 W"),  # the numbers of GUM 7.2.4
        (0.31004, 0.00062, "ohm", "310.0 ± 1.2 mΩ"),
        (0.00021, 1.2e-6, "H", "210.0 ± 2.4 µH"),
        (0.0094, 9.96e-6, "Wb", "9.400 ± 0.020 mWb"),
        (4.4e-5, 2.2e-7, "kg·m²", "44.00 ± 0.44 ×10⁻⁶ kg·m²"),
        (0.003854, 0.00001, "1/K", "3.854 ± 0.020 ×10⁻³ K⁻¹"),
        (-0.0011, 0.00005, "1/K", "−1.10 ± 0.10 ×10⁻³ K⁻¹"),
        (304.04, 0.3, "rpm/V", "304.04 ± 0.60 rpm/V"),
        (10.0, 0.0, "1", "10"),
        (1.3809, 0.004, "1", "1.3809 ± 0.0080"),
        (0.141, 0.0, "N·m/A", "141.0 mN·m/A"),
        (999.96, 0.0, "V", "1.000 kV"),
        (0.0, 0.002, "N·m", "0.0 ± 4.0 mN·m"),
        (1e-9, 0.002, "N·m", "0.0 ± 4.0 mN·m"),
        (-1e-9, 0.002, "N·m", "0.0 ± 4.0 mN·m"),
        (12345.0, 40.0, "N·m", "12.345 ± 0.080 kN·m"),
        (25.0, 0.5, "degC", "25.0 ± 1.0 °C"),
        (1234567.0, 1e5, "1", "1.23 ± 0.20 ×10⁶"),
    ],
)
def test_worked_cases(value: float, u: float, unit: str, text: str) -> None:
    assert reading(value, u, unit).text() == text


@given(
    st.floats(1e-9, 1e6),
    st.floats(1e-6, 1.0),
    st.sampled_from(["ohm", "H", "N·m", "V·s/rad"]),
)
def test_what_is_shown_is_the_value_to_half_a_last_digit(
    value: float, relative: float, unit: str
) -> None:
    shown = reading(value, value * relative, unit)
    prefix = shown.unit[0] if shown.unit[0] in "pnµmkM" else ""
    factor = 10.0 ** PREFIX[prefix]
    expanded = Decimal(shown.expanded)
    last_digit = float(Decimal(1).scaleb(expanded.adjusted() - 1))
    assert abs(float(shown.value) * factor - value) <= 0.5001 * last_digit * factor
    assert len(expanded.normalize().as_tuple().digits) <= 2
    assert float(expanded) * factor == pytest.approx(2 * value * relative, rel=0.051)
    assert Decimal(shown.value).as_tuple().exponent == expanded.as_tuple().exponent


def test_one_scale_for_a_column_of_values() -> None:
    scale = scale_for(0.3, "ohm")
    assert reading(2.05, 0.01, "ohm", scale).text() == "2050 ± 20 mΩ"


def test_numbers_without_uncertainty() -> None:
    assert quantity(0.0123456, "V") == "12.35 mV"
    assert quantity(-0.5, "A", 2) == f"{MINUS}500 mA"
    assert quantity(math.nan, "A") == "–"
    assert significant(0.99996, 4) == "1.000"
    assert plain(-2.5) == f"{MINUS}2.5"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0, "V", "0 V"),
        (-12.0, "1", f"{MINUS}12"),
        (999_999.0, "1", "999999"),
        (1e6, "1", "1.000 ×10⁶"),
        (0.25, "1", "0.2500"),
        (1000.5, "kg·m²", "1000 kg·m²"),
        (12_345.6, "rad/s", "12.35 ×10³ rad/s"),
        (0.00099, "rad/s", "990.0 ×10⁻⁶ rad/s"),
        (0.001, "rad/s", "0.001000 rad/s"),
        (2.5e-15, "A", "0.002500 pA"),
        (3.5e9, "ohm", "3500 MΩ"),
        (1000.0001, "V", "1.000 kV"),
        (999.6, "V", "999.6 V"),
        (1e-3 + 1e-19, "H", "1.000 mH"),
    ],
)
def test_numbers_without_a_spread(value: float, unit: str, text: str) -> None:
    """Four digits, all digits of a whole number below a million, and prefixes from pico to mega."""
    assert reading(value, 0.0, unit).text() == text
    assert reading(value, math.inf, unit).text() == text


def test_digits_and_zeros() -> None:
    assert significant(0.0, 3) == "0"
    assert significant(math.inf, 3) == "–"
    assert significant(1234.5, 2) == "1200"
    assert significant(-0.00012349, 4) == f"{MINUS}0.0001235"
    assert (plain(1 / 3), plain(1e-7), plain(123456.7)) == ("0.333333", "1e-07", "123457")
    assert quantity(0.0, "A") == "0 A"
    assert quantity(1.0, "1") == "1.000"
