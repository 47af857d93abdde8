"""Captures without a clock of their own, logs of one axis, bounds and optional terms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.holding_cells import holding_orders
from pipeline.criticism.data.levels import levels_of, set_levels
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.equations import equations
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, values_of
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.bounds import bounded_step, limits_of
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.sectors import sector_errors
from tests.unit.criticism.machines import BASE

MACHINE = Machine(5, 6, {"current_a": 1.0, "voltage_v": 1.0, "torque_nm": 1.0})


def cut(name: str, one: Capture) -> Segment | None:
    """The segment that an equation cuts out of a capture."""
    return equations()[name].cut(one, MACHINE)


def capture(test: str, **columns) -> Capture:
    table = pl.DataFrame({name: np.asarray(c, float) for name, c in columns.items()})
    return Capture(f"{test}.csv", "0", "unverified", CaptureMeta("m", test), (table,))


def held(orders: dict[int, float], noise: float, seed: int = 1) -> Capture:
    """One turn forwards and back, 6000 holds each, friction of 0.05 A."""
    turn = np.linspace(0.0, 2 * np.pi, 6000)
    theta = np.concatenate([turn, turn[::-1]])
    sense = np.repeat([1.0, -1.0], 6000)
    rng = np.random.default_rng(seed)
    current = 0.05 * sense + rng.normal(0.0, noise, theta.size)
    current += sum(a * np.sin(k * theta + k) for k, a in orders.items())
    return capture("holding_current", theta_mech_rad=theta, iq_a=current)


def test_cells_of_a_held_rotor_keep_the_sense_of_arrival_and_their_own_noise():
    segment = cut("standing", held({30: 0.1}, 0.01))
    forward = segment.recorded["sense"] > 0
    assert abs(forward.sum() - (~forward).sum()) <= 2
    mean = segment.recorded["iq_a"][forward].mean()
    assert mean == pytest.approx(0.05, abs=0.002)
    # six holds a cell
    assert segment.sensors.noise["iq_a"] == pytest.approx(0.01 / np.sqrt(6000 / 1024), rel=0.2)
    assert set(segment.blocks.tolist()) == set(range(24))


@pytest.mark.parametrize("every", [3, 6, 10])
def test_cells_of_a_row_or_two_have_the_noise_of_their_neighbours(every):
    """And not a ten-thousandth of the current, nor that of two cells where the pass turns round."""
    whole = held({5: 0.1}, 0.01).tables[0]
    theta, current = (whole[name].to_numpy()[::every] for name in ("theta_mech_rad", "iq_a"))
    resting = np.random.default_rng(3).normal(0.0, 0.1, (2, 40))
    theta = np.concatenate([np.zeros(40), theta, np.zeros(40)])
    current = np.concatenate([resting[0], current, resting[1]])
    segment = cut("standing", capture("holding_current", theta_mech_rad=theta, iq_a=current))
    a_cell = max(6000 / every / 1024, 1.0)
    assert segment.sensors.noise["iq_a"] == pytest.approx(0.01 / np.sqrt(a_cell), rel=0.35)


def test_orders_that_repeat_are_found_and_noise_adds_none():
    true = {5: 0.01, 12: 0.02, 30: 0.1}
    assert holding_orders([held(true, 0.01)], (5, 6), DEFAULT, 400) == (5, 12, 30)
    assert holding_orders([held({}, 0.01)], (5, 6), DEFAULT, 400) == ()


@pytest.mark.parametrize("sectors", [1, 2, 5])
def test_a_small_part_of_a_turn_tells_of_no_order(sectors):
    """The scatter of one sector's gain is NaN, and no gain is below that."""
    theta = np.linspace(0.01, sectors * 2.0 * np.pi / 24.0 - 0.01, 6000)
    current = 0.05 + np.random.default_rng(1).normal(0.0, 0.01, theta.size)
    part = capture("holding_current", theta_mech_rad=theta, iq_a=current)
    assert set(cut("standing", part).blocks.tolist()) == set(range(sectors))
    assert holding_orders([part], (5, 6), DEFAULT, 400) == ()


def test_held_out_sectors_expose_orders_that_only_fit():
    some = [held({30: 0.1}, 0.01)]
    fitted, out = sector_errors(some, (30,), DEFAULT)
    many, trap = sector_errors(some, range(1, 200), DEFAULT)
    assert out < 1.05 * fitted
    assert many < fitted
    assert trap > 3 * fitted


def test_levels_are_parted_by_gaps_whatever_their_order():
    current = np.array([0.0, -10.01, -5.0, -9.99, 0.01, -5.02])
    assert levels_of(current).tolist() == [2, 0, 1, 0, 2, 1]


@pytest.mark.parametrize(("bend", "missing"), [(0.0, ()), (0.1, ("saturation",))])
def test_a_sweep_of_one_axis_is_diagnosed(bend, missing):
    """An axis that stands still at zero has no scale of its own."""
    sweep = np.linspace(-10.0, 10.0, 41)
    psi = 0.02 + 3e-4 * sweep * (1.0 - bend * sweep / 10.0)
    psi = psi + np.random.default_rng(3).normal(0.0, 2e-6, sweep.size)
    still = np.zeros(sweep.size)
    table = capture("flux_map", id_a=sweep, iq_a=still, psi_d_wb=psi, psi_q_wb=still)
    found = diagnose(Campaign("m", (table,)), ModelSpec("ideal"), Constants())
    assert found.missing == missing
    assert found.ladder[-1].held_out < 1.0


@pytest.mark.parametrize("set_a", [0.0, -8.0])
def test_one_level_with_noise_is_one_level(set_a):
    """Its own noise parts it at every hundredth of its range."""
    random = np.random.default_rng(5)
    current = set_a + random.normal(0.0, 0.02, 30)
    speed = np.linspace(50.0, 300.0, 30)
    assert levels_of(current).max() > 10
    assert set_levels(current, DEFAULT.tables).max() == 0
    volts = 0.05 * speed + random.normal(0.0, 1e-3, 30)
    table = capture("flux_map", id_a=current, omega_mech_rad_s=speed, vq_v=volts)
    assert cut("steady", table).disturbances.offsets.shape == (1, 30)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.1])
def test_levels_that_were_set_are_told_through_their_noise(noise):
    """Unevenly spaced, and as many rows as it takes at each."""
    levels = np.repeat([0, 1, 2, 3], [3, 6, 4, 7])
    current = np.array([-20.0, -8.0, -6.0, 0.0])[levels]
    current = current + np.random.default_rng(6).normal(0.0, noise, current.size)
    assert set_levels(current, DEFAULT.tables).tolist() == levels.tolist()


@pytest.mark.parametrize("last_digit", [0.0, 1e-5])
def test_a_meter_is_known_no_better_than_its_last_digit(last_digit):
    """The same resistance at all angles is no resistance without noise."""
    angle = np.arange(0.0, 180.0, 15.0)
    lab = 6e-4 + 1.1e-4 * np.cos(np.radians(2.0 * angle))
    lab = np.round(lab / last_digit) * last_digit if last_digit else lab
    rab = np.full(angle.size, 0.62)
    table = capture("lcr", theta_elec_deg=angle, lab_h=lab, rab_ohm=rab)
    (segment,) = segments(Campaign("m", (table,)), MACHINE)
    assert segment.sensors.noise["rab_ohm"] == pytest.approx(0.62e-4)
    assert segment.sensors.noise["lab_h"] > 0.99 * max(last_digit / np.sqrt(12.0), 7.1e-8)


def test_a_sweep_of_one_axis_has_noise_on_the_other():
    """i_q = 0 throughout, and ψ_q with it: noise of no range at all would be none."""
    sweep, still = np.linspace(-10.0, 10.0, 21), np.zeros(21)
    columns = {"id_a": sweep, "iq_a": still, "psi_d_wb": 0.02 + 3e-4 * sweep, "psi_q_wb": still}
    told = cut("flux_map", capture("flux_map", **columns))
    assert told.sensors.noise["id_a"] == pytest.approx(0.02)
    assert told.sensors.noise["psi_d_wb"] == pytest.approx(6e-6)
    assert told.sensors.noise["iq_a"] == pytest.approx(0.1 * told.sensors.noise["id_a"])
    assert told.sensors.noise["psi_q_wb"] == pytest.approx(0.1 * told.sensors.noise["psi_d_wb"])
    standing_still = {**columns, "psi_d_wb": np.full(21, 0.02)}
    assert cut("flux_map", capture("flux_map", **standing_still)) is None


def test_steady_voltages_have_an_offset_a_level_and_are_held_out_by_level():
    current = np.repeat([0.0, -4.0, -8.0, -12.0], 6)
    speed = np.tile(np.linspace(50.0, 100.0, 6), 4)
    volts = 0.1 * (current == 0.0) + 5 * speed * (0.01 + 1e-4 * current)
    segment = cut("steady", capture("flux_map", id_a=current, omega_mech_rad_s=speed, vq_v=volts))
    assert segment.kind == "steady"
    assert segment.disturbances.offsets.shape == (4, 24)
    assert segment.blocks.tolist() == levels_of(current).tolist()


def test_readings_that_came_late_are_set_aside_in_a_log_of_the_q_axis():
    time = np.arange(4000) * 1e-3
    time[2000:2007] = time[2006] + np.arange(7) * 1e-4
    theta = 20.0 * time - 50.0 * np.cos(time)
    log = capture(
        "drive",
        t_s=time,
        vq_v=np.sin(time),
        iq_a=np.cos(time),
        theta_mech_rad=theta,
        omega_mech_rad_s=np.full(4000, 20.0),
    )
    voltage, motion = cut("q", log), cut("motion", log)
    assert voltage.channels == ("vq_v", "omega_mech_rad_s")
    assert motion.channels == ("torque_shaft_nm",)
    starts, length = voltage.weak.starts, voltage.weak.length
    assert not np.any((starts <= 2003) & (starts + length > 2003))
    assert starts.min() < 500 and starts.max() > 3500
    assert cut("q", capture("drive", t_s=time, vq_v=theta, iq_a=theta)) is None


@dataclass
class Quadratic:
    """The least of (x − target)' A (x − target) along some of the coordinates, from `at`."""

    a: np.ndarray
    target: np.ndarray
    at: np.ndarray

    def best(self, places):
        slope = self.a @ (self.at - self.target)
        part = self.a[np.ix_(places, places)]

        @dataclass
        class End:
            step: np.ndarray

        return End(-np.linalg.solve(part, slope[places]))


def test_inertia_stops_short_of_nothing():
    scales = dict.fromkeys(("current_a", "voltage_v", "speed_rad_s", "torque_nm", "flux_wb"), 2.0)
    low, high = limits_of(Model(Machine(1, None, scales), ()))["j_kgm2"]
    assert 0.0 < low < 1e-3 * scales["torque_nm"] / scales["speed_rad_s"] < high


def test_the_others_take_up_what_a_parameter_at_its_bound_cannot_do():
    """Windage may not be negative; Coulomb friction goes to its best value without it."""
    both = tuple(effects()[n] for n in ("coulomb_friction", "windage"))
    scales = dict.fromkeys(("current_a", "voltage_v", "speed_rad_s", "torque_nm", "flux_wb"), 1.0)
    model = Model(Machine(1, None, scales), both)
    columns = [Column("coulomb_friction.torque_nm", 1.0), Column("windage.drag_nm", 1.0)]
    a = np.array([[2.0, 1.5], [1.5, 2.0]])
    target, at = np.array([0.5, -0.3]), np.array([0.1, 0.0])
    values = {c.name: float(v) for c, v in zip(columns, at, strict=True)}
    step = bounded_step(Quadratic(a, target, at).best, columns, model, values)
    assert step[1] == 0.0
    alone = target[0] + a[0, 1] / a[0, 0] * target[1]
    assert at[0] + step[0] == pytest.approx(alone)


def test_a_parameter_at_its_upper_bound_stays_there():
    """Windage stands at the machine's whole torque; Coulomb friction goes to its best beside it."""
    both = tuple(effects()[n] for n in ("coulomb_friction", "windage"))
    scales = dict.fromkeys(("current_a", "voltage_v", "speed_rad_s", "torque_nm", "flux_wb"), 1.0)
    model = Model(Machine(1, None, scales), both)
    columns = [Column("coulomb_friction.torque_nm", 1.0), Column("windage.drag_nm", 1.0)]
    a = np.array([[2.0, 1.5], [1.5, 2.0]])
    target, at = np.array([0.5, 1.4]), np.array([0.1, 1.0])
    values = {c.name: float(v) for c, v in zip(columns, at, strict=True)}
    step = bounded_step(Quadratic(a, target, at).best, columns, model, values)
    assert step[1] == 0.0
    assert at[0] + step[0] == pytest.approx(target[0] + a[0, 1] / a[0, 0] * (target[1] - at[1]))


def test_a_term_that_is_left_out_is_zero_and_no_parameter():
    full = effects()["saturation"]
    less = replace(full, left_out=(2, 5))
    names = [p.name for p in less.parameters_of(MACHINE)]
    assert names == ["q_fall", "d_odd", "d_fall"]
    q = values_of(less, MACHINE, {f"saturation.{n}": 0.1 for n in names})
    assert q == {"q_fall": 0.1, "q_bend": 0.0, "d_odd": 0.1, "d_fall": 0.1, "d_bend": 0.0}


@pytest.mark.parametrize(("freq_hz", "seen_hz"), [(400.0, 400.0), (None, 1000.0)])
def test_a_meter_s_phase_is_in_its_resistance_by_the_reactance(freq_hz, seen_hz):
    """A milliradian is three per cent of the resistance at a Q of thirty."""
    angle = np.arange(0.0, 180.0, 15.0)
    frequency = {} if freq_hz is None else {"freq_hz": np.full(angle.size, freq_hz)}
    ohm, henry = np.full(angle.size, 0.62), np.full(angle.size, 6e-4)
    table = capture("lcr", theta_elec_deg=angle, lab_h=henry, rab_ohm=ohm, **frequency)
    (segment,) = segments(Campaign("m", (table,)), MACHINE)
    values = {**BASE, "r_ohm": 0.31, "ld_h": 3e-4, "lq_h": 3e-4}
    plain = Model(MACHINE, ())
    late = {**values, "phase_lcr_rad": 1e-3}
    before, after = (residual(segment, plain, one) for one in (values, late))
    henries, ohms = np.abs(after - before)
    reactance = 2.0 * np.pi * seen_hz * 6e-4
    assert ohms == pytest.approx(1e-3 * reactance, rel=1e-3)
    assert henries == pytest.approx(1e-3 * 0.62 / (2.0 * np.pi * seen_hz), rel=1e-3)
