"""The closed table of foreign units against worked values."""

from __future__ import annotations

import math

import pytest

from pipeline.io.maps.units import FOREIGN_UNITS, scale_of, scale_to
from pipeline.physics.glossary import COLUMNS
from pipeline.records.errors import CaptureError


@pytest.mark.parametrize(
    ("value", "unit", "target", "expected"),
    [
        (1000.0, "rpm", "rad/s", 104.71975511965978),
        (1.0, "kRPM", "rad/s", 104.71975511965978),
        (180.0, "deg", "rad", math.pi),
        (0.5, "rev", "rad", math.pi),
        (2.0, "turns/s", "rad/s", 4 * math.pi),
        (math.pi, "rad", "deg", 180.0),
        (250.0, "mA", "A", 0.25),
        (3.0, "(mV)", "V", 0.003),
        (5.0, "µs", "s", 5e-6),
        (5.0, "μs", "s", 5e-6),
        (20.0, "ms", "s", 0.02),
        (1500.0, "Nmm", "N·m", 1.5),
        (1.0, "ozf·in", "N·m", 0.00706155181422604),
        (1.0, "lbf·ft", "N·m", 1.3558179483314004),
        (1.0, "kgcm", "N·m", 0.0980665),
        (300.0, "K", "degC", 26.85),
        (212.0, "°F", "degC", 100.0),
        (2.5, "mWb", "Wb", 0.0025),
        (320.0, "uH", "H", 3.2e-4),
        (45.0, "mΩ", "ohm", 0.045),
        (1.0, "kHz", "Hz", 1000.0),
        (50.0, "percent", "V", 0.5),
        (10.0, "(Arms)", "A", 14.142135623730951),
        (230.0, "V rms", "V", 325.2691193458119),
    ],
)
def test_units_convert_to_the_value_in_the_tables(
    value: float, unit: str, target: str, expected: float
) -> None:
    scale = scale_to(unit, target)
    assert value * scale.factor + scale.shift == pytest.approx(expected, rel=1e-14)


def test_every_column_unit_has_its_row_and_is_itself_in_it() -> None:
    for term in COLUMNS.values():
        assert FOREIGN_UNITS[term.unit][term.unit].factor == 1.0, term.name


@pytest.mark.parametrize(
    ("unit", "target"), [("furlong", "rad"), ("V", "A"), ("", "s"), ("MS", "s")]
)
def test_anything_else_is_an_unknown_unit_with_the_known_ones(unit: str, target: str) -> None:
    with pytest.raises(CaptureError) as refused:
        scale_to(unit, target)
    assert refused.value.code == "unknown_unit"
    assert target in refused.value.remedy


def test_a_wave_is_in_no_rms() -> None:
    assert scale_of("Arms", "iq_a").factor == pytest.approx(math.sqrt(2.0))
    for column in ("ia_a", "vab_v"):
        with pytest.raises(CaptureError, match="is a wave"):
            scale_of("A rms" if column == "ia_a" else "Vrms", column)
