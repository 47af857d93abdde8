"""An unknown curve in words: what it does where its variable is largest, and where that is."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.criticism.discovery.description import _run, turn_angles
from pipeline.criticism.discovery.dictionary import Term
from pipeline.criticism.discovery.expression import Expression
from pipeline.criticism.discovery.residual_inputs import Port, ports
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.records.diagnosis import CurvePoint
from tests.unit.criticism.machines import machine


def drag_on(variable: str) -> Port:
    """A drag on one variable."""
    return next(
        p
        for p in ports(machine(), DEFAULT.discovery, ("torque",))
        if p.variable.name == variable and not p.carriers[0].words
    )


def words(variable: str, low: float, high: float, *terms: tuple[float, Term]) -> str:
    """What is said of a drag on one variable that is visited from low to high."""
    port = drag_on(variable)
    amplitudes = np.array([size for size, _ in terms])
    chosen = tuple(term for _, term in terms)
    found = Expression(chosen, amplitudes, (), np.eye(0), 1.0, np.zeros(0))
    curve = tuple(CurvePoint(float(at), 0.0, 0.0, 0.0) for at in np.linspace(low, high, 17))
    return _run(port, curve, found, 0, DEFAULT.discovery)


def test_a_curve_without_terms_is_as_large_as_its_bands_show():
    """A map's steps pass 1 A in a few samples: a drag of 128 ± 5000 N·m there was its maximum."""
    none = Expression((), np.zeros(0), (), np.eye(0), 1.0, np.zeros(0))
    size = {-8.0: -0.4, -4.0: -0.3, -1.0: -128.0, 0.0: 0.0, 1.0: 110.0, 4.0: 0.3, 8.0: 0.4}
    band = {-1.0: 5e3, 1.0: 5e3}
    curve = [
        CurvePoint(at, v, v - band.get(at, 0.01), v + band.get(at, 0.01)) for at, v in size.items()
    ]
    told = _run(drag_on("iq_a"), curve, none, 0, DEFAULT.discovery)
    assert told == "odd, still growing at the end of the range, 0.4 N·m at 8 A"
    unknown = [CurvePoint(at, v, v - 5e3, v + 5e3) for at, v in size.items()]
    told = _run(drag_on("iq_a"), unknown, none, 0, DEFAULT.discovery)
    assert told.endswith("128 N·m at 1 A")


SPEED = "omega_mech_rad_s"
GROWING = "still growing at the end of the range,"
LEVEL = "level towards the end of the range,"


@pytest.mark.parametrize(
    ("low", "high", "term", "told"),
    [
        (-200.0, 200.0, Term("step", parity="odd"), f"odd, {LEVEL} 0.02 N·m at 200 rad/s"),
        (-200.0, 150.0, Term("step", parity="odd"), f"odd, {LEVEL} 0.02 N·m at 200 rad/s"),
        (-200.0, 200.0, Term("tanh", parity="odd", scale=20.0), f"odd, {LEVEL} 0.02 N·m"),
        (-200.0, 200.0, Term("line", parity="odd", scale=200.0), f"odd, {GROWING} 0.02 N·m"),
        (-200.0, 200.0, Term("tanh", parity="odd", scale=150.0), f"odd, {GROWING}"),
        (-200.0, 200.0, Term("square", parity="even", scale=200.0), f"even, {GROWING} 0.02"),
        (-250.0, 200.0, Term("cube", parity="odd", scale=200.0), f"odd, {GROWING} 0.0391"),
        (-200.0, 200.0, Term("peak", parity="odd", scale=70.0), "odd, with its maximum 0.02 N·m"),
        (5.0, 200.0, Term("decay", parity="even", scale=50.0), "largest, 0.0181 N·m at 5 rad/s"),
    ],
)
def test_a_curve_grows_at_its_end_only_where_it_still_rises(low, high, term, told):
    assert words(SPEED, low, high, (0.02, term)).startswith(told)


def test_a_drag_below_the_freezing_point_is_told_below_it():
    told = words("temp_winding_degc", -40.0, 10.0, (0.02, Term("line", parity="even", scale=40.0)))
    assert told == "largest, 0.02 N·m at -15 degC"


@pytest.mark.parametrize("orders", [(1.0, 2.0), (1.73,), (30.0, 6.0), (84.0,), (264.0,)])
def test_a_curve_over_a_turn_is_reported_finely_enough_for_its_waves(orders):
    """Lines between the points follow the highest wave; with fewer points another order is seen."""
    at, fine = turn_angles(orders), np.linspace(0.0, 6.0, 40_001)
    wave = np.sin(max(orders) * at)
    drawn = np.interp(fine, at, wave)
    assert np.abs(drawn - np.sin(max(orders) * fine)).max() < 0.09
    assert at[0] == 0.0 and at.size >= 48 and at[-1] < 2.0 * np.pi
