"""The numbers of a motor datasheet, derived from constants at stated conditions, with intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipeline.records.plain_form import PlainRecord, plain_fields

Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Operation(PlainRecord):
    """The conditions that a motor is operated at.

    Attributes
    ----------
    vdc_v
        Voltage of the DC link [V].
    current_a
        Largest current, phase peak [A].
    temp_winding_degc, temp_magnet_degc, temp_ambient_degc
        Temperatures of operation [degC].
    temp_limit_degc
        Highest temperature of the winding [degC].
    voltage_share
        What the inverter uses of vdc/√3 [1].
    drop_v, on_ohm
        What one conducting device of the inverter drops [V, ohm]; None where not known.
    origin
        Where each condition comes from, by name.

    """

    vdc_v: float
    current_a: float
    temp_winding_degc: float
    temp_magnet_degc: float
    temp_ambient_degc: float
    temp_limit_degc: float
    voltage_share: float = 1.0
    drop_v: float | None = None
    on_ohm: float | None = None
    origin: Mapping[str, str] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, slots=True)
class Derived(PlainRecord):
    """One number of a motor's datasheet.

    Attributes
    ----------
    name, words, unit
        Name, meaning, and unit.
    value, low, high
        Value and ends of its 95 % interval [unit].
    formula
        How it follows from the constants.
    convention
        What in it is a convention and no property of the motor.

    """

    name: str
    words: str
    unit: str
    value: float
    low: float
    high: float
    formula: str = field(repr=False)
    convention: str = field(default="", repr=False)


@dataclass(frozen=True, slots=True)
class Blank(PlainRecord):
    """A number that the captures do not give: why, and the test that would."""

    name: str
    words: str
    why: str
    test: str


@dataclass(frozen=True, slots=True)
class Curve(PlainRecord):
    """Values over one variable, with their 95 % intervals.

    Attributes
    ----------
    name, words, unit
        Name, meaning, and unit of the values.
    x_name
        Name of the variable; its unit is the last part.
    x, value, low, high
        [n] each.

    """

    name: str
    words: str
    unit: str
    x_name: str
    x: Numbers
    value: Numbers
    low: Numbers
    high: Numbers


@dataclass(frozen=True, slots=True)
class MapCell(PlainRecord):
    """One operating point of the efficiency map.

    Attributes
    ----------
    omega_mech_rad_s, torque_shaft_nm
        The point [rad/s, N·m].
    id_a, iq_a
        The currents that give it with the least copper loss [A, phase peak].
    copper_w, rotation_w, inverter_w
        Losses [W]; None for an inverter that is not known.
    efficiency, low, high
        Efficiency and its 95 % interval [1].

    """

    omega_mech_rad_s: float
    torque_shaft_nm: float
    id_a: float
    iq_a: float
    copper_w: float
    rotation_w: float
    inverter_w: float | None
    efficiency: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Performance:
    """What a motor does at some conditions: numbers, curves, a map, and what cannot be known.

    `operation` is None where the conditions themselves are not known.
    """

    motor_id: str
    version: str
    operation: Operation | None
    numbers: tuple[Derived, ...] = ()
    curves: tuple[Curve, ...] = field(default=(), repr=False)
    cells: tuple[MapCell, ...] = field(default=(), repr=False)
    regimes: tuple[str, ...] = ()
    blanks: tuple[Blank, ...] = ()
    notes: tuple[str, ...] = ()

    def number(self, name: str) -> Derived | None:
        """A number by name, None where it is blank.

        Parameters
        ----------
        name
            Of the number.

        Returns
        -------
        Derived or None
            None where the captures do not give it.

        """
        return next((one for one in self.numbers if one.name == name), None)

    def curve(self, name: str) -> Curve | None:
        """A curve by name, None where it is blank.

        Parameters
        ----------
        name
            Of the curve.

        Returns
        -------
        Curve or None
            None where the captures do not give it.

        """
        return next((one for one in self.curves if one.name == name), None)

    def document(self) -> dict[str, Any]:
        """The JSON form, schema motor-performance/1."""
        names = {"version": "datasheet_version", "cells": "efficiency_map"}
        written = {names.get(name, name): one for name, one in plain_fields(self).items()}
        return {"schema": "motor-performance/1"} | written
