"""A constant that changed between captures is told as that, with its size and the captures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import base_fit
from pipeline.criticism.discovery.changed_constants import by_words, changed_constant
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, log, machine

P = 7


def captures(changed, **by):
    """Five logs; in the `changed` ones constants are others by a share, `psi_wb=-0.04`."""
    made = []
    for n in range(5):
        one = replace(log(seed=n, noise=1.0), capture=f"log_{n}")
        made.append(_moved(one, **by) if n in changed else one)
    return tuple(made)


def _moved(segment, psi_wb=0.0, r_ohm=0.0, b_nm_s_rad=0.0):
    s = dict(segment.recorded)
    omega = np.gradient(s["theta_mech_rad"], segment.ts_s)
    flux, drop = psi_wb * BASE["psi_wb"], r_ohm * BASE["r_ohm"]
    s["vq_v"] = s["vq_v"] + P * omega * flux + drop * s["iq_a"]
    s["vd_v"] = s["vd_v"] + drop * s["id_a"]
    drag = b_nm_s_rad * BASE["b_nm_s_rad"] * omega
    s["torque_shaft_nm"] = s["torque_shaft_nm"] + 1.5 * P * flux * s["iq_a"] - drag
    return replace(segment, recorded=s)


def change(segments):
    return changed_constant(first_fit(rough_fit(segments, Model(machine(), ()))))


@pytest.mark.parametrize(
    ("name", "share", "changed"),
    [
        pytest.param("psi_wb", -0.04, (3, 4), marks=pytest.mark.slow),
        pytest.param("psi_wb", 0.02, (1,), marks=pytest.mark.slow),
        pytest.param("r_ohm", 0.07, (0, 2), marks=pytest.mark.slow),
        ("b_nm_s_rad", 4.0, (2,)),
    ],
)
def test_the_constant_its_size_and_the_captures_are_told(name, share, changed):
    found = change(captures(changed, **{name: share}))
    assert found is not None
    assert found.name == name
    assert found.captures == tuple(f"log_{n}" for n in changed)
    assert found.difference == pytest.approx(share * BASE[name], rel=0.05)
    assert abs(found.difference - share * BASE[name]) < 4.0 * found.u
    assert ("only one capture" in found.words) == (len(changed) == 1)
    assert ("higher" if share > 0.0 else "lower") in found.words


def test_an_encoder_that_was_mounted_again_has_another_zero():
    """Currents and voltages are then turned by it: no constant of the machine says that."""
    segments = list(captures(()))
    for n in (1, 4):
        turned = dict(segments[n].recorded)
        for kind, unit in (("i", "a"), ("v", "v")):
            names = f"{kind}d_{unit}", f"{kind}q_{unit}"
            vector = (turned[names[0]] + 1j * turned[names[1]]) * np.exp(-0.03j)
            turned |= dict(zip(names, (vector.real, vector.imag), strict=True))
        segments[n] = replace(segments[n], recorded=turned)
    found = change(tuple(segments))
    assert found is not None
    assert found.name == "zero_angle_rad"
    assert found.captures == ("log_1", "log_4")
    assert found.difference == pytest.approx(0.03, rel=0.05)


@pytest.mark.slow
def test_a_large_change_is_that_of_a_fit_of_either_part():
    """A disc that doubles the inertia was told as half of it: acceleration goes with 1/J."""
    sound = replace(design("servo-ipm"), effects={})
    heavy = replace(sound, j_rotor_kgm2=2.0 * sound.j_rotor_kgm2)
    recordings = [
        replace(one, stem=f"log_{n}")
        for n, motor in enumerate((sound, sound, sound, heavy))
        for one in campaign(motor, Bench(), n, (("drive", "drive", {"load": 0.0}),))
    ]
    whole = campaign_of(recordings)
    free = [
        replace(c, tables=tuple(t.drop("torque_shaft_nm", strict=False) for t in c.tables))
        for c in whole.captures
    ]
    base = base_fit(replace(whole, captures=tuple(free)), ModelSpec(), Constants())
    found = changed_constant(base.system)
    assert (found.name, found.captures) == ("j_kgm2", ("log_3.mcap",))
    assert found.difference == pytest.approx(sound.j_rotor_kgm2, rel=0.05)
    assert abs(found.difference - sound.j_rotor_kgm2) < 3.0 * found.u


def test_captures_that_agree_have_none():
    assert change(captures(())) is None


def test_of_two_captures_that_disagree_nobody_knows_which_is_odd():
    assert change(captures((1,), psi_wb=-0.04)[:2]) is None


@pytest.mark.slow
def test_an_effect_that_every_capture_has_is_no_change():
    """A drag that bends with speed, five times: no cut between captures takes most of it."""
    bent = []
    for segment in captures(()):
        s = dict(segment.recorded)
        omega = np.gradient(s["theta_mech_rad"], segment.ts_s)
        s["torque_shaft_nm"] = s["torque_shaft_nm"] - 0.02 * omega / (1.0 + (omega / 20.0) ** 2)
        bent.append(replace(segment, recorded=s))
    assert change(tuple(bent)) is None


def test_a_change_of_what_is_next_to_none_has_no_share() -> None:
    """A wave of the back-EMF was said to be 290,000 % lower."""
    assert by_words(1e-6, 0.3, 0.01, "Wb").startswith("higher (by ")
    assert by_words(0.6, 0.3, 0.01, "Wb").startswith("50 % higher (by ")
