"""The parts of a turn by hand, each on arrays whose answer is worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.electrical.hand_turns import (
    _amplitude,
    _at_rest,
    _by_angle,
    _by_swings,
    _by_vector,
    _cycles,
    _ends,
    _excess,
    _extremes,
    _flux_of,
    _golden_section,
    _knots,
    _offset_at_rest,
    _one_swing,
    _steps_fit,
    turns_of,
)
from pipeline.estimation.electrical.spin import Channel, Spin
from pipeline.numerics.integrals import REST
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import white_noise_sigma

TURN = 2.0 * math.pi


def alternating(size: int, height: float) -> np.ndarray:
    """+height, -height, ...: noise of mean zero whose every difference is 2 height."""
    return height * (-1.0) ** np.arange(size)


def spin(t: np.ndarray, theta: np.ndarray | None = None, **volts: np.ndarray) -> Spin:
    """Line voltages vab, vbc as channels with gain sqrt(3)."""
    angles = {"vab_v": math.pi / 6.0, "vbc_v": -math.pi / 2.0}
    made = tuple(Channel(n, v, math.sqrt(3.0), angles[n]) for n, v in volts.items())
    return Spin(t, made, theta, None, None)


@pytest.mark.parametrize(
    ("flux", "reversal", "rows"),
    [
        ([0, 1, 2, 1, 0], 0.9, [2]),  # one maximum, reached from the start and left
        ([0, -1, -2, -1, 0], 0.9, [2]),
        ([0, 2, 0, -2, 0, 2, 0], 1.5, [1, 3, 5]),
        ([0, 2, 0, -2, 0, 2, 0], 2.0, [3]),  # left by as much as the reversal only does not count
        ([0, 2, 0, -2, 0, 2, 0], 4.0, []),
        ([2, 0, -2, 0, 2], 1.5, [2]),  # begins on an extreme
        ([0, 2, 1.9, 2.1, 0], 0.5, [3]),  # ripple within the reversal is one extreme
        ([0, 2, 2, 0], 0.5, [1]),
        ([0, -2, -2, 0], 0.5, [1]),
        ([0, 0.4, -0.2, 2.0, 1.0], 0.5, [2, 3]),
        ([0, -0.4, 0.2, -2.0, -1.0], 0.5, [2, 3]),
    ],
)
def test_extremes_are_reached_and_left_by_the_reversal(flux, reversal, rows) -> None:
    assert list(_extremes(np.array(flux, float), reversal)) == rows
    assert list(_extremes(-np.array(flux, float), reversal)) == rows


def test_knots_are_equally_far_along_the_way_there_and_back() -> None:
    """0 to 3 and back to 1 in steps of 0.25: a knot at each whole unit of the way, and the end."""
    phase = np.concatenate([np.arange(0.0, 3.0, 0.25), np.arange(3.0, 0.9, -0.25)])
    assert list(_knots(phase, 1.0)) == [0, 4, 8, 12, 16, 20]
    assert list(_knots(phase, 1.5)) == [0, 6, 12, 18, 20]
    assert list(_knots(np.arange(8.0), 3.0)) == [0, 3, 6, 7]


def test_the_golden_section_finds_either_ends_side() -> None:
    for at in (0.137, 0.5, 0.91):
        assert _golden_section(lambda x, at=at: (x - at) ** 2, 0.0, 1.0) == pytest.approx(
            at, abs=2e-6
        )
    calls: list[float] = []

    def counted(x: float) -> float:
        calls.append(x)
        return (x - 0.3) ** 2

    _golden_section(counted, -1.0, 1.0)
    # 2 shrinks by the golden ratio to 1e-6 in 31 steps of one value each, two to begin with
    assert len(calls) == 2 + math.ceil(math.log(2.0 / 1e-6) / math.log((1.0 + math.sqrt(5.0)) / 2))


def test_steps_of_flux_give_drift_and_both_amplitudes() -> None:
    t = np.array([0.0, 1.0, 3.0, 4.0, 6.0, 9.0])
    phase = np.array([0.0, 0.7, 1.9, 3.1, 4.4, 5.9])
    flux = 5.0 - 0.3 * t + 2.0 * np.cos(phase) - 1.5 * np.sin(phase)
    assert _steps_fit(t, flux, phase).coefficients == pytest.approx([-0.3, 2.0, -1.5])


def test_a_step_of_longer_duration_weighs_less() -> None:
    """Drift of one noisy step of 1 s and one of 4 s: the mean weighted by duration, 5/5 s."""
    t, phase = np.array([0.0, 1.0, 5.0, 6.0, 10.0]), np.zeros(5)
    flux = np.array([0.0, 1.0, 9.0, 10.0, 18.0])
    # slopes 1, 2, 1, 2 with weights 1/dt on squares of dt: sum(step)/sum(dt)
    assert _steps_fit(t, flux, phase).coefficients[0] == pytest.approx(1.8)


def test_rest_is_what_lies_before_the_first_loud_row_and_after_the_last() -> None:
    v = alternating(100, 0.01)
    v[30:70] += 5.0
    quiet = _at_rest(v)
    assert list(np.flatnonzero(~quiet)) == list(range(30, 70))
    # a median of 5 makes the ends loud: too few rows at rest are none
    v = alternating(100, 0.01)
    v[9:91] += 5.0
    assert _at_rest(v).all()
    for rest, count in ((19, 60), (20, 20)):
        v = alternating(60, 0.01)
        v[10 : 30 + (rest == 19)] += 5.0
        v[30 + (rest == 19) : 70 - rest] -= 5.0
        assert np.count_nonzero(_at_rest(v)) == count


def test_flux_is_the_integral_of_the_voltage_less_its_rest_over_the_gain() -> None:
    t = np.arange(400) * 0.01
    v = np.full(400, 0.5) + alternating(400, 1e-6)
    v[100:200] += 2.0 * math.sqrt(3.0)
    flux = _flux_of(spin(t, vab_v=v), Channel("vab_v", v, math.sqrt(3.0), 0.0))
    assert flux[-1] - flux[0] == pytest.approx(2.0 * 1.0, rel=1e-4)


def test_the_offset_at_rest_and_its_uncertainty() -> None:
    """90 rows of rest before and 60 after: the outer 30 and 20 give the offset."""
    sigma = 1e-3
    v = 0.2 + alternating(400, sigma)
    v[90:340] += 3.0
    offset, u = _offset_at_rest(v)
    assert offset == pytest.approx(0.2, abs=1e-6)
    assert u == pytest.approx(white_noise_sigma(v) / math.sqrt(50.0), rel=1e-3)


def test_a_hand_that_moves_at_rest_is_in_the_offsets_uncertainty() -> None:
    """Inner thirds 4 mV higher, a third of all rows: half of the 8/3 mV that the mean moves."""
    v = alternating(540, 1e-3)
    v[:90][60:] += 4e-3
    v[-90:][:30] += 4e-3
    v[90:-90] += 3.0
    offset, u = _offset_at_rest(v)
    moved = 4e-3 / 3.0
    assert offset == pytest.approx(0.0, abs=1e-6)
    expected = math.hypot(white_noise_sigma(v) / math.sqrt(60.0), 0.5 * moved)
    assert u == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("before", "after"), [(2, 50), (50, 2)])
def test_without_rest_at_both_ends_the_offset_is_the_mean(before: int, after: int) -> None:
    v = alternating(300, 1e-3)
    v[before:150] += 3.0
    v[150 : 300 - after] -= 2.0
    offset, u = _offset_at_rest(v)
    assert offset == pytest.approx(float(v.mean()))
    assert u == pytest.approx(float(v.std()))


def test_three_rows_of_rest_are_enough() -> None:
    v = alternating(300, 1e-3)
    v[3:150] += 3.0
    v[150:297] -= 2.0
    assert _offset_at_rest(v)[0] == pytest.approx(0.0, abs=2e-3)


def half_waves(start: float, end: float, count: int, amplitude: float = 2.0):
    """A flux of extremes at +-amplitude in turn between a start and an end, one second each."""
    first = 1.0 if start < amplitude else -1.0
    flux = np.array([start, *(first * amplitude * (-1.0) ** np.arange(count)), end])
    return np.arange(flux.size, dtype=float), flux, np.arange(1, count + 1)


def test_ends_give_drift_amplitude_and_both_broken_levels() -> None:
    t, flux, turning = half_waves(0.5, -0.75, 6)
    fit = _ends(t, flux + 0.01 * t + 7.0, turning, 1e-3, 1.0)
    drift, amplitude, start, end = fit.coefficients
    assert drift == pytest.approx(0.01, rel=1e-5)
    assert (amplitude, start, end) == pytest.approx((2.0, 0.5, -0.75), rel=1e-5)


def test_ends_hold_the_drift_to_what_the_rest_knows() -> None:
    """With no freedom the drift is none and its uncertainty that of the rest."""
    t, flux, turning = half_waves(0.5, 0.5, 6)
    fit = _ends(t, flux + 0.01 * t, turning, 1.0, 1e-6)
    assert fit.coefficients[0] == pytest.approx(0.0, abs=1e-7)
    assert math.sqrt(fit.covariance[0, 0]) == pytest.approx(1e-6, rel=1e-3)
    # an amplitude over n - 1 steps of two of it, each of variance rate^2 dt, is rate/(2 sqrt(n-1))
    assert math.sqrt(fit.covariance[1, 1]) == pytest.approx(1.0 / (2.0 * math.sqrt(5.0)), rel=1e-3)
    assert fit.dof == 4
    assert _excess(fit) == fit.chi2_dof


def test_no_freedom_is_no_excess() -> None:
    fit = linear_fit(np.eye(3), np.array([1.0, 2.0, 3.0]), np.ones(3))
    assert fit.dof == 0
    assert _excess(fit) == 1.0


@pytest.mark.parametrize(
    ("start", "end", "count", "cycles"),
    [
        (0.5, 0.5, 6, 3.0),  # closes on its start: p = extremes / 2
        (-1.2, -1.2, 4, 2.0),
        # broken ends by arc cosine: acos(0.25) and acos(-0.5) beside five half cycles
        (0.5, 1.0, 6, (5.0 * math.pi + math.acos(0.25) + math.acos(-0.5)) / TURN),
        (-1.0, 0.0, 5, (4.0 * math.pi + math.acos(-0.5) + math.acos(0.0)) / TURN),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_cycles_of_a_record(start, end, count, cycles, sign) -> None:
    t, flux, turning = half_waves(start, end, count)
    fit = _ends(t, sign * flux, turning, 1e-4, 1e-4)
    first = math.copysign(1.0, sign * (flux[1] - flux[2]))
    # _ends puts the first extreme at first * amplitude, as the caller's sense does
    assert _cycles(fit, count, first, 1e-6) == pytest.approx(cycles, abs=1e-3)


@pytest.mark.parametrize(("near", "cycles"), [(1.99, 2.0), (-1.99, 3.0)])
def test_an_extreme_hidden_at_both_ends_closes(near, cycles) -> None:
    """Five extremes, both ends a hundredth from one: beside the first, one less; else one more."""
    t, flux, turning = half_waves(near, near, 5)
    fit = _ends(t, flux, turning, 1e-4, 1e-4)
    assert _cycles(fit, 5, 1.0, 0.02) == cycles
    # where noise could not hide it, the ends are broken cycles
    broken = (4.0 * math.pi + 2.0 * math.acos(near / 2.0)) / TURN
    assert _cycles(fit, 5, 1.0, 0.002) == pytest.approx(broken, abs=1e-3)


def test_two_ends_on_extremes_of_other_sides_do_not_close() -> None:
    t, flux, turning = half_waves(1.99, -1.99, 5)
    fit = _ends(t, flux, turning, 1e-4, 1e-4)
    pieces = math.acos(0.995) + math.acos(-0.995)
    assert _cycles(fit, 5, 1.0, 0.02) == pytest.approx((4.0 * math.pi + pieces) / TURN, abs=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_swing_is_one_pole_pair_and_as_unsure_as_what_hides(sign: float) -> None:
    """From 0.1 over -3.9 to 0.3: 4.1 deep, so A = 2.05 + h/4 with u = h/4."""
    flux = sign * np.array([0.1, -2.0, -3.9, -2.0, 0.3])
    t = np.arange(5.0)
    channel = Channel("vab_v", flux, 1.0, 0.0)
    found = _one_swing(spin(t), channel, flux, np.array([2]), 0.4)
    assert found is not None
    assert (found.cycles, found.dof) == (1.0, math.inf)
    assert found.psi_wb == pytest.approx(2.05 + 0.1)
    assert found.u_psi_wb == pytest.approx(0.1)
    assert _one_swing(spin(t), channel, flux, np.array([2]), 0.19) is None
    assert _one_swing(spin(t), channel, flux, np.array([], dtype=int), 0.4) is None


def turning(p: int, *, psi: float = 2e-3, n: int = 3001, rest: int = 300, offset: float = 0.0):
    """(t, theta, vab, vbc) of one turn of 1.5 s at an even change of pace, rest at both ends."""
    t = np.arange(n + 2 * rest) * 5e-4
    u = np.clip((t - t[rest]) / (t[rest + n - 1] - t[rest]), 0.0, 1.0)
    theta = TURN * (u - np.sin(TURN * u) / TURN)
    pace = TURN * (1.0 - np.cos(TURN * u)) / (t[rest + n - 1] - t[rest])
    v = [-p * psi * pace * np.sin(p * theta - TURN * k / 3.0) for k in range(3)]
    ripple = alternating(t.size, 1e-4)
    return t, theta, v[0] - v[1] + offset + ripple, v[1] - v[2] - offset + ripple


@pytest.mark.parametrize("p", [1, 3, 12])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_by_angle_each_voltage_has_its_own_cycles_and_flux(p: int, sense: float) -> None:
    t, theta, vab, vbc = turning(p, offset=0.01)
    found = _by_angle(spin(t, vab_v=vab, vbc_v=vbc), spin(t, vab_v=vab, vbc_v=vbc).channels,
                      sense * theta)  # fmt: skip
    assert [turn.channel for turn in found] == ["vab_v", "vbc_v"]
    for turn in found:
        assert turn.cycles == pytest.approx(p, abs=1e-4)
        assert turn.psi_wb == pytest.approx(2e-3, rel=1e-5)
        # the trace and its fit are one curve, level included
        assert turn.fitted_wb == pytest.approx(turn.flux_wb, abs=2e-6)


def test_by_angle_half_a_turn_counts_and_less_does_not() -> None:
    t, theta, vab, _ = turning(4)
    for share, count in ((0.51, 1), (0.49, 0)):
        rows = theta <= share * TURN
        part = spin(t[rows], vab_v=vab[rows])
        assert len(_by_angle(part, part.channels, theta[rows])) == count
    few = spin(t[::80], vab_v=vab[::80])
    assert len(_by_angle(few, few.channels, theta[::80])) == 0  # fewer than 50 knots


def test_a_geared_angle_gives_a_broken_count() -> None:
    t, theta, vab, _ = turning(3)
    made = spin(t, vab_v=vab)
    (turn,) = _by_angle(made, made.channels, theta / 1.1)
    assert turn.cycles == pytest.approx(3.3, abs=1e-3)


@pytest.mark.parametrize("p", [2, 7])
def test_by_vector_the_phase_counts_and_a_drift_is_taken_off(p: int) -> None:
    t, _, vab, vbc = turning(p)
    # a thermal drift of the amplifiers, which rest at both ends does not show
    found = _by_vector(spin(t, vab_v=vab + 2e-4 * np.sin(t), vbc_v=vbc - 1e-4 * np.cos(t)))
    assert [turn.channel for turn in found] == ["vab_v", "vbc_v"]
    for turn in found:
        assert turn.cycles == pytest.approx(p, abs=0.02)
        assert turn.psi_wb == pytest.approx(2e-3, rel=3e-3)


@pytest.mark.parametrize("p", [2, 5])
def test_by_swings_one_voltage_alone(p: int) -> None:
    t, _, vab, _ = turning(p, offset=0.02)
    turn = _by_swings(spin(t, vab_v=vab), spin(t, vab_v=vab).channels[0])
    assert turn is not None
    assert turn.cycles == p
    assert turn.psi_wb == pytest.approx(2e-3, rel=1e-3)
    # steps between samples hide up to (step/A)^2/12 of an extreme
    step = float(np.abs(np.diff(turn.flux_wb)).max()) / turn.psi_wb
    assert turn.u_psi_wb >= turn.psi_wb * step**2 / 12.0


@pytest.mark.parametrize("offset", [-0.005, 0.005])
def test_the_flux_of_a_voltage_that_never_rests_is_shown_without_its_drift(offset: float) -> None:
    """Its extremes lie at +A and -A in turn, whatever the amplifier adds."""
    t, theta, vab, _ = turning(5)
    moving = np.flatnonzero(np.abs(np.gradient(theta, t)) > 0.1)
    rows = slice(int(moving[0]), int(moving[-1]))
    made = spin(t[rows], vab_v=vab[rows] + offset)
    turn = _by_swings(made, made.channels[0])
    assert turn is not None
    found = _extremes(turn.flux_wb, 2e-3)
    assert found.size >= 8
    assert np.ptp(np.abs(np.diff(turn.flux_wb[found]))) < 0.01 * 2e-3
    level = turn.flux_wb[found][1:] + turn.flux_wb[found][:-1]
    assert np.ptp(level) < 0.01 * 2e-3
    assert turn.psi_wb == pytest.approx(2e-3, rel=2e-3)


def test_the_uncertainty_of_an_amplitude_counts_correlated_steps() -> None:
    """U = sqrt(slope C slope tau), with what a cubic of few rows a cycle leaves."""
    t, theta, vab, _ = turning(3)
    made = spin(t, vab_v=vab)
    rng = np.random.default_rng(4)
    flux = 2e-3 * np.cos(3 * theta + 0.5) + 1e-6 * np.cumsum(rng.standard_normal(t.size))
    turn = _amplitude(made, made.channels[0], flux, 3.0 * theta, 3.0)
    assert turn is not None
    rows = _knots(3.0 * theta, TURN / 24.0)
    fit = _steps_fit(t[rows], flux[rows], 3.0 * theta[rows])
    tau = autocorrelation_time(fit.residuals)
    a, b = fit.coefficients[1:]
    size = math.hypot(a, b)
    # of a and b by their own variances and their covariance
    c = fit.covariance
    u2 = (a * a * c[1, 1] + b * b * c[2, 2] + 2.0 * a * b * c[1, 2]) / size**2 * tau
    step = 3.0 * float(np.abs(np.diff(theta)).max())
    assert turn.psi_wb == pytest.approx(size)
    assert turn.u_psi_wb == pytest.approx(math.hypot(math.sqrt(u2), size * REST * step**4))
    assert turn.dof == pytest.approx(max(fit.dof / tau, 1.0))
    assert _amplitude(made, made.channels[0], flux, 0.3 * theta, 0.3) is None  # seven knots


def test_a_turn_is_read_by_the_best_that_is_there() -> None:
    t, theta, vab, vbc = turning(5)
    both = {"vab_v": vab, "vbc_v": vbc}
    assert [x.fitted_wb.size > 0 for x in turns_of(spin(t, theta, vab_v=vab))] == [True]
    assert len(turns_of(spin(t, None, **both))) == 2
    (alone,) = turns_of(spin(t, None, vab_v=vab))
    assert alone.fitted_wb.size == 0  # by swings, which fit no curve
    holed = theta.copy()
    holed[7] = np.nan
    assert turns_of(spin(t, holed, vab_v=vab))[0].fitted_wb.size == 0
    # a quiet channel is left out
    quiet = alternating(t.size, 1e-3)
    assert [x.channel for x in turns_of(spin(t, theta, vab_v=vab, vbc_v=quiet))] == ["vab_v"]
    assert turns_of(spin(t, theta, vab_v=quiet)) == []


@pytest.mark.parametrize(("height", "there"), [(5.3, True), (4.7, False)])
def test_a_voltage_is_loud_from_five_of_its_noise(height: float, there: bool) -> None:
    """A tenth of the rows at `height` sigma: their 0.9 quantile in magnitude."""
    t, theta, *_ = turning(2)
    v = alternating(t.size, 1e-3)
    rows = slice(t.size // 3, t.size // 3 + t.size // 7)
    v[rows] = height * white_noise_sigma(v)
    assert float(np.quantile(np.abs(v), 0.9)) / white_noise_sigma(v) == pytest.approx(height)
    assert bool(turns_of(spin(t, theta, vab_v=v))) is there


def test_a_hand_that_moves_at_one_end_alone() -> None:
    """The inner third of the last rest 8 mV higher: as much as 4 mV at both."""
    v = alternating(540, 1e-3)
    v[-90:][:30] += 8e-3
    v[90:-90] += 3.0
    offset, u = _offset_at_rest(v)
    assert offset == pytest.approx(0.0, abs=1e-6)
    expected = math.hypot(white_noise_sigma(v) / math.sqrt(60.0), 0.5 * 8e-3 / 6.0)
    assert u == pytest.approx(expected, rel=1e-3)


def test_fifty_knots_are_enough_of_an_angle() -> None:
    for rows, count in ((50, 1), (49, 0)):
        theta = np.linspace(0.0, TURN, rows)
        t = np.arange(rows) * 0.01
        v = -np.sin(theta) * TURN / t[-1]
        made = spin(t, vab_v=v)
        assert len(_by_angle(made, made.channels, theta)) == count


@pytest.mark.parametrize(("times", "closes"), [(2.9, True), (3.1, False)])
def test_a_record_closes_within_three_of_its_own_uncertainties(times: float, closes: bool) -> None:
    """Extremes exact, so nothing widens it: u of end less start from the fit's covariance."""
    t, flux, turning_ = half_waves(0.5, 0.5, 6)
    apart = np.array([0.0, 0.0, -1.0, 1.0])
    u = math.sqrt(apart @ _ends(t, flux, turning_, 1e-3, 1e-9).covariance @ apart)
    flux[-1] += times * u
    fit = _ends(t, flux, turning_, 1e-3, 1e-9)
    assert fit.coefficients[3] - fit.coefficients[2] == pytest.approx(times * u, rel=1e-3)
    assert (_cycles(fit, 6, 1.0, 1e-9) == 3.0) is closes


def test_few_rows_a_cycle_are_the_uncertainty_of_an_extreme() -> None:
    """(omega T)^2 / 12 of the amplitude, by the largest step of the flux."""
    t, _, vab, _ = turning(2, n=201, rest=60)
    smooth = vab - alternating(t.size, 1e-4) + alternating(t.size, 1e-9)
    turn = _by_swings(spin(t, vab_v=smooth), spin(t, vab_v=smooth).channels[0])
    assert turn is not None
    step = float(np.abs(np.diff(turn.flux_wb)).max()) / turn.psi_wb
    assert turn.cycles == 2.0
    assert turn.u_psi_wb == pytest.approx(turn.psi_wb * step**2 / 12.0, rel=0.1)
    assert turn.psi_wb == pytest.approx(2e-3, rel=step**2 / 8.0)


def test_by_vector_a_centre_that_wanders_far_is_found() -> None:
    """No rest, and offsets that move the centre by half the flux over the turn."""
    t, _, vab, vbc = turning(3, rest=0)
    slow = 4e-4 * np.linspace(-1.0, 1.0, t.size)
    found = _by_vector(spin(t, vab_v=vab + 2e-3 + slow, vbc_v=vbc - 1e-3))
    for turn in found:
        assert turn.cycles == pytest.approx(3.0, abs=0.05)
        assert turn.psi_wb == pytest.approx(2e-3, rel=0.02)
