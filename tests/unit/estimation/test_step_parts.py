"""Step records part by part: waveforms, groups, resistances and the equation of the current."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.step_budget import (
    birge_ratio,
    gains,
    rotor_angles,
    unexplained,
)
from pipeline.estimation.electrical.step_fit import (
    _fit,
    _white_power,
    between_models,
    bic_penalty,
    offers_of,
    row_variance,
    solve,
)
from pipeline.estimation.electrical.step_model import StepModel, _covered, _steps
from pipeline.estimation.electrical.step_parameters import (
    LD,
    LQ,
    SHARED,
    difference_widths,
    drive_of,
    slots_of,
    start_of,
)
from pipeline.estimation.electrical.step_record import (
    _cuts,
    _spikes,
    disagreement,
    integrated_form,
    read_step,
    rotor_angle_rad,
)
from pipeline.estimation.electrical.step_wave import (
    BETWEEN,
    Noise,
    _is_noise,
    _lines_and_edges,
    _sampled,
    noise_of,
    waveform_of,
)
from pipeline.estimation.estimators import current_step
from pipeline.estimation.estimators.current_step import _chord, inductances
from pipeline.numerics.least_squares import autocorrelation_time
from tests.unit.estimation.signals import capture, estimates

R, L = 1.2, 1.8e-3
PERIOD = 2e-5


def rise(t, *, volts=6.0, source=0.0, on=2e-3, off=16e-3, r=R, l=L):
    """Voltage and current between terminals of r and l behind a supply on from `on` to `off`."""
    loop = r + source
    up = [-np.expm1(-np.maximum(t - x, 0.0) * loop / l) for x in (on, off)]
    current = volts / loop * (up[0] - up[1])
    return np.where((t > on) & (t <= off), volts, 0.0) - source * current, current


def step(seed=0, *, noise=1e-3, path="step", theta=-30.0, **how):
    rng = np.random.default_rng(seed)
    t = np.arange(1200) * PERIOD
    v, i = rise(t, **{"on": 100.5 * PERIOD, "off": 800.5 * PERIOD} | how)
    return capture(
        "current_step", path, pair="ab", theta_elec_deg=theta, t_s=t,
        vab_v=v + noise * rng.standard_normal(t.size),
        ia_a=i + noise * rng.standard_normal(t.size),
    )  # fmt: skip


# Records


def test_the_integrated_form_solves_r_and_l() -> None:
    """A ramp of current that any r and l follow: v = l di/dt + r i, exactly for trapezoids."""
    t = np.arange(200) * 1e-4
    i = 3.0 * t + 40.0 * np.sin(50.0 * t)
    v = 2.0 * i + 5e-3 * (3.0 + 2000.0 * np.cos(50.0 * t))
    found = integrated_form(t, v, i)
    assert found is not None
    assert found == pytest.approx((5e-3, 2.0), rel=1e-3)
    assert integrated_form(t, -v, i) is None  # a negative inductance
    assert integrated_form(t, -2.0 * i + (v - 2.0 * i), i) is None  # a negative resistance
    assert integrated_form(t, np.zeros(200), i) is None


@pytest.mark.parametrize(("height", "count"), [(7.9, 0), (8.1, 1)])
def test_a_spike_is_beyond_eight_of_the_noise(height: float, count: int) -> None:
    rng = np.random.default_rng(1)
    base = 1e-2 * rng.standard_normal(400)
    middle = 200
    base[middle - 2 : middle + 3] = 0.0
    signal = base.copy()
    for _ in range(9):  # one sample moves the noise a little
        signal[middle] = height * max(noise_of(signal).sigma, noise_of(signal).step)
    assert np.count_nonzero(_spikes(signal)) == count
    assert not _spikes(np.array([0.0, 0.0, 9.0, 0.0])).any()  # four samples have no median of five
    ramp = np.repeat([0.0, 5.0], 50) + 1e-3 * rng.standard_normal(100)
    assert not _spikes(ramp).any()
    ends = 1e-3 * rng.standard_normal(100)
    ends[1], ends[98] = 1.0, -1.0
    assert list(np.flatnonzero(_spikes(ends))) == [1, 98]


def test_the_rotors_angle_is_as_stated_else_the_mean() -> None:
    t = np.arange(4.0)
    angle = np.array([0.1, np.nan, 0.3, 0.2])
    assert rotor_angle_rad(capture("current_step", t_s=t)) is None
    assert rotor_angle_rad(capture("current_step", t_s=t, theta_elec_rad=angle)) == pytest.approx(
        0.2
    )
    stated = capture("current_step", t_s=t, theta_elec_rad=angle, theta_elec_deg=90.0)
    assert rotor_angle_rad(stated) == pytest.approx(math.pi / 2.0)


def test_a_record_reads_what_was_put_in() -> None:
    made = step(noise=1e-4)
    found = read_step(made)
    assert found is not None
    assert found.l_start_h == pytest.approx(L, rel=0.03)
    assert found.r_start_ohm == pytest.approx(R, rel=0.01)
    assert found.axis_rad == pytest.approx(-math.pi / 6.0 + math.pi / 6.0, abs=1e-12)
    assert found.largest_a == pytest.approx(5.0, rel=1e-3)
    assert found.count.sum() == 1200
    assert found.starts_settled
    assert not found.commanded
    assert found.wave.source_ohm == pytest.approx(0.0, abs=1e-3)
    assert found.wave.edges_s == pytest.approx(np.array([0.0, 100.5, 800.5, 1200.0]) * PERIOD)
    assert found.wave.levels_v == pytest.approx([0.0, 6.0, 0.0], abs=1e-3)
    with pytest.raises(KeyError, match="pair"):
        read_step(replace(made, meta=replace(made.meta, theta_elec_deg=None)))


def test_a_current_below_ten_of_its_noise_is_no_step() -> None:
    t = np.arange(400) * PERIOD
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(400)
    noise -= noise.mean()
    for rows, there in ((400, True), (49, False)):
        v, i = rise(t, on=100.5 * PERIOD, off=1.0)
        keep = slice(100, 100 + rows) if rows < 400 else slice(None)
        made = capture("current_step", pair="ab", theta_elec_deg=0.0, t_s=t[keep],
                       vab_v=v[keep], ia_a=i[keep] + 1e-3 * noise[keep])  # fmt: skip
        assert (read_step(made) is not None) is there
    flat = capture("current_step", pair="ab", theta_elec_deg=0.0, t_s=t, vab_v=v, ia_a=noise)
    assert read_step(flat) is None


@pytest.mark.parametrize(("ratio", "odd"), [(99.0, False), (101.0, True)])
def test_inductances_a_hundred_apart_are_not_of_one_rotor(ratio: float, odd: bool) -> None:
    found = read_step(step(noise=1e-4))
    assert found is not None
    others = [replace(found, l_start_h=scale) for scale in (1e-3, 1e-3)]
    strange = replace(found, l_start_h=ratio * 1e-3, capture=replace(found.capture, path="odd"))
    words = disagreement([*others, strange])
    assert bool(words) is odd
    if odd:
        assert "odd (101 times the usual L)" in words
        assert words.count("times the usual") == 1
    # of two that disagree nobody knows which
    assert disagreement([others[0], replace(strange, l_start_h=0.2)]).count("times") == 2
    assert disagreement([strange]) == ""


def test_groups_do_not_straddle_an_edge() -> None:
    found = read_step(step(noise=1e-4))
    assert found is not None
    cuts = _cuts(1200, found.wave)
    assert list(cuts) == list(range(1200))  # fewer samples than bins: each its own
    level = np.repeat([0, 1, 2], [4001, 2998, 3001])
    wave = replace(found.wave, level_of=level)
    cuts = _cuts(10_000, wave)
    around = {edge + d for edge in (4001, 6999) for d in range(-2, 3)}
    assert set(cuts) == {*range(0, 10_000, 3), *around}
    assert list(_cuts(10_000, replace(wave, level_of=level[:0]))) == list(range(0, 10_000, 3))


# Waveforms


def test_a_supply_with_resistance_is_found_by_its_sag() -> None:
    t = np.arange(1200) * PERIOD
    v, i = rise(t, source=0.3, on=100.5 * PERIOD, off=800.5 * PERIOD)
    rng = np.random.default_rng(0)
    v, i = v + 1e-3 * rng.standard_normal(1200), i + 1e-3 * rng.standard_normal(1200)
    wave = waveform_of(t, v, i, "instant")
    assert wave.has_supply
    assert wave.source_ohm == pytest.approx(0.3, rel=1e-2)
    assert wave.levels_v == pytest.approx([0.0, 6.0, 0.0], abs=5e-3)
    assert wave.moves.tolist() == [[0, 0], [1, 0], [0, 1], [0, 0]]
    assert set(wave.level_of[:100]) == {0}
    assert set(wave.level_of[102:800]) == {1}
    # an ideal supply cannot sag: its samples are taken one by one
    assert not waveform_of(t, v, i, "instant", ideal=True).has_supply


def test_more_edges_than_a_supply_makes_are_an_inverters() -> None:
    t = np.arange(3000) * PERIOD
    rng = np.random.default_rng(0)
    for edges, there in ((12, True), (13, False)):
        places = np.linspace(150, 2850, edges).astype(int)
        v = 5.0 * (np.searchsorted(places, np.arange(3000), side="right") % 2).astype(float)
        v += 1e-3 * rng.standard_normal(3000)
        assert waveform_of(t, v, np.zeros(3000), "instant", ideal=True).has_supply is there


@pytest.mark.parametrize(("share", "jumps"), [(0.098, 0), (0.102, 1)])
def test_a_jump_is_a_tenth_of_the_span(share: float, jumps: int) -> None:
    """A slow ramp of 1 V, with one jump of a share of the span in it."""
    t = np.arange(2001) * PERIOD
    rest = 1.0 - share
    v = rest * t / t[-1] + np.where(np.arange(2001) > 1000, share, 0.0)
    v += rest * 0.0
    wave = waveform_of(t, v, np.zeros(2001), "instant", ideal=True)
    assert wave.moves.shape[1] == (jumps or 1)
    # with no edge all the voltage moves; with one, its edge alone
    assert wave.moves.all() == (jumps == 0)


def test_is_noise_by_the_means_of_eight_blocks() -> None:
    """Blocks of 50: five standard errors of a mean, with the rounding's, and half a sample."""
    none = np.zeros(400)
    for times, fine in ((4.9, True), (5.1, False)):
        residuals = np.zeros(400)
        residuals[50:100] = times * 0.01 / math.sqrt(50.0)
        assert _is_noise(residuals, none, 0.01, 0.0) is fine
        residuals[50:100] = -times * math.hypot(0.01 / math.sqrt(50.0), 0.003)
        assert _is_noise(residuals, none, 0.01, 0.003) is fine
        # half a sample between channels of a current that rises by 49 over the block
        residuals[50:100] = 5.0 * 0.01 / math.sqrt(50.0) + (times / 5.0) * 49.0 / 50.0
        assert _is_noise(residuals, np.arange(400.0), 0.01, 0.0) is fine
    assert _is_noise(np.full(15, 9.0), np.zeros(15), 1.0, 0.0)
    assert not _is_noise(np.full(16, 9.0), np.zeros(16), 1.0, 0.0)


@pytest.mark.parametrize("timing", ["held", "centred", "instant"])
def test_sampled_cells_keep_the_integral(timing: str) -> None:
    """4000 samples into cells of three; what a cell holds is the integral by the timing."""
    t = np.arange(4000) * 2.0
    v = np.sin(t / 300.0)
    wave = _sampled(t, v, timing, [], 2.0)
    ends = {"held": (0.0, 8000.0), "centred": (-1.0, 7999.0), "instant": (0.0, 7998.0)}[timing]
    assert (wave.edges_s[0], wave.edges_s[-1]) == ends
    assert wave.levels_v.size == math.ceil((4000 - (timing == "instant")) / 3)
    area = float(wave.levels_v @ np.diff(wave.edges_s))
    whole = {"held": 2.0 * v.sum(), "centred": 2.0 * v.sum(),
             "instant": 2.0 * (v.sum() - 0.5 * (v[0] + v[-1]))}[timing]  # fmt: skip
    assert area == pytest.approx(whole)
    second = {"held": v[3:6].mean(), "centred": v[3:6].mean(),
              "instant": (0.5 * v[3] + v[4] + v[5] + 0.5 * v[6]) / 3.0}[timing]  # fmt: skip
    assert wave.levels_v[1] == pytest.approx(second)
    assert wave.moves.tolist() == np.ones((wave.edges_s.size, 1)).tolist()
    assert not wave.has_supply
    assert wave.period_s == 2.0


def test_lines_between_samples_and_an_edge_in_a_jump() -> None:
    """0 0 | 4 4 with the jump from row 1 to 2: an edge half way, and lines elsewhere."""
    t, v = np.arange(6.0), np.array([0.0, 0.2, 4.0, 4.2, 4.4, 4.6])
    edges, means, free = _lines_and_edges(t, v, [np.array([1])])
    assert edges.tolist() == [0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0]
    assert means == pytest.approx([0.1, 0.2, 4.0, 4.1, 4.3, 4.5])
    assert free == [[2]]
    # a jump over two intervals: its middle sample is on the way
    edges, means, free = _lines_and_edges(t, v, [np.array([1, 2])])
    assert edges.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert means == pytest.approx([0.1, 0.2, 4.2, 4.3, 4.5])
    assert free == [[2]]
    # a rise of three intervals moves as it was sampled, its nodes together
    edges, means, free = _lines_and_edges(t, v, [np.array([1, 2, 3])])
    assert edges.tolist() == t.tolist()
    assert means == pytest.approx(0.5 * (v[1:] + v[:-1]))
    assert free == [[1, 2, 3, 4]]
    # from the first sample on, to the last: the ends of a record stay
    assert _lines_and_edges(t, v, [np.array([0, 1, 2])])[2] == [[1, 2, 3]]
    assert _lines_and_edges(t, v, [np.array([2, 3, 4])])[2] == [[2, 3, 4]]


def test_noise_of_a_channel_is_at_least_a_millionth_of_its_span() -> None:
    assert noise_of(np.linspace(0.0, 3.0, 500)).sigma == pytest.approx(3e-6, rel=0.2)
    assert noise_of(np.zeros(50)).sigma == 1e-12
    rng = np.random.default_rng(0)
    assert noise_of(0.02 * rng.standard_normal(4000)).sigma == pytest.approx(0.02, rel=0.06)


# The equation of the current


def model_of(*captures):
    records = [read_step(one) for one in captures]
    assert all(records)
    return StepModel([one for one in records if one], inductances)


def parameters_of(model, ld=L / 2.0, lq=L / 2.0, **own):
    values = start_of(model.records, model.layout)
    values[: len(SHARED)] = 0.0
    values[LD], values[LQ] = ld, lq
    return values


@pytest.mark.parametrize("source", [0.0, 0.4])
def test_a_constant_inductance_gives_the_closed_form(source: float) -> None:
    """V and i at every sample, with an edge moved by a share of a sample and an offset."""
    made = step(noise=1e-4, source=source)
    model = model_of(made)
    (record,) = model.records
    values = parameters_of(model)
    at, own = model.layout.starts[0], model.layout.slots[0]
    values[at] = R
    values[at + own.source_ohm] = source
    values[at + own.offset_a] = 0.25
    values[at + own.moves.start] = 100.8 - record.wave.edges_s[1] / PERIOD
    values[at + own.moves.start + 1] = 800.5 - record.wave.edges_s[2] / PERIOD
    values[at + own.levels_v.start : at + own.levels_v.stop] = 0.0, 6.0, 0.0
    (read,) = model.predict_both([values[None, :]])
    v, i = rise(record.t_s, source=source, on=100.8 * PERIOD, off=800.5 * PERIOD)
    assert read[0][:, 0] == pytest.approx(i + 0.25, abs=1e-6)
    there = record.level != BETWEEN
    assert read[1][there, 0] == pytest.approx(v[there], abs=1e-6)


def test_a_capture_that_starts_unsettled_has_its_first_current() -> None:
    """By lines between samples: from 2 A at the start, through 0 V, i = 2 exp(-t r/l)."""
    made = step(noise=1e-4)
    model = model_of(made)
    (record,) = model.records
    wave = _sampled(record.t_s, np.zeros(record.t_s.size), "held", [], PERIOD)
    bare = replace(record, wave=wave, level=np.full(record.t_s.size, BETWEEN), starts_settled=False)
    model = StepModel([bare], inductances)
    own = model.layout.slots[0]
    assert (own.source_ohm, own.offset_a, own.drop_v) == (None, 1, None)
    assert own.first_a == 2
    values = parameters_of(model)
    at = model.layout.starts[0]
    values[at], values[at + own.first_a] = R, 2.0
    (current,) = model.predict([values[None, :]])
    assert current[:, 0] == pytest.approx(2.0 * np.exp(-record.t_s * R / L), rel=1e-9)


@pytest.mark.parametrize(("theta", "mix"), [(-30.0, 1.0), (60.0, 0.0), (15.0, 0.5)])
def test_the_pair_sees_twice_the_mix_of_both_axes(theta: float, mix: float) -> None:
    """2 (cos^2 Ld + sin^2 Lq), by the time constant of the prediction."""
    model = model_of(step(noise=1e-4, theta=theta))
    values = parameters_of(model, ld=4e-4, lq=1.2e-3)
    at, own = model.layout.starts[0], model.layout.slots[0]
    values[at], values[at + own.source_ohm] = R, 0.0
    values[at + own.levels_v.start : at + own.levels_v.stop] = 0.0, 6.0, 0.0
    values[at + own.offset_a] = 0.0
    (current,) = model.predict([values[None, :]])
    l_pair = 2.0 * (mix * 4e-4 + (1.0 - mix) * 1.2e-3)
    _, i = rise(model.records[0].t_s, l=l_pair, on=100.5 * PERIOD, off=800.5 * PERIOD)
    assert current[:, 0] == pytest.approx(i, abs=1e-6)


def test_an_inverters_drop_is_against_the_current() -> None:
    """Settled at (v - drop)/r; below a knee of 2 % of the largest current it fades."""
    made = step(noise=1e-4)
    made = replace(made, meta=replace(made.meta, voltage_kind="commanded"))
    model = model_of(made)
    (record,) = model.records
    at, own = model.layout.starts[0], model.layout.slots[0]
    assert own.source_ohm is None
    values = parameters_of(model)
    values[at], values[at + own.drop_v], values[at + own.offset_a] = R, 0.9, 0.0
    values[at + own.levels_v.start : at + own.levels_v.stop] = 0.0, 6.0, 0.0
    (current,) = model.predict([values[None, :]])
    assert current[799, 0] == pytest.approx((6.0 - 0.9) / R, rel=1e-4)
    # 0.1 V: at a small current the drop acts as a resistance of drop / knee
    values[at + own.levels_v.start + 1] = 0.1
    knee = 0.02 * record.largest_a
    (current,) = model.predict([values[None, :]])
    assert current[799, 0] == pytest.approx(0.1 / (R + 0.9 / knee), rel=1e-3)


def test_the_jacobian_is_that_of_the_residuals() -> None:
    """Each column against a central difference of the residuals themselves."""
    model = model_of(step(noise=1e-3, source=0.2, theta=15.0))
    values = start_of(model.records, model.layout)
    free = np.ones(values.size, dtype=bool)
    weights = [np.full((2, r.i_a.size), 3.0) for r in model.records]
    residuals, jacobian = model.residuals(values, weights, free)
    none = np.zeros(values.size, dtype=bool)
    (first,) = model.predict_both([values[None, :]])
    rows = model.records[0].i_a.size
    assert residuals[:rows] == pytest.approx(3.0 * (first[0][:, 0] - model.records[0].i_a))
    widths = difference_widths(model.records, model.layout, values)
    for place in range(values.size):
        ends = []
        for side in (-1.0, 1.0):
            moved = values.copy()
            moved[place] += side * 3.0 * widths[place]
            ends.append(model.residuals(moved, weights, none)[0])
        slope = (ends[1] - ends[0]) / (6.0 * widths[place])
        size = float(np.abs(slope).max())
        assert jacobian[:, place] == pytest.approx(slope, abs=2e-3 * size + 1e-9)


def test_bounds_keep_resistances_positive_and_edges_near() -> None:
    model = model_of(step(noise=1e-3, source=0.2))
    start = start_of(model.records, model.layout)
    low, high = model.layout.bounds(start)
    at, own = model.layout.starts[0], model.layout.slots[0]
    assert low[[LD, LQ]] == pytest.approx(1e-3 * start[[LD, LQ]])
    assert low[at] == pytest.approx(0.6 * start[at])
    assert low[at + own.source_ohm] == pytest.approx(-0.5 * start[at])
    moves = slice(at + own.moves.start, at + own.moves.stop)
    assert low[moves].tolist() == [-4.0, -4.0]
    assert high[moves].tolist() == [4.0, 4.0]
    assert np.isinf(high[at])


@pytest.mark.parametrize(
    ("angles", "ld", "lq"), [((-30.0, 60.0), 4e-4, 9e-4), ((-30.0,), 4e-4, None)]
)
def test_a_start_splits_what_the_pairs_see_over_the_axes(angles, ld, lq) -> None:
    seen = {-30.0: 8e-4, 60.0: 18e-4}
    model = model_of(*(step(noise=1e-4, theta=a, path=f"{a}") for a in angles))
    records = [replace(r, l_start_h=seen[a]) for r, a in zip(model.records, angles, strict=True)]
    start = start_of(records, model.layout)
    assert start[LD] == pytest.approx(ld, rel=2e-3)
    if lq:
        assert start[LQ] == pytest.approx(lq, rel=2e-3)
    at, own = model.layout.starts[0], model.layout.slots[0]
    assert start[at] == records[0].r_start_ohm
    assert start[at + own.levels_v.start + 1] == pytest.approx(6.0, rel=1e-2)


def test_the_share_covered_after_a_time() -> None:
    found = _covered(np.array([0.0, 1.0, -1.0, -40.0]))
    assert found == pytest.approx([0.0, 1.0 - math.exp(-1.0), 1.0 - math.e, 1.0 - math.exp(30.0)])


@pytest.mark.parametrize("constants", [10.0, 1000.0])
def test_steps_are_fine_after_an_edge_and_grow(constants: float) -> None:
    """A 24th of a time constant at first, e times that after three."""
    record = read_step(step(noise=1e-4))
    assert record is not None
    length = float(np.diff(record.wave.edges_s)[1])
    tau = length / constants
    record = replace(record, l_start_h=tau * 2.0, r_start_ohm=1.0,
                     wave=replace(record.wave, source_ohm=1.0))  # fmt: skip
    segment, begin, end = _steps(record)
    second = segment == 1
    starts, widths = begin[second] * length, (end - begin)[second] * length
    fine = starts < 8.0 * tau
    middle = starts[fine] + 0.5 * widths[fine]
    assert widths[fine] == pytest.approx(tau / 24.0 * np.exp(middle / (3.0 * tau)), rel=0.02)
    assert np.count_nonzero(second) <= 3 * 24
    assert (begin[second][0], end[second][-1]) == (0.0, 1.0)
    assert begin[second][1:] == pytest.approx(end[second][:-1])
    slow = replace(record, l_start_h=1000.0 * length)
    assert np.count_nonzero(_steps(slow)[0] == 1) == 4


def split(grid, parts):
    """The same steps, each in so many equal parts."""
    segment, begin, end = grid
    edges = np.linspace(begin, end, parts + 1)
    return np.repeat(segment, parts), edges[:-1].T.ravel(), edges[1:].T.ravel()


@pytest.mark.parametrize(
    "guess",
    [pytest.param(0.3, marks=pytest.mark.slow), pytest.param(1.0, marks=pytest.mark.slow), 3.0],
)
@pytest.mark.parametrize("powers", [(), (1,), (2,)])
def test_a_current_under_which_l_halves_is_exact_to_a_part_in_five_thousand(
    guess: float, powers: tuple[int, ...]
) -> None:
    """Against a hundred steps for each; a guess three times off costs a part in a thousand."""
    record = read_step(step(noise=1e-4))
    assert record is not None
    record = replace(record, axis_rad=0.0)
    model = StepModel([replace(record, l_start_h=guess * L)], inductances)
    values = start_of([record], model.layout)
    values[: len(SHARED)] = 0.0
    values[[LD, LQ]] = L
    for power in powers:
        values[LD + power] = (L * record.largest_a) ** -power
    finer = StepModel(model.records, inductances)
    finer._grids = [split(grid, 100) for grid in finer._grids]
    finer._count = max(grid[0].size for grid in finer._grids)
    (current,), (exact,) = (one.predict([values[np.newaxis, :]]) for one in (model, finer))
    assert np.max(np.abs(current - exact)) < (2e-4 if guess == 1.0 else 1e-3) * record.largest_a


def test_a_drives_settled_current_is_its_first_level_over_the_loop() -> None:
    record = read_step(step(noise=1e-4, source=0.2))
    assert record is not None
    own = slots_of(record)
    values = np.zeros((1, own.size))
    values[0, own.r_ohm], values[0, own.source_ohm] = 1.0, 0.25
    values[0, own.levels_v] = 2.5, 6.0, 1.0
    values[0, own.moves] = 0.5, -1.0
    drive = drive_of(record, own, values)
    moved = record.wave.edges_s / PERIOD + np.array([0.0, 0.5, -1.0, 0.0])
    assert drive.first_a.tolist() == [2.0]
    assert drive.loop_ohm.tolist() == [1.25]
    assert drive.edges_s[0] == pytest.approx(record.wave.edges_s[0] + PERIOD * np.array(moved))


# The fit


def test_rows_rounded_alike_share_one_error() -> None:
    """100 samples on one level of step 1: variance sigma^2 + 100 rounding^2 each."""
    noise = Noise(0.1, 0.2, 1.0)
    read = np.repeat([0.0, 5.0], [100, 60])
    count = np.ones(160)
    total, white = row_variance(read, count, noise, 0.1, np.ones(160, dtype=bool))
    assert white == pytest.approx(0.01)
    assert total[:100] == pytest.approx(0.01 + 0.04 * 100)
    assert total[100:] == pytest.approx(0.01 + 0.04 * 60)
    # means of four samples, and rows within half a step of each other
    near = np.linspace(0.0, 3.0, 31)
    total, white = row_variance(near, np.full(31, 4.0), noise, 0.1, np.ones(31, dtype=bool))
    assert white == pytest.approx(0.0025)
    alike = 4.0 * np.array([np.count_nonzero(np.abs(near - x) < 0.5 - 1e-9) for x in near])
    assert np.abs(total - 0.0025 - 0.04 * alike / 4.0).max() <= 0.04 + 1e-12
    # rounding below a tenth of the scatter over all samples is left out
    for rounding, more in ((0.99e-3, 0.0), (1.01e-3, 1.02e-4)):
        total, _ = row_variance(read[:100], count[:100], Noise(0.1, rounding, 1.0), 0.1,
                                np.ones(100, dtype=bool))  # fmt: skip
        assert total[0] - 0.01 == pytest.approx(more, rel=0.01, abs=1e-12)


def test_white_power_counts_correlated_residuals() -> None:
    rng = np.random.default_rng(0)
    residuals = np.convolve(rng.standard_normal(500), np.ones(5), mode="same")
    white = np.ones(500)
    expected = float(np.mean(residuals**2)) * autocorrelation_time(residuals)
    assert _white_power(residuals, white) == pytest.approx(expected)
    white[100:] = 0.0
    expected = float(np.mean(residuals[:100] ** 2)) * autocorrelation_time(residuals[:100])
    assert _white_power(residuals, white) == pytest.approx(expected)
    assert _white_power(residuals, np.zeros(500)) == 1.0


@pytest.fixture(scope="module")
def solution():
    steps = [step(k, noise=2e-3, theta=theta, volts=volts, path=f"{k}", l=l)
             for k, (theta, volts, l) in enumerate(
                 [(-30.0, 3.0, 1.0e-3), (-30.0, 6.0, 1.0e-3), (60.0, 6.0, 2.0e-3)])]  # fmt: skip
    return solve(model_of(*steps), ("ld_h", "lq_h"))


def test_a_fit_finds_both_axes_and_their_noise(solution) -> None:
    assert solution.parameters[[LD, LQ]] == pytest.approx([5e-4, 1e-3], rel=2e-3)
    assert not solution.free[LD + 1 : LQ].any()
    assert solution.free[len(SHARED) :].all()
    for at in solution.model.layout.starts:
        assert solution.parameters[at] == pytest.approx(R, rel=2e-3)
    assert np.array(solution.sigmas) == pytest.approx(2e-3, rel=0.15)
    assert solution.scatter == pytest.approx(1.0, rel=0.15)
    assert bic_penalty(solution.model) == pytest.approx(math.log(3 * 1200))
    u = np.sqrt(np.diag(solution.covariance()))
    assert abs(solution.parameters[LD] - 5e-4) < 4.0 * u[LD]
    assert u[LD + 1] == 0.0


def test_what_a_fit_leaves_is_noise(solution) -> None:
    assert max(unexplained(solution).values()) < 1e-3
    assert 1.0 <= birge_ratio(solution) < 2.5


def test_captures_that_disagree_widen_the_mean_to_what_they_scatter_by() -> None:
    """Three captures of one axis, one 2 % off: u is that of the mean of their own values."""
    steps = [step(k, noise=2e-3, l=l, path=f"{k}") for k, l in enumerate((1e-3, 1e-3, 1.02e-3))]
    singles = [solve(model_of(one), ("ld_h",)) for one in steps]
    values = np.array([one.parameters[LD] for one in singles])
    together = solve(model_of(*steps), ("ld_h",))
    u = math.sqrt(together.covariance()[LD, LD]) * birge_ratio(together)
    assert u == pytest.approx(values.std(ddof=1) / math.sqrt(3.0), rel=0.25)
    assert together.parameters[LD] == pytest.approx(values.mean(), rel=2e-3)
    assert birge_ratio(singles[0]) == 1.0
    alike = [replace(one, path=f"{k}") for k, one in enumerate((steps[0],) * 3)]
    assert birge_ratio(solve(model_of(*alike), ("ld_h",))) == 1.0


def test_an_angle_that_is_off_moves_an_inductance_by_its_equation() -> None:
    """2 (cos^2 g Ld + sin^2 g Lq) of two rotor angles, solved anew with one of them turned."""
    ld, lq, u = 5e-4, 1e-3, 0.02
    angles = (-15.0, 50.0)
    axes = [-math.pi / 6.0 - math.radians(a) for a in angles]

    def pair(g):
        return 2.0 * (math.cos(g) ** 2 * ld + math.sin(g) ** 2 * lq)

    steps = [step(k, noise=1e-4, theta=a, path=f"{k}", l=pair(g))
             for k, (a, g) in enumerate(zip(angles, axes, strict=True))]  # fmt: skip
    found = solve(model_of(*steps), ("ld_h", "lq_h"))
    assert found.parameters[[LD, LQ]] == pytest.approx([ld, lq], rel=5e-3)
    for place, name in enumerate(("ld_h", "lq_h")):
        parts = {p.source: p.u for p in rotor_angles(name, found, u)}
        for k, angle in enumerate(angles):
            ends = []
            for side in (-u, u):
                turned = [g + side * (k == n) for n, g in enumerate(axes)]
                mix = [[2 * math.cos(g) ** 2, 2 * math.sin(g) ** 2] for g in turned]
                ends.append(np.linalg.solve(mix, [pair(g) for g in axes])[place] - (ld, lq)[place])
            odd, even = 0.5 * (ends[1] - ends[0]), 0.5 * (ends[1] + ends[0])
            expected = math.copysign(math.hypot(odd, math.sqrt(3.0) * even), odd)
            assert parts[f"theta_elec:{angle:g}@s"] == pytest.approx(expected, rel=0.04)


def test_a_gain_scales_the_inductance() -> None:
    """L goes with v/i: one day in full; of two days half the variance of each gain is its own."""
    steps = [step(k, noise=1e-4, path=f"{k}", l=1e-3) for k in range(2)]
    days = [replace(one, meta=replace(one.meta, started_at=f"2026-03-0{k + 1}T08:00:00Z"))
            for k, one in enumerate(steps)]  # fmt: skip
    value = 5e-4
    same = {p.source: p.u for p in gains("ld_h", solve(model_of(*steps), ("ld_h",)))}
    assert same == pytest.approx({"voltage@s": 1e-3 * value, "current@s": -2e-3 * value}, rel=0.02)
    parts = {p.source: p.u for p in gains("ld_h", solve(model_of(*days), ("ld_h",)))}
    assert parts["voltage@s"] == pytest.approx(1e-3 * value / math.sqrt(2.0), rel=0.02)
    own = parts["voltage@s:2026-03-01"] + parts["voltage@s:2026-03-02"]
    assert own == pytest.approx(1e-3 * value / math.sqrt(2.0), rel=0.02)


def test_the_spread_between_models_is_weighted_by_their_bic(solution) -> None:
    """One that gains as much as it costs weighs 1: sqrt(change^2 / 2)."""
    price = bic_penalty(solution.model)
    assert between_models(solution, [(price, 1, 2e-6)]) == pytest.approx(2e-6 / math.sqrt(2.0))
    worse = math.exp(-0.5 * 4.0)
    offers = [(price - 4.0, 1, 2e-6), (price + 9.0, 2, 1e-6)]
    expected = math.sqrt((worse * 4e-12 + 1e-12) / (2.0 + worse))
    assert between_models(solution, offers) == pytest.approx(expected)
    assert between_models(solution, []) == 0.0


def test_the_largest_current_of_an_axis_is_that_of_its_own_steps() -> None:
    """3 V on d and 6 V on q of 1.2 ohm: 2/sqrt(3) of 2.5 and of 5 A."""
    found = estimates(current_step.ESTIMATOR, step(1, volts=3.0, noise=1e-3, path="d"),
                      step(2, noise=1e-3, theta=60.0, path="q"))  # fmt: skip
    for name, amps in (("ld_h", 2.5), ("lq_h", 5.0)):
        largest = found[name].at["current_largest_a"]
        assert largest == pytest.approx(2.0 / math.sqrt(3.0) * amps, rel=5e-3)
        assert f"no saturation seen up to {largest:.3g} A" in found[name].note


def test_an_offer_moves_the_inductance_as_a_fit_with_that_term_does(solution) -> None:
    for name, place in (("ld_h", LD), ("lq_h", LQ)):
        (gain, term, change), *_ = offers_of(solution, (name,), solution.sigmas)[name]
        assert (term, gain >= 0.0) == (place + 1, True)
        free = solution.free.copy()
        free[term] = True
        refitted = _fit(solution.model, solution.parameters, free, solution.sigmas)
        moved = refitted.parameters[place] - solution.parameters[place]
        assert change == pytest.approx(moved, rel=0.05)


def test_the_mean_inductance_of_a_capture_is_that_of_its_step(solution) -> None:
    layout = solution.model.layout
    pairs = (1e-3, 1e-3, 2e-3)
    for record, at, own, pair in zip(
        solution.model.records, layout.starts, layout.slots, pairs, strict=True
    ):
        drive = drive_of(record, own, solution.parameters[None, at : at + own.size])
        assert _chord(record, drive) == pytest.approx(pair, rel=0.01)
