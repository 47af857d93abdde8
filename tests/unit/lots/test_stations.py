"""Biases of stations by hand: two and three stations, what links them, and with which u."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.lots.stations import Correction, Reading, station_correction


def test_two_stations_share_their_difference() -> None:
    """Golden motors read 0.2 and 0.4 higher on B: B is 0.3 up in the mean, half of it each way.

    The variance of the difference is (1 + 1 + 1 + 1)/4 of each motor's, of a bias a quarter of it.
    """
    readings = [
        Reading("m1", "A", 5.0, 0.5),
        Reading("m1", "B", 5.2, 0.5),
        Reading("m2", "A", 9.0, 0.5),
        Reading("m2", "B", 9.4, 0.5),
    ]
    found = station_correction(readings, ["A", "B"])
    assert (found.of("B"), found.of("A")) == pytest.approx((0.15, -0.15))
    assert found.u_of("A") == pytest.approx(0.25)
    assert found.u_of_contrast({"A": -1.0, "B": 1.0}) == pytest.approx(0.5)
    assert found.u_of_contrast({"A": 1.0, "B": 1.0}) == pytest.approx(0.0, abs=1e-9)
    assert found.linked(["A"], ["B"])


def test_readings_count_by_their_noise() -> None:
    """Differences 0.2 of variance 2 and 0.6 of variance 0.5 (sd 0.5 each): mean 0.52, u² 0.4."""
    readings = [
        Reading("m1", "A", 5.0, 1.0),
        Reading("m1", "B", 5.2, 1.0),
        Reading("m2", "A", 9.0, 0.5),
        Reading("m2", "B", 9.6, 0.5),
    ]
    found = station_correction(readings, ["A", "B"])
    assert found.of("B") - found.of("A") == pytest.approx(0.52)
    assert found.u_of_contrast({"A": -1.0, "B": 1.0}) == pytest.approx(math.sqrt(0.4))


def test_three_stations_in_a_ring_by_least_squares() -> None:
    """A-B 1.0, B-C 1.0, C-A -1.7 (closing error 0.3): each link takes a third of it.

    Equal noise s: a link's difference has variance 2 s²; on a ring of three the fitted difference
    of two stations has 2 s² · 2/3, and chi² is 0.3²/(6 s²) with one degree of freedom.
    """
    s = 0.2
    pairs = (("m1", "A", "B", 1.0), ("m2", "B", "C", 1.0), ("m3", "C", "A", -1.7))
    readings = [
        reading
        for motor, low, high, gap in pairs
        for reading in (Reading(motor, low, 3.0, s), Reading(motor, high, 3.0 + gap, s))
    ]
    found = station_correction(readings, [])
    assert found.of("B") - found.of("A") == pytest.approx(0.9)
    assert found.of("C") - found.of("B") == pytest.approx(0.9)
    assert found.of("A") + found.of("B") + found.of("C") == pytest.approx(0.0, abs=1e-12)
    assert 0.3**2 / (6 * s**2) < 1.0
    expected = math.sqrt(4.0 / 3.0) * s
    assert found.u_of_contrast({"A": -1.0, "B": 1.0}) == pytest.approx(expected)
    assert found.u_of("A") == pytest.approx(expected / math.sqrt(3.0))


def test_readings_that_disagree_widen_the_uncertainty() -> None:
    """Birge: the ring of three closes by 1.2 where its noise is 0.2: chi² 6, one degree, √6."""
    s = 0.2
    pairs = (("m1", "A", "B", 1.0), ("m2", "B", "C", 1.0), ("m3", "C", "A", -0.8))
    readings = [
        reading
        for motor, low, high, gap in pairs
        for reading in (Reading(motor, low, 3.0, s), Reading(motor, high, 3.0 + gap, s))
    ]
    found = station_correction(readings, [])
    expected = math.sqrt(4.0 / 3.0) * s * math.sqrt(1.2**2 / (6.0 * s**2))
    assert found.u_of_contrast({"A": -1.0, "B": 1.0}) == pytest.approx(expected)


def test_every_further_reading_is_a_degree_of_freedom() -> None:
    """The ring read by two motors a side: chi² 1.2²/(3 s²) = 12 of four degrees, so √3."""
    s = 0.2
    pairs = (("A", "B", 1.0), ("B", "C", 1.0), ("C", "A", -0.8))
    readings = [
        reading
        for motor in ("m", "n")
        for low, high, gap in pairs
        for reading in (
            Reading(f"{motor}{low}", low, 3.0, s),
            Reading(f"{motor}{low}", high, 3.0 + gap, s),
        )
    ]
    found = station_correction(readings, [])
    expected = math.sqrt(2.0 / 3.0) * s * math.sqrt(3.0)
    assert found.u_of_contrast({"A": -1.0, "B": 1.0}) == pytest.approx(expected)


def test_each_linked_set_stands_alone() -> None:
    readings = [
        Reading("m1", "A", 1.0, 0.1),
        Reading("m1", "B", 1.2, 0.1),
        Reading("m2", "C", 7.0, 0.1),
        Reading("m2", "D", 7.6, 0.1),
        Reading("m3", "E", 4.0, 0.1),
    ]
    found = station_correction(readings, ["A", "F"])
    assert not found.linked(["A"], ["C"])
    assert not found.linked(["A", "E"], [])
    assert found.linked(["C"], ["D"])
    assert (found.of("B"), found.of("D")) == pytest.approx((0.1, 0.3))
    assert (found.of("E"), found.of("F"), found.u_of("E")) == (0.0, 0.0, 0.0)
    assert len(set(found.group.values())) == 4
    assert ("A", "C") not in found.covariance


def test_a_chain_of_links_is_one_set() -> None:
    readings = [
        Reading(f"m{k}", station, float(k), 0.1)
        for k, pair in enumerate(("BC", "DE", "CD", "AE"))
        for station in pair
    ]
    assert len(set(station_correction(readings, []).group.values())) == 1


def test_exact_readings_divide_by_no_zero() -> None:
    readings = [Reading("m", "A", 2.0, 0.0), Reading("m", "B", 2.5, 0.0)]
    found = station_correction(readings, [])
    assert found.of("B") == pytest.approx(0.25)
    assert found.u_of("B") == pytest.approx(0.0, abs=1e-9)
    assert station_correction([Reading("m", s, 0.0, 0.0) for s in "AB"], []).of("A") == 0.0


def test_biases_are_recovered_within_their_uncertainty() -> None:
    """Forty motors on two of four stations each, many times: the spread of a bias is its u."""
    rng = np.random.default_rng(3)
    true = np.array([0.5, -0.2, 0.1, -0.4])
    left, told = [], []
    for _ in range(60):
        readings = []
        for k in range(40):
            size = rng.normal(10.0, 2.0)
            readings += [
                Reading(f"m{k}", "ABCD"[j], size + true[j] + rng.normal(0.0, 0.3), 0.3)
                for j in rng.choice(4, 2, replace=False)
            ]
        found = station_correction(readings, [])
        left.append([found.of(name) - bias for name, bias in zip("ABCD", true, strict=True)])
        told.append(found.u_of("A"))
    assert np.std(left) == pytest.approx(np.mean(told), rel=0.2)


def test_a_contrast_never_has_a_negative_variance() -> None:
    found = Correction({"A": 0, "B": 0}, {}, {("A", "A"): -1e-20})
    assert (found.u_of("A"), found.u_of_contrast({"A": 1.0})) == (0.0, 0.0)
