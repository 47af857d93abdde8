"""Temperatures in kelvin, and honest ones that look odd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.validate import validate
from tests.faults.healthy import Motor, column, drive, heat_run, resistance, with_column
from tests.faults.verdicts import refused

MOTOR = Motor()


@pytest.mark.parametrize("ambient", [None, 25.0, -40.0, 125.0])
def test_one_column_in_kelvin(ambient: float | None, rng: np.random.Generator) -> None:
    """Refused by the column's name and rows, from a cold chamber to an oven; unit: K mends it."""
    capture = resistance(MOTOR, rng)
    capture = replace(capture, meta=replace(capture.meta, ambient_degc=ambient))
    winding = np.full(column(capture, "t_s").size, 25.0 if ambient is None else ambient)
    kelvin = with_column(capture, "temp_winding_degc", winding)
    assert validate(kelvin, {})[1] == ()
    error = refused(with_column(kelvin, "temp_winding_degc", winding + 273.15))
    assert error.code == "temperature_unit"
    assert "temp_winding_degc" in error.message
    assert "kelvin" in error.message
    assert error.rows == (0, winding.size - 1)
    assert "unit: K" in error.remedy


def test_only_the_magnet_in_kelvin(rng: np.random.Generator) -> None:
    """Refused, though all other temperatures are right; the magnet alone is named."""
    capture = drive(MOTOR, rng)
    capture = replace(capture, meta=replace(capture.meta, ambient_degc=23.0))
    size = column(capture, "t_s").size
    right = with_column(capture, "temp_winding_degc", np.full(size, 30.0))
    right = with_column(right, "temp_magnet_degc", np.full(size, 28.0))
    assert validate(right, {})[1] == ()
    error = refused(with_column(right, "temp_magnet_degc", np.full(size, 28.0 + 273.15)))
    assert error.code == "temperature_unit"
    assert "temp_magnet_degc" in error.message
    assert "temp_winding_degc" not in error.message


@pytest.mark.parametrize(
    ("ambient", "coldest", "rise"),
    [
        (23.0, 160.0, 40.0),
        (None, 180.0, 50.0),
        (-40.0, -40.0, 10.0),
        (200.0, 230.0, 60.0),
        (200.0, 290.0, 40.0),
        (23.0, 23.0, 240.0),
        (23.0, -30.0, 10.0),
    ],
    ids=["hot", "hot, no ambient", "cold", "oven", "hot oven", "overheats", "below its ambient"],
)
def test_honest_temperatures_are_let_through(
    ambient: float | None, coldest: float, rise: float, rng: np.random.Generator
) -> None:
    """Hot starts, ovens, cold chambers and a stale ambient are no kelvin."""
    capture = heat_run(MOTOR, rng)
    capture = replace(capture, meta=replace(capture.meta, ambient_degc=ambient))
    ramp = np.linspace(coldest, coldest + rise, column(capture, "t_s").size)
    assert validate(with_column(capture, "temp_winding_degc", ramp), {})[1] == ()
