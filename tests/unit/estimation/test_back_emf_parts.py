"""Back-EMF part by part: space vectors, steady stretches, flux of one speed, cycles a turn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.electrical import steady_speed
from pipeline.estimation.electrical.back_emf import electrical_per_mechanical, flux_of
from pipeline.estimation.electrical.spin import Channel, Spin, read_spin
from pipeline.estimation.electrical.spin_angle import Group, angle_offset, count_pole_pairs
from pipeline.estimation.electrical.steady_speed import (
    Stretch,
    _one_way,
    _smooth_phase,
    _split,
    _steady_core,
    _unbroken,
    steady_stretches,
)
from pipeline.estimation.estimators.open_circuit import METHOD
from pipeline.numerics.least_squares import autocorrelation_time
from tests.unit.estimation.signals import capture

TURN = 2.0 * math.pi
PAIR = {"vab_v": math.pi / 6.0, "vbc_v": -math.pi / 2.0, "vca_v": 5.0 * math.pi / 6.0}


def spin_of(t, vector, lines=("vab_v", "vbc_v"), theta=None, omega=None, noise=0.0, offset=0.0):
    """Line voltages of a space vector [n]: sqrt(3) Re(x e^{-j angle})."""
    rng = np.random.default_rng(0)
    channels = []
    for name in lines:
        v = math.sqrt(3.0) * (vector * np.exp(-1j * PAIR[name])).real + offset
        channels.append(Channel(name, v + noise * rng.standard_normal(t.size), math.sqrt(3.0),
                                PAIR[name]))  # fmt: skip
    return Spin(t, tuple(channels), theta, omega, None)


def test_voltages_read_and_what_each_is_of_the_space_vector() -> None:
    t = np.arange(50) * 1e-3
    e = 40.0 * t
    x = np.exp(1j * (e + 0.3))
    phases = {f"v{p}_v": (x * np.exp(-1j * k * TURN / 3.0)).real for k, p in enumerate("abc")}
    pairs = {"vab_v": phases["va_v"] - phases["vb_v"], "vbc_v": phases["vb_v"] - phases["vc_v"]}
    by_phase = read_spin(capture("open_circuit", t_s=t, **phases), None)
    by_pair = read_spin(capture("open_circuit", t_s=t, **phases, **pairs), None)
    assert [c.name for c in by_phase.channels] == ["va_v", "vb_v", "vc_v"]
    assert [c.name for c in by_pair.channels] == ["vab_v", "vbc_v"]
    for spin in (by_phase, by_pair):
        assert spin.vector_v(centred=False) == pytest.approx(x)


def test_a_vector_is_of_independent_voltages_or_of_one_and_loses_their_offsets() -> None:
    t = np.arange(1000) * 1e-3
    x = np.exp(1j * TURN * 5.0 * t)  # five whole turns
    spin = spin_of(t, x, offset=0.4)
    assert spin.vector_v() == pytest.approx(x, abs=1e-9)
    assert np.abs(spin.vector_v(centred=False) - x).max() > 0.1
    with pytest.raises(ValueError, match="multiples of one another"):
        spin_of(t, x, ("vab_v", "vab_v")).vector_v()
    assert spin_of(t, x, ("vab_v",), offset=0.4).vector_v() == pytest.approx(x, abs=1e-9)
    three = spin_of(t, x, ("vab_v", "vbc_v", "vca_v"))
    assert three.vector_v() == pytest.approx(x, abs=1e-9)


def test_rows_without_a_voltage_are_left_out_and_a_temperature_is_bridged() -> None:
    t = np.arange(6) * 1.0
    v = np.array([1.0, 2.0, np.nan, 4.0, 5.0, 6.0])
    temp = np.array([20.0, np.nan, 25.0, np.nan, np.nan, 50.0])
    spin = read_spin(capture("open_circuit", t_s=t, vab_v=v, vbc_v=v, temp_magnet_degc=temp,
                             theta_mech_rad=t, omega_mech_rad_s=t), "temp_magnet_degc")  # fmt: skip
    assert spin.t_s.tolist() == [0.0, 1.0, 3.0, 4.0, 5.0]
    assert spin.temp_degc == pytest.approx([20.0, 26.0, 38.0, 44.0, 50.0])
    assert spin.theta_rad.tolist() == spin.t_s.tolist()
    with pytest.raises(KeyError, match="no terminal voltage"):
        read_spin(capture("open_circuit", t_s=t), None)


def test_a_phase_is_parted_where_it_turns_back_by_a_cycle() -> None:
    there = np.concatenate([np.arange(0.0, 20.0, 0.5), np.arange(20.0, 0.0, -0.5)])
    parts_of = [(0, 40), (40, 79), (79, 80)]  # the last row, the lowest, stands alone
    assert _one_way(there) == parts_of
    assert _one_way(-there) == parts_of
    for back, parts in ((TURN - 0.01, 1), (TURN + 0.01, 3)):
        steps = np.concatenate([np.full(40, 0.5), np.full(40, -back / 40.0), np.full(40, 0.5)])
        phase = np.concatenate([[0.0], np.cumsum(steps)])
        found = _one_way(phase)
        assert len(found) == parts
        if parts == 3:
            assert found == [(0, 40), (40, 80), (80, 121)]


@pytest.mark.parametrize(("lost", "parted"), [(4, False), (6, True)])
def test_a_gap_of_half_a_cycle_parts_a_run(lost: int, parted: bool) -> None:
    """0.2 pi a row: a gap of four rows is 0.8 pi + 0.2, five more than half a cycle."""
    t = np.arange(200) * 1e-3
    vector = np.exp(0.2j * math.pi * np.arange(200))
    keep = np.ones(200, dtype=bool)
    keep[100 : 100 + lost - 1] = False
    t, vector = t[keep], vector[keep]
    found = list(_unbroken(t, vector, np.ones(t.size, dtype=bool)))
    assert found == ([(0, 100), (100, t.size)] if parted else [(0, t.size)])


def test_rows_at_rest_part_runs_and_a_late_row_does_not() -> None:
    t = np.arange(30) * 1e-3
    vector = np.exp(0.9j * math.pi * np.arange(30))
    moving = np.ones(30, dtype=bool)
    moving[10:13] = False
    assert list(_unbroken(t, vector, moving)) == [(0, 10), (13, 30)]
    late = t.copy()
    late[20:] += 0.45e-3  # more than half a cycle, yet within 1.5 sampling intervals
    assert list(_unbroken(late, vector, np.ones(30, dtype=bool))) == [(0, 30)]
    late[20:] += 0.1e-3
    assert list(_unbroken(late, vector, np.ones(30, dtype=bool))) == [(0, 20), (20, 30)]
    assert list(_unbroken(t, vector, np.zeros(30, dtype=bool))) == []


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_smooth_phase_is_that_of_whole_cycles(sense: float) -> None:
    """A fifth harmonic on an even phase averages out: its rate is the speed, cycle by cycle."""
    t = np.arange(800) * 1e-3
    even = sense * TURN * 10.0 * t
    found = _smooth_phase(t, even + 0.05 * np.sin(5.0 * even))
    assert found is not None
    phase, omega, number = found
    inner = slice(100, 700)
    assert omega[inner] == pytest.approx(sense * TURN * 10.0, rel=2e-3)
    assert phase[inner] == pytest.approx(even[inner], abs=2e-2)
    assert number.max() == 6  # seven whole cycles between the first and last crossing
    assert np.count_nonzero(number == 3) == 100
    assert (number[-60:] == -1).any()


def test_a_phase_of_less_than_three_cycles_is_none() -> None:
    t = np.arange(400) * 1e-3
    for cycles, there in ((2.9, False), (4.2, True)):
        assert (_smooth_phase(t, TURN * cycles * t / t[-1]) is not None) is there
    few = np.arange(11) * 1e-3
    assert _smooth_phase(few, TURN * 5.0 * few / few[-1]) is None


def test_where_a_phase_begins_is_neither_cycles_nor_a_sense() -> None:
    """A counter that stands at a hundred cycles as the record begins, and falls."""
    t = np.arange(400) * 1e-3
    assert _smooth_phase(t, TURN * (100.0 + 2.9 * t / t[-1])) is None
    found = _smooth_phase(t, TURN * (100.0 - 8.0 * t / t[-1]))
    assert found is not None
    assert found[1][100:300] == pytest.approx(-TURN * 8.0 / t[-1], rel=2e-3)


def test_a_run_is_cut_where_its_speed_leaves_the_band() -> None:
    """12 cycles at 100, then 12 at 103 rad/s, ten rows each; one cycle at either end is left."""
    number = np.repeat(np.arange(24), 10)
    omega = np.where(number < 12, 100.0, 103.0)
    rows = np.arange(240) + 1000
    phase = np.cumsum(omega)
    found = _split(rows, phase, omega, number, 0.02)
    assert [s.rows[[0, -1]].tolist() for s in found] == [[1010, 1109], [1130, 1229]]
    assert [s.speed_rad_s for s in found] == [100.0, 103.0]
    assert found[0].phase_rad[0] == phase[10]
    whole = _split(rows, phase, omega, number, 0.04)
    assert [s.rows[[0, -1]].tolist() for s in whole] == [[1010, 1229]]
    backwards = _split(rows, -phase, -omega, number, 0.02)
    assert [s.speed_rad_s for s in backwards] == [-100.0, -103.0]
    outside = np.where(np.arange(240) < 20, -1, number)
    assert (
        _split(rows, phase, omega, np.where(outside < 0, -1, outside - 2), 0.02)[0].rows[0] == 1030
    )


@pytest.mark.parametrize(("cycles", "kept"), [(7, (0, 7)), (8, (1, 7)), (20, (1, 19))])
def test_the_core_of_a_stretch_is_a_cycle_less_at_each_end(cycles: int, kept) -> None:
    assert _steady_core(np.full(cycles, 50.0), 0, cycles) == kept


def test_traces_of_ramps_are_left_out_with_a_cycle_more() -> None:
    """Alternating by 0.1 about 50: five robust sigmas are 0.74."""
    speeds = 50.0 + 0.1 * (-1.0) ** np.arange(30)
    speeds[[0, 1, 29]] = 48.0, 49.2, 50.8
    assert _steady_core(speeds, 0, 30) == (3, 28)
    speeds[1] = 49.3
    assert _steady_core(speeds, 0, 30) == (2, 28)
    speeds[29] = 50.7
    assert _steady_core(speeds, 0, 30) == (2, 29)


def even(speed: float, rows: int = 2000, rate: float = 1e4, psi: float = 4e-3, start: float = 0.0):
    t = np.arange(rows) / rate
    phase = start + speed * t
    return t, phase, 1j * speed * psi * np.exp(1j * phase)


def stretch_of(phase, speed):
    return Stretch(np.arange(phase.size), phase, np.full(phase.size, speed))


@pytest.mark.parametrize("speed", [300.0, -300.0])
def test_flux_is_the_amplitude_over_the_rate_of_its_phase(speed: float) -> None:
    """With a mirror wave (unequal gains), offsets, and orders 5, 7 of known size and phase."""
    t, phase, v = even(speed)
    fifth, seventh = 0.03 * np.exp(0.4j), 0.02 * np.exp(-1.1j)
    # in the space vector order 5 turns backwards and 7 forwards
    v = v * 1.0 + 1j * speed * 4e-3 * (fifth * np.exp(-5j * phase) + seventh * np.exp(7j * phase))
    spin = spin_of(t, v, offset=0.02)
    found = flux_of(spin, stretch_of(phase, speed), (5, 7))
    assert found.psi_wb == pytest.approx(4e-3, rel=1e-9)
    assert found.harmonics[5] == pytest.approx(fifth, rel=1e-6)
    assert found.harmonics[7] == pytest.approx(seventh, rel=1e-6)
    assert found.speed_elec_rad_s == speed
    assert found.amplitude_v == pytest.approx(4e-3 * abs(speed))
    assert found.temp_degc is None


def test_orders_beyond_the_rate_are_left_out() -> None:
    """0.4 rad a row: order 5 is 2.0, 7 is 2.8 above 0.8 pi = 2.51."""
    t, phase, v = even(4000.0)
    found = flux_of(spin_of(t, v), stretch_of(phase, 4000.0), (5, 7))
    assert set(found.harmonics) == {5}
    assert set(flux_of(spin_of(t, v), stretch_of(phase, 4000.0), (5, 6)).harmonics) == {5, 6}


def test_the_scatter_of_the_flux_is_that_of_many_drawings() -> None:
    """Two channels of noise sigma: c = v/(gain w), of 2 n readings: sigma sqrt(2/(2n))/(gain w)."""
    t, phase, v = even(300.0)
    sigma = 0.01
    spin = spin_of(t, v, ("vab_v", "vbc_v", "vca_v"), noise=sigma)
    found = flux_of(spin, stretch_of(phase, 300.0), (5, 7))
    expected = sigma * math.sqrt(2.0 / (3.0 * t.size)) / (math.sqrt(3.0) * 300.0)
    assert found.u_psi_wb == pytest.approx(expected, rel=0.05)
    assert found.u_harmonic == pytest.approx(found.u_psi_wb / found.psi_wb)
    assert abs(found.psi_wb - 4e-3) < 4.0 * expected


def test_correlated_noise_counts_by_its_memory() -> None:
    t, phase, v = even(300.0)
    rng = np.random.default_rng(1)
    slow = np.convolve(rng.standard_normal(t.size + 19), np.ones(20) / 20.0, mode="valid")
    spin = spin_of(t, v)
    noisy = Spin(t, tuple(Channel(c.name, c.v_v + 0.05 * slow, c.gain, c.angle_rad)
                          for c in spin.channels), None, None, None)  # fmt: skip
    plain = flux_of(noisy, stretch_of(phase, 300.0), ())
    tau = autocorrelation_time(slow)
    assert tau > 8.0
    variance = float(np.var(0.05 * slow))
    expected = math.sqrt(variance * tau * 2.0 / (2.0 * t.size)) / (math.sqrt(3.0) * 300.0)
    assert plain.u_psi_wb == pytest.approx(expected, rel=0.25)


def test_temperature_of_a_stretch_is_its_mean() -> None:
    t, phase, v = even(300.0)
    spin = spin_of(t, v)
    warm = Spin(t, spin.channels, None, None, np.linspace(20.0, 30.0, t.size))
    half = Stretch(np.arange(1000), phase[:1000], np.full(1000, 300.0))
    found = flux_of(warm, half, ()).temp_degc
    assert found == pytest.approx(np.linspace(20.0, 30.0, 2000)[:1000].mean())
    blank = Spin(t, spin.channels, None, None, np.full(t.size, np.nan))
    assert flux_of(blank, half, ()).temp_degc is None


def test_the_trend_of_a_stretch_is_between_its_outer_quarters() -> None:
    omega = np.concatenate([np.full(25, 98.0), np.full(50, 100.0), np.full(25, 102.0)])
    one = Stretch(np.arange(100), omega, omega)
    assert one.trend == pytest.approx(0.04)
    assert Stretch(np.arange(100), omega, -omega).trend == pytest.approx(0.04)
    assert Stretch(np.arange(3), omega[:3], np.array([1.0, 2.0, 3.0])).trend == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("sense", "by"), [(1, "angle"), (-1, "angle"), (1, "speed"), (-1, "speed")]
)
def test_cycles_a_turn_by_angle_or_speed(sense: int, by: str) -> None:
    """Seven cycles a turn, both ways; exchanged leads turn the sign."""
    t, phase, v = even(300.0 * sense)
    mech = phase / 7.0 * sense
    mech_speed = np.full(t.size, 300.0 / 7.0)
    holed = np.where(np.arange(t.size) % 50 == 0, np.nan, mech)
    spin = spin_of(t, v, theta=holed if by == "angle" else None,
                   omega=None if by == "angle" else mech_speed)  # fmt: skip
    parts = [Stretch(np.arange(a, a + 800), phase[a : a + 800], np.full(800, 300.0 * sense))
             for a in (0, 1000)]  # fmt: skip
    ratio, by_angle = electrical_per_mechanical(spin, parts)
    assert ratio == pytest.approx(7.0 * sense, rel=1e-9)
    assert by_angle is (by == "angle")


def test_cycles_of_unequal_stretches_weigh_by_travel() -> None:
    """14 cycles over 2 rad and 3 over 1 rad: 17 cycles over 3, whichever way each ran."""
    t = np.arange(4) * 1.0
    theta = np.array([0.0, 2.0, 2.0, 1.0])
    spin = Spin(t, (), theta, None, None)
    parts = [Stretch(np.array([0, 1]), np.array([0.0, 14.0]), np.ones(2)),
             Stretch(np.array([2, 3]), np.array([9.0, 6.0]), -np.ones(2))]  # fmt: skip
    assert electrical_per_mechanical(spin, parts)[0] == pytest.approx(17.0 / 3.0)
    blind = Spin(t, (), np.array([0.0, np.nan, 2.0, 1.0]), None, None)
    assert electrical_per_mechanical(blind, parts)[0] == pytest.approx(3.0)
    speeds = Spin(t, (), None, np.array([2.0, 2.0, -1.0, -1.0]), None)
    parts = [Stretch(np.array([0, 1]), np.zeros(2), np.full(2, 14.0)),
             Stretch(np.array([2, 3]), np.zeros(2), np.full(2, -3.0))]  # fmt: skip
    assert electrical_per_mechanical(speeds, parts)[0] == pytest.approx(17.0 / 3.0)
    assert math.isnan(electrical_per_mechanical(Spin(t, (), None, None, None), parts)[0])


@pytest.mark.parametrize("sense", [1, -1])
def test_cycles_of_a_slow_uneven_turn(sense: int) -> None:
    """A fifth of a turn of 17 pole pairs whose speed swings by 15 % within a cycle."""
    t = np.arange(6000) * 1e-4
    theta = sense * (2.2 * t + 0.33 / 40.0 * np.sin(40.0 * t))
    phase = 17.0 * theta
    v = 1j * np.gradient(phase, t) * 5e-3 * np.exp(1j * phase)
    spin = spin_of(t, v + 1e-4 * np.random.default_rng(3).standard_normal(t.size), theta=theta)
    ratio, _ = electrical_per_mechanical(spin, steady_stretches(spin, 0.02))
    assert ratio == pytest.approx(17.0, abs=0.01)


def course(speeds, rate=1e4, psi=4e-3, noise=1e-3):
    """Spin of an electrical speed [n]."""
    t = np.arange(speeds.size) / rate
    phase = np.cumsum(speeds) / rate
    return spin_of(t, 1j * speeds * psi * np.exp(1j * phase), noise=noise)


def test_ramps_are_left_out_where_steady_speeds_are_there() -> None:
    speeds = np.concatenate([np.full(3000, 300.0), np.linspace(300.0, 600.0, 2000),
                             np.full(3000, 600.0)])  # fmt: skip
    found = steady_stretches(course(speeds), 0.02)
    assert [round(s.speed_rad_s) for s in found] == [300, 600]
    assert all(s.rows.size > 2000 for s in found)


def test_a_ramp_alone_is_taken_as_it_comes() -> None:
    """Too little of it is within 2 %, or within five times that: any change is taken."""
    found = steady_stretches(course(np.linspace(200.0, 900.0, 6000)), 0.0005)
    assert found
    assert sum(s.rows.size for s in found) > 0.2 * 6000


@pytest.mark.parametrize(("share", "there"), [(0.0185, False), (0.0215, True)])
def test_below_a_fiftieth_of_the_fastest_the_rotor_stands(share: float, there: bool) -> None:
    speeds = np.concatenate([np.full(4000, 4000.0), np.full(8000, share * 4000.0)])
    spin = course(speeds, noise=1e-6)
    slow = [s for s in steady_stretches(spin, 0.02) if s.speed_rad_s < 1000.0]
    assert bool(slow) is there


@pytest.mark.parametrize(("sigmas", "there"), [(5.0, False), (12.0, True)])
def test_below_six_of_the_noise_the_rotor_stands(sigmas: float, there: bool) -> None:
    """A slow stretch beside a faster one whose fiftieth is below the noise."""
    noise = 0.02
    # least squares of two lines: each component of the vector has noise sqrt(2)/3 * ... of a line
    sizes = np.abs(spin_of(np.arange(20000) * 1.0, np.zeros(20000), noise=noise).vector_v())
    sigma = math.sqrt(float(np.mean(sizes**2)))
    slow = sigmas * sigma / 4e-3
    speeds = np.concatenate([np.full(5000, 5.0 * slow), np.full(15000, slow)])
    spin = course(speeds, noise=noise)
    vector = spin.vector_v()
    size = np.abs(vector[6000:])
    seen = float(np.mean(size > 6.0 * sigma))
    found, spinning = steady_speed._stretches(spin, 0.02)
    assert spinning == pytest.approx(5000 + 15000 * seen, rel=0.03)
    assert bool([s for s in found if s.speed_rad_s < 2.0 * slow]) is there


# What the speeds of several captures say of the shaft


def group_of(name, ratio, *, offset=0.3, speed=300.0, theta=True, start=0.0):
    """One speed whose electrical angle is ratio times the shaft's, d axis ahead by `offset`."""
    t, phase, v = even(speed, start=start)
    sense = math.copysign(1.0, speed)
    axis = phase - sense * math.pi / 2.0
    shaft = (axis - offset) / ratio
    spin = spin_of(t, v, theta=shaft if theta else None)
    part = Stretch(np.arange(t.size), phase, np.full(t.size, speed))
    made = capture("open_circuit", name, t_s=t)
    return Group(made, spin, part, flux_of(spin, part, ()), 25.0)


@pytest.mark.parametrize("order", [1.0, -1.0])
def test_pole_pairs_phase_order_and_angle_of_several_speeds(order: float) -> None:
    """Offsets 0.28 and 0.32: their mean, and sd/sqrt(2) of it."""
    groups = [
        group_of("a", 7.0 * order, offset=0.28),
        group_of("b", 7.0 * order, offset=0.32, speed=-500.0),
    ]
    pairs, sense = count_pole_pairs(METHOD, groups)
    assert (pairs.value, sense.value) == (7, order)
    assert pairs.captures == ("a", "b")
    assert "a turn of theta_mech_rad:" in pairs.note
    angle = angle_offset(METHOD, groups, pairs, sense)
    assert angle.number == pytest.approx(0.30, abs=1e-6)
    apart = np.array([-0.02, 0.02])
    assert angle.u_a == pytest.approx(apart.std(ddof=1) / math.sqrt(2.0), rel=1e-4)
    assert [p.dof for p in angle.budget] == [1.0]
    alone = angle_offset(METHOD, groups[:1], pairs, sense)
    assert alone.u_a == pytest.approx(math.pi / 100.0)
    blind = [group_of("a", 7.0, theta=False)]
    assert not angle_offset(METHOD, blind, pairs, sense).known
    assert not count_pole_pairs(METHOD, blind)[0].known


def test_captures_that_disagree_on_the_count_or_the_order() -> None:
    pairs, order = count_pole_pairs(METHOD, [group_of("a", 7.0), group_of("b", 5.0)])
    assert "7.00000, 5.00000" in pairs.note
    assert not pairs.known
    assert order.value == 1
    pairs, order = count_pole_pairs(METHOD, [group_of("a", 7.0), group_of("b", -7.0)])
    assert pairs.value == 7
    assert "disagree on the phase order" in order.note
    pairs, _ = count_pole_pairs(METHOD, [group_of("a", 7.01)])
    assert pairs.value == 7
    assert "7.01000; 0.01 from the whole number" in pairs.note
    assert not count_pole_pairs(METHOD, [group_of("a", 7.03)])[0].known
