"""One capture alone: how its method spreads, and which captures measure alike."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation import alone
from pipeline.estimation.electrical.link import largest
from pipeline.records.capture import Campaign
from pipeline.records.uncertainty import coverage_factor, type_a, type_b
from tests.unit.estimation.signals import capture, known_value


def test_scatter_of_one_capture_counts_by_its_interval() -> None:
    """Of 5 degrees of freedom u is widened as 95 % of Student's law over the normal's."""
    budget = type_a("scatter", 0.1, 5.0) + type_b("voltage@s", 0.2)
    parts = {p.source: p for p in alone._own_scatter(budget, 2.0, "c.csv")}
    assert set(parts) == {"scatter#c.csv", "voltage@s"}
    widened = coverage_factor(5.0) / coverage_factor(math.inf)
    assert widened > 1.2
    assert parts["scatter#c.csv"].u == pytest.approx(0.2 * widened)
    assert parts["voltage@s"].u == pytest.approx(0.4)
    assert parts["scatter#c.csv"].dof == math.inf


@pytest.mark.parametrize(
    ("quantity", "test", "column", "meta", "expected"),
    [
        ("pole_pairs", "open_circuit", None, {}, 0.002),
        ("ld_h", "current_step", None, {}, 0.03),
        ("lq_h", "current_step", None, {}, 0.03),
        ("r_phase_ohm", "resistance", "temp_winding_degc", {}, 0.02),
        ("r_phase_ohm", "resistance", None, {}, 0.05),
        ("r_phase_ohm", "drive", "temp_winding_degc", {}, 0.03),
        ("r_phase_ohm", "drive", None, {}, 0.05),
        ("p·psi", "torque_map", "temp_magnet_degc", {}, 0.01),
        ("p·psi", "torque_map", None, {}, 0.02),
        ("p·psi", "open_circuit", "temp_magnet_degc", {}, 0.005),
        ("p·psi", "open_circuit", None, {}, 0.02),
        ("p·psi", "hand_turn", None, {"ambient_degc": 22.0}, 0.02),
        ("p·psi", "drive", "temp_winding_degc", {}, 0.03),
        ("p·psi", "heat_run", None, {}, 0.02),
        ("p·psi", "heat_run", "temp_winding_degc", {}, 0.005),
    ],
)
def test_how_a_method_spreads_from_capture_to_capture(quantity, test, column, meta, expected):
    columns = {} if column is None else {column: np.full(3, 30.0)}
    made = capture(test, t_s=np.arange(3.0), **meta, **columns)
    assert alone._spread(made, quantity, warmed=True) == expected


@pytest.mark.parametrize(("ambient", "expected"), [({}, 0.01), ({"ambient_degc": 22.0}, 0.005)])
def test_an_open_winding_is_cold_where_no_test_warms_the_motor(ambient, expected):
    made = capture("open_circuit", t_s=np.arange(3.0), **ambient)
    assert alone._spread(made, "p·psi", warmed=False) == expected


def test_what_an_inverter_is_of_a_constant() -> None:
    """2 % of the larger of the link and sqrt(3) v_q, over Ke times the largest speed."""

    def log(**more):
        columns = {"t_s": np.arange(1000) * 1e-3, "vq_v": np.full(1000, -10.0)}
        return capture("drive", **{**columns, **more})

    ke = replace(known_value("ke_phase_peak_v_s_rad", 0.05), unit="V·s/rad",
                 budget=type_b("voltage_commanded@s", 1e-3))  # fmt: skip
    speed = np.full(1000, -120.0)
    seen = 0.02 * math.sqrt(3.0) * 10.0 / (0.05 * 120.0)
    assert alone._inverter(log(omega_mech_rad_s=speed), ke) == pytest.approx(seen)
    link = 0.02 * 48.0 / (0.05 * 120.0)
    assert alone._inverter(log(omega_mech_rad_s=speed, vdc_v=48.0), ke) == pytest.approx(link)
    both = log(omega_mech_rad_s=speed, vdc_v=np.full(1000, 48.0))
    assert alone._inverter(both, ke) == pytest.approx(link)
    # from the angle where no speed was logged
    by_angle = log(theta_mech_rad=-120.0 * np.arange(1000) * 1e-3)
    assert alone._inverter(by_angle, ke) == pytest.approx(seen, rel=1e-6)
    ohm = replace(ke, unit="ohm", value=0.5)
    amps = log(iq_a=np.full(1000, -8.0), id_a=np.full(1000, 4.0))
    assert alone._inverter(amps, ohm) == pytest.approx(0.02 * math.sqrt(3.0) * 10.0 / 4.0)
    assert alone._inverter(log(), ohm) == math.inf
    assert alone._inverter(log(omega_mech_rad_s=speed), known_value("ke", 0.05)) == 0.0
    assert alone._inverter(capture("drive", t_s=np.arange(3.0)), ke) == 0.0


def test_the_largest_of_a_column_leaves_strays_aside() -> None:
    values = np.concatenate([np.linspace(-1.0, 1.0, 101), [50.0, np.nan]])
    made = capture("drive", iq_a=values)
    expected = float(np.percentile(np.abs(values[:-1]), 95.0))
    assert largest(made, "iq_a") == pytest.approx(expected)
    assert largest(made, "id_a") == 0.0
    t = np.arange(1000) * 1e-3
    angle = np.where(t < 0.5, 30.0 * t, 15.0 - 90.0 * (t - 0.5))
    angle[::7] = np.nan
    assert alone._fastest_rad_s(capture("drive", t_s=t, theta_mech_rad=angle)) == pytest.approx(
        90.0
    )


def test_captures_that_measure_alike() -> None:
    """The same test, pair and kind of voltage; steps also of one angle, mod 180, and height."""

    def step(path, angle, amps, **meta):
        return capture(
            "current_step", path, theta_elec_deg=angle, ia_a=np.array([0.0, -amps]), **meta
        )

    one = step("a", -30.0, 5.0)
    assert alone._way(one) == alone._way(step("b", 150.0, 5.3))
    assert alone._way(one) != alone._way(step("b", -30.0, 6.5))
    assert alone._way(one) != alone._way(step("b", 60.0, 5.0))
    assert alone._way(one) != alone._way(step("b", -30.0, 5.0, pair="bc"))
    assert alone._height(step("b", 0.0, 0.0)) == ""
    assert alone._height(step("b", 0.0, 1.25**3)) == "3"
    campaign = Campaign("m", (one, step("b", -30.0, 6.5), step("c", 150.0, 5.0)))
    assert [c.path for c in alone.repeated(campaign)] == ["a", "c"]
