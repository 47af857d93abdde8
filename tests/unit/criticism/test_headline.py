"""Effects in words: the size of a vector, a share in percent, and every effect of the library."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.effects.angle_eccentricity import EFFECT as ECCENTRIC
from pipeline.criticism.effects.cogging import EFFECT as COGGING
from pipeline.criticism.effects.phase_imbalance import EFFECT as IMBALANCE
from pipeline.criticism.library.headline import (
    UNKNOWN_SIZE,
    amplitude,
    headline,
    largest_difference,
)
from pipeline.criticism.library.registry import effects
from pipeline.criticism.parameter import SCALES as SCALED
from pipeline.criticism.parameter import Machine
from pipeline.records.diagnosis import ReportedParameter

SCALES = dict.fromkeys(SCALED, 2.0)
MACHINE = Machine(7, 12, SCALES, torque_orders=(84,))


def test_an_amplitude_is_the_length_of_its_vector() -> None:
    reported = {
        "sine_rad": ReportedParameter(0.0072, 2e-5, "rad"),
        "cosine_rad": ReportedParameter(0.0054, 2e-5, "rad"),
    }
    words = headline(ECCENTRIC, reported)
    assert words == "encoder disc off-centre by 9.000 ± 0.040 mrad"
    value, u, _ = amplitude([ReportedParameter(3.0, 0.1, "V"), ReportedParameter(4.0, 0.2, "V")])
    assert value == pytest.approx(5.0)
    assert u == pytest.approx(math.hypot(0.6 * 0.1, 0.8 * 0.2))
    assert amplitude([ReportedParameter(-3.0, 0.1, "V")]) == ReportedParameter(-3.0, 0.1, "V")


def test_of_two_parts_the_clearer_one_is_told() -> None:
    """An angle off twice a turn was told as a disc off-centre by 1.2 ± 8.2 µrad."""
    reported = {
        "sine_rad": ReportedParameter(1e-6, 4e-6, "rad"),
        "cosine_rad": ReportedParameter(-1e-6, 4e-6, "rad"),
        "sine2_rad": ReportedParameter(0.0012, 5e-6, "rad"),
        "cosine2_rad": ReportedParameter(-0.0009, 5e-6, "rad"),
    }
    words = "encoder's angle off twice a turn, by 1.500 ± 0.010 mrad"
    assert headline(ECCENTRIC, reported) == words
    reported["sine_rad"] = ReportedParameter(0.009, 4e-6, "rad")
    assert headline(ECCENTRIC, reported).startswith("encoder disc off-centre by 9.00")


def test_the_largest_wave_is_told_with_its_order() -> None:
    reported = {
        "sin_84_nm": ReportedParameter(0.003, 1e-5, "N·m"),
        "cos_84_nm": ReportedParameter(-0.004, 1e-5, "N·m"),
        "sin_12_nm": ReportedParameter(0.001, 1e-5, "N·m"),
        "cos_12_nm": ReportedParameter(0.0, 1e-5, "N·m"),
    }
    assert headline(COGGING, reported) == "cogging torque of 5.000 ± 0.020 mN·m, 84 a turn"


def test_what_is_not_determined_is_of_unknown_size() -> None:
    reported = {
        "sine_rad": ReportedParameter(0.0072, 2e-5, "rad"),
        "cosine_rad": ReportedParameter(None, None, "rad"),
    }
    assert headline(ECCENTRIC, reported).endswith(UNKNOWN_SIZE)
    assert headline(COGGING, {}).endswith(UNKNOWN_SIZE)


def test_an_effect_without_words_tells_its_name_and_its_numbers() -> None:
    own = replace(COGGING, name="seal_drag", headline="")
    assert headline(own, {"torque_nm": ReportedParameter(0.01, 1e-4, "N·m")}) == (
        "seal_drag (torque_nm 10.00 ± 0.20 mN·m)"
    )
    assert headline(own, {}) == "seal_drag"


@pytest.mark.parametrize("name", sorted(effects()))
def test_every_effect_names_parameters_that_it_has(name: str) -> None:
    effect = effects()[name]
    reported = {p.name: ReportedParameter(0.02, 1e-4, p.unit) for p in effect.every(MACHINE)}
    words = headline(effect, reported)
    assert effect.headline and UNKNOWN_SIZE not in words
    assert "{" not in words


@pytest.mark.parametrize("name", sorted(effects()))
def test_whatever_makes_an_effect_large_is_said(name: str) -> None:
    """No size that is nothing beside its u is reported of an effect that is surely there."""
    effect = effects()[name]
    amplitudes = [p for p in effect.every(MACHINE) if p.amplitude and p.negligible > 0.0]
    # of a coupling the twist or gap must be sure as well, and is said
    for large in amplitudes if effect.discriminator is None else ():
        reported = {
            p.name: ReportedParameter(0.02 if p.name == large.name else 1e-5, 1e-4, p.unit)
            for p in effect.every(MACHINE)
        }
        said = re.findall(r"([\d.]+) ± ([\d.]+)", headline(effect, reported))
        clear = [float(size) > 10.0 * float(u) for size, u in said]
        assert any(clear) or not said, (large.name, said)


@pytest.mark.parametrize("bad", range(3))
def test_phases_differ_by_the_largest_less_the_smallest(bad: int) -> None:
    """One phase 7 % above, two 3.5 % below the mean, whichever it is: 10.5 %, as a meter has it."""
    gamma = 0.035 * np.exp(4j * np.pi * bad / 3.0)
    parts = (ReportedParameter(gamma.real, 1e-4, "1"), ReportedParameter(gamma.imag, 1e-4, "1"))
    value, u, _ = largest_difference(*parts)
    assert value == pytest.approx(0.105)
    assert u == pytest.approx(1e-4 * math.sqrt(12.0), rel=1e-6)
    words = headline(IMBALANCE, dict(zip(("cosine", "sine"), parts, strict=True)))
    assert words.startswith("phase resistances that differ, by up to 10.5")
