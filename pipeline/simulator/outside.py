"""Effects that are in no library, to test that an unknown is called unknown."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.simulator.design import Extra, Motor

Builder = Callable[[Motor, float], Motor]
POINTS = 65


def _with(motor: Motor, *extras: Extra) -> Motor:
    return replace(motor, extras=(*motor.extras, *extras))


def _term(
    variable: str, low: float, high: float, shape: Callable[[float], float], times: str = "one"
) -> Extra:
    x = np.linspace(low, high, POINTS)
    y = tuple(shape(float(value)) for value in x)
    return Extra("torque", variable, tuple(x.tolist()), y, times)


def _eddy_brake(motor: Motor, size: float) -> Motor:
    """Drag with a peak at a third of rated speed: -2 T u/(1 + u²)."""
    peak, torque = motor.speed_rated_rad_s / 3.0, 0.03 * size * motor.torque_rated_nm
    top = 1.2 * motor.speed_rated_rad_s

    def drag(omega: float) -> float:
        u = omega / peak
        return -2.0 * torque * u / (1.0 + u * u)

    return _with(motor, _term("omega_mech_rad_s", -top, top, drag))


def _tight_spot(motor: Motor, size: float) -> Motor:
    """Viscous drag that is there over a tenth of the turn only, as of a bent bearing seat."""
    worst = 0.06 * size * motor.torque_rated_nm / motor.speed_rated_rad_s

    def bump(theta: float) -> float:
        return -worst * math.exp(-(((theta - 2.2) / 0.3) ** 2))

    turn = 2.0 * math.pi
    return _with(motor, _term("theta_mech_rad", 0.0, turn, bump, "omega_mech_rad_s"))


def _warm_grease(motor: Motor, size: float) -> Motor:
    """Viscous drag that melts away as the winding warms."""
    cold = 0.03 * size * motor.torque_rated_nm / motor.speed_rated_rad_s

    def drag(degc: float) -> float:
        return -cold * math.exp(-(degc - 25.0) / 12.0)

    return _with(motor, _term("temp_winding_degc", 0.0, 120.0, drag, "omega_mech_rad_s"))


def _contact(motor: Motor, size: float) -> Motor:
    """A poor joint: a voltage along q that saturates with q current at half the rated."""
    volt, knee = 0.008 * size * motor.vdc_v, 0.5 * motor.current_rated_a

    def drop(i: float) -> float:
        return volt * (i / knee) / (1.0 + (i / knee) ** 2)

    span = 2.0 * motor.current_rated_a
    return _with(motor, replace(_term("iq_a", -span, span, drop), signal="vq"))


def _trapezoid(motor: Motor, size: float) -> Motor:
    """A flat-topped winding: back-EMF along d that is a triangle of 6 eps, with its torque."""
    flux = 0.03 * size * motor.pole_pairs * motor.psi_pm_wb
    x = tuple(np.linspace(0.0, 2.0 * math.pi, 2 * POINTS - 1).tolist())
    saw = tuple(flux * (4.0 * abs((3.0 * eps / math.pi) % 1.0 - 0.5) - 1.0) for eps in x)
    volt = Extra("vd", "theta_elec_rad", x, saw, times="omega_mech_rad_s")
    torque = Extra("torque", "theta_elec_rad", x, tuple(1.5 * y for y in saw), times="id_a")
    return _with(motor, volt, torque)


OUTSIDE: dict[str, Builder] = {
    "eddy_brake": _eddy_brake,
    "tight_spot": _tight_spot,
    "warm_grease": _warm_grease,
    "contact": _contact,
    "trapezoid": _trapezoid,
    "hot_spot": lambda motor, size: replace(motor, thermometer_share=1.0 - 0.3 * size),
}


def with_unknown(motor: Motor, name: str, size: float = 1.0) -> Motor:
    """The motor with an effect outside the library; size 1 is typical. ValueError if unknown.

    Parameters
    ----------
    motor
        The motor.
    name
        Name of the effect.
    size
        Size of the effect; 1 is typical.

    """
    builder = OUTSIDE.get(name)
    if builder is None:
        raise ValueError(f"nothing outside the library is called {name}: {', '.join(OUTSIDE)}")
    return builder(motor, size)
