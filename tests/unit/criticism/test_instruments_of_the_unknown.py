"""What no effect explains may be an instrument: a loose encoder, a transducer with a past."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.hysteresis import play_lag
from pipeline.criticism.discovery.unknown_structure import unknown_structure
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from tests.unit.criticism.machines import log, machine

P, TORQUE = 7, "torque_shaft_nm"


def logs(made):
    """Four logs, each as `made` of one with noise."""
    plain = (replace(log(seed=n, noise=1.0), capture=f"log_{n}") for n in range(4))
    return tuple(made(one) for one in plain)


def sketch(segments, *signals):
    system = first_fit(rough_fit(segments, Model(machine(), ())))
    return unknown_structure(system, signals)[0]


def loose(size_rad, of):
    """A log in a frame that an electrical angle turns which goes by the sign of something."""

    def made(segment):
        s = dict(segment.recorded)
        error = size_rad * np.sign(of(s))
        turn = np.exp(-1j * error)
        current, volts = (s["id_a"] + 1j * s["iq_a"]) * turn, (s["vd_v"] + 1j * s["vq_v"]) * turn
        s |= {"id_a": current.real, "iq_a": current.imag, "vd_v": volts.real, "vq_v": volts.imag}
        s["theta_mech_rad"] = s["theta_mech_rad"] + error / P
        return replace(segment, recorded=s)

    return made


def speed(signals):
    return np.convolve(np.gradient(signals["theta_mech_rad"]), np.full(101, 1 / 101), mode="same")


@pytest.mark.slow
def test_a_loose_encoder_is_an_angle_error_that_goes_by_the_direction():
    found = sketch(logs(loose(0.01, speed)), "vd_v", "vq_v", TORQUE)
    assert found is not None
    assert found.variables == ("omega_mech_rad_s",)
    assert "direction of rotation, like an angle error of ±" in found.shape
    size = float(found.shape.split("±")[1].split(" mrad")[0])
    assert size == pytest.approx(10.0, rel=0.05)
    assert "{'angle'" not in found.source
    assert "    angle=_value," in found.source


def test_a_transducer_that_remembers_is_a_curve_of_its_past():
    def made(segment):
        s = dict(segment.recorded)
        past = play_lag(s[TORQUE], 0.25)
        s["behind_nm"] = past
        s[TORQUE] = s[TORQUE] - 0.1 * past
        return replace(segment, recorded=s)

    found = sketch(logs(made), TORQUE)
    assert found is not None
    assert found.variables == (TORQUE,)
    assert "transducer (hysteresis)" in found.shape


def test_the_past_of_a_torque_is_half_a_play_to_the_side_it_came_from():
    up = np.linspace(0.0, 4.0, 50)
    there_and_back = np.concatenate([up, up[::-1]])
    past = play_lag(there_and_back, 0.25)
    assert past[0] == 0.0
    assert past[49] == pytest.approx(1.0)
    assert past[-1] == pytest.approx(-1.0)
    assert np.abs(past).max() <= 1.0 + 1e-12
