"""Limits of the gates, just inside and just outside, on the least capture that has them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import polars as pl
import pytest

from pipeline.contracts import motor, waveform
from pipeline.contracts.registry import gates
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.errors import CaptureError

TURN = 2.0 * np.pi
GATES = {gate.name: gate for gate in gates()}


def capture(test: str, *, path: str = "a.csv", meta: dict | None = None, **columns) -> Capture:
    """One table of these columns; the first 10 kHz clock that fits where none is given."""
    size = max(np.size(values) for values in columns.values())
    clock = {} if "t_s" in columns else {"t_s": np.arange(size) * 1e-4}
    table = pl.DataFrame({n: np.broadcast_to(v, size).astype(float) for n, v in columns.items()})
    table = table.with_columns(**{n: pl.Series(v) for n, v in clock.items()})
    plate = CaptureMeta(motor_id="m", test=test, **(meta or {}))
    return Capture(path, "0" * 64, "verified", plate, (table,))


def said(gate: str, made: Capture) -> str:
    """`refused`, `warned` or nothing."""
    try:
        passed = GATES[gate].check(made, GATES[gate].options)
    except CaptureError:
        return "refused"
    return "warned" if passed.findings else ""


@pytest.mark.parametrize(("turns", "expected"), [(0.94, "refused"), (0.96, "")])
@pytest.mark.parametrize("test", ["cogging", "holding_current"])
def test_nineteen_twentieths_of_a_turn(test: str, turns: float, expected: str) -> None:
    there = np.linspace(0.0, turns * TURN, 2000)
    angle = np.concatenate([there, there[::-1]])
    assert said("angle_coverage", capture(test, theta_mech_rad=angle, iq_a=1.0)) == expected


def test_a_slow_hand_turn_of_a_small_motor_has_a_back_emf() -> None:
    """Tens of millivolts are a voltage; none at all is none."""
    angle = np.linspace(0.0, 1.1 * TURN, 2000)
    wave = 0.03 * np.sin(4.0 * angle)
    assert said("angle_coverage", capture("hand_turn", vab_v=wave, theta_mech_rad=angle)) == ""
    still = capture("hand_turn", vab_v=0.0 * wave, theta_mech_rad=angle)
    assert said("angle_coverage", still) == "refused"


@pytest.mark.parametrize(
    ("angles", "expected"),
    [([0.0, 60.0, 120.0], ""), ([0.0, 60.0, 240.0], "warned"), ([10.0, 190.0], "refused")],
)
def test_rotor_angles_count_modulo_a_half_turn(angles: list[float], expected: str) -> None:
    made = capture("lcr", theta_elec_deg=np.array(angles), lab_h=1e-3)
    assert said("angle_coverage", made) == expected


@pytest.mark.parametrize(("end", "expected"), [(101.0, "refused"), (99.0, "")])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_coast_falls_by_a_third(end: float, expected: str, sense: float) -> None:
    """From 150 rad/s to a little over 100, and to a little under."""
    fall = np.linspace(150.0, end, 800)
    speed = sense * np.concatenate([np.full(100, 150.0), fall, np.full(100, end)])
    assert said("speed_coverage", capture("spin_down", omega_mech_rad_s=speed)) == expected
    assert said("speed_coverage", capture("spin_down", omega_mech_rad_s=0.0 * speed)) == "refused"


def test_a_coast_that_is_a_small_part_of_its_record_is_one() -> None:
    """A shaft that stops after a second, and is shaken by a load for the rest of a minute."""
    t_s = np.arange(0.0, 60.0, 1e-3)
    speed = np.maximum(200.0 * (1.0 - t_s), 0.0) + 5.0 * np.sin(71.0 * t_s)
    assert said("speed_coverage", capture("spin_down", omega_mech_rad_s=speed)) == ""
    assert said("speed_coverage", capture("spin_down", omega_mech_rad_s=speed[2000:])) == "refused"


@pytest.mark.parametrize(("turns", "expected"), [(0.98, "warned"), (1.02, "")])
@pytest.mark.parametrize("test", ["torque_map", "drive"])
def test_a_map_turns_once(test: str, turns: float, expected: str) -> None:
    made = capture(test, theta_mech_rad=np.linspace(0.0, turns * TURN, 500))
    assert said("speed_coverage", made) == expected


def noise(size: int, seed: int = 1) -> np.ndarray:
    """White noise whose `noise_of` is 1."""
    values = np.random.default_rng(seed).standard_normal(size)
    return values / waveform.noise_of(values)


@pytest.mark.parametrize(("times", "expected"), [(5.0, "refused"), (30.0, "")])
def test_a_step_leaves_its_noise_twenty_times(times: float, expected: str) -> None:
    """The range of noise itself is seven sigma or so: 12 in all, and 37."""
    current = np.repeat([0.0, times], 500) + noise(1000)
    assert (np.ptp(current) > 20.0) == (expected == "")
    assert said("current_coverage", capture("current_step", ia_a=current)) == expected
    assert said("current_coverage", capture("torque_map", iq_a=current)) == expected


@pytest.mark.parametrize(("levels", "expected"), [((1.0, 1.04), "warned"), ((1.0, 1.07), "")])
def test_levels_a_twentieth_apart(levels: tuple[float, float], expected: str) -> None:
    current = np.repeat(levels, 500)
    for sign in (1.0, -1.0):
        made = capture("resistance", ia_a=sign * current, vab_v=sign * current)
        assert said("current_coverage", made) == expected
    assert said("current_coverage", capture("resistance", ia_a=0.0 * current)) == "refused"


@pytest.mark.parametrize(("rise", "expected"), [(4.9, "warned"), (5.1, "")])
def test_a_heat_run_warms_by_five_kelvin(rise: float, expected: str) -> None:
    warm = np.linspace(25.0, 25.0 + rise, 1000)
    made = capture("heat_run", iq_a=5.0, id_a=0.0, temp_winding_degc=warm)
    assert said("current_coverage", made) == expected


@pytest.mark.parametrize(("per", "expected"), [(1.98, "warned"), (2.02, "")])
@pytest.mark.parametrize("test", ["torque_map", "drive"])
def test_two_samples_an_electrical_period(test: str, per: float, expected: str) -> None:
    """Five pole pairs at 10 kHz: the top speed that leaves `per` samples a period."""
    speed = TURN / (5.0 * per * 1e-4)
    made = capture(test, vq_v=np.ones(400), omega_mech_rad_s=-speed, meta={"pole_pairs": 5})
    assert said("sampling_rate", made) == expected


@pytest.mark.parametrize(
    ("per", "expected"),
    [(2.4, "refused"), (2.6, "warned"), (7.8, "warned"), (8.2, "")],
)
def test_samples_a_cogging_period(per: float, expected: str) -> None:
    """12 slots, 14 poles: order 84; two turns in so many rows."""
    rows = round(per * 84 * 2)
    angle = np.linspace(0.0, 2.0 * TURN, rows)
    plate = {"pole_pairs": 7, "slots": 12}
    assert said("sampling_rate", capture("cogging", theta_mech_rad=angle, meta=plate)) == expected


@pytest.mark.parametrize(
    ("samples", "expected"),
    [(1.8, "refused"), (2.3, "warned"), (9.5, "warned"), (10.8, "")],
)
def test_samples_a_time_constant(samples: float, expected: str) -> None:
    t = np.arange(-200, 2000)
    current = np.where(t > 0, -np.expm1(-t / samples), 0.0)
    assert said("sampling_rate", capture("current_step", ia_a=10.0 * current)) == expected


@pytest.mark.parametrize(("share", "expected"), [(-0.48, ""), (-0.52, "refused")])
def test_half_of_the_energy_comes_back(share: float, expected: str) -> None:
    """Rows that deliver and rows that take, of one size: their difference over their sum."""
    back = round(1000 * (1.0 - share) / 2.0)
    current = np.where(np.arange(1000) < back, -1.0, 1.0)
    assert said("power_sign", capture("resistance", vab_v=2.0, ia_a=current)) == expected
    other = capture("resistance", vca_v=-2.0, ic_a=-current, meta={"pair": "ca"})
    assert said("power_sign", other) == expected
    far = capture("resistance", vab_v=2.0, ib_a=-current)
    assert said("power_sign", far) == expected
    frame = capture("heat_run", vd_v=1.0, id_a=current, vq_v=-3.0, iq_a=-current)
    assert said("power_sign", frame) == expected
    assert said("power_sign", capture("resistance", vab_v=2.0, ia_a=np.zeros(9))) == ""


@pytest.mark.parametrize(
    ("coldest", "ambient", "expected"),
    [
        (249.0, None, ""),
        (251.0, None, "refused"),
        (251.0, 110.0, ""),
        (261.0, 110.0, "refused"),
        (25.0 + 273.15 - 16.0, 150.0, ""),
        (25.0 + 273.15 - 14.0, 25.0, "refused"),
        (240.0, -23.0, "refused"),
        (234.0, -23.0, ""),
    ],
)
def test_kelvin_in_a_column_of_degrees(
    coldest: float, ambient: float | None, expected: str
) -> None:
    values = np.full(100, coldest)
    values[:4] = 20.0  # less than a twentieth of the rows: no matter
    made = capture("resistance", temp_winding_degc=values, meta={"ambient_degc": ambient})
    assert said("temperature_unit", made) == expected
    nothing = capture("resistance", temp_winding_degc=np.full(9, np.nan))
    assert said("temperature_unit", nothing) == ""


def test_an_angle_wrapped_once_is_seen_and_one_over_a_gap_is_not() -> None:
    angle = np.concatenate([np.linspace(5.0, 6.2, 50), np.linspace(0.0, 3.0, 50)])
    assert said("wrapped_angle", capture("drive", theta_mech_rad=angle)) == "refused"
    with pytest.raises(CaptureError) as found:
        GATES["wrapped_angle"].check(
            capture("drive", theta_elec_rad=angle), GATES["wrapped_angle"].options
        )
    assert found.value.rows == (50, 50)
    clock = np.arange(100) * 1e-4
    clock[50:] += 2.5e-4
    assert said("wrapped_angle", capture("drive", theta_mech_rad=angle, t_s=clock)) == ""
    short = capture("drive", theta_mech_rad=np.where(np.arange(100) < 50, 0.0, 4.7))
    assert said("wrapped_angle", short) == ""
    assert said("wrapped_angle", capture("drive", theta_mech_rad=1.01 * np.arange(90.0))) == ""


def turn(*ends: float, path: str = "a.csv") -> Capture:
    """A slow turn through these angles [turns], with a jolt against it in the first row."""
    parts = [np.linspace(a, b, 300) for a, b in pairwise(ends)]
    angle = TURN * np.concatenate(parts)
    angle[1] = angle[0] - np.sign(ends[1] - ends[0]) * 0.01
    return capture("cogging", path=path, theta_mech_rad=angle, torque_shaft_nm=0.0)


def codes(*captures: Capture) -> set[str]:
    return {finding.code for finding in motor.agree(Campaign("m", captures))}


def test_cogging_needs_both_directions() -> None:
    """Net turns of both signs, or one capture that goes back by more than half a turn."""
    assert "direction_coverage" in codes(turn(0.0, 1.2))
    assert "direction_coverage" in codes(turn(0.0, 1.2), turn(5.0, 6.2, path="b.csv"))
    assert "direction_coverage" not in codes(turn(0.0, 1.2), turn(1.2, 0.0, path="b.csv"))
    assert "direction_coverage" in codes(turn(0.0, 1.2, 0.75))
    assert "direction_coverage" not in codes(turn(0.0, 1.2, 0.65))
    assert "direction_coverage" in codes(turn(0.0, -1.2, -0.75))
    assert "direction_coverage" not in codes(turn(0.0, -1.2, -0.65))


@pytest.mark.parametrize(("low", "high", "enough"), [(-1.9, 10, False), (-2.1, 10, True)])
def test_a_map_has_a_fifth_of_the_current_of_the_other_sign(
    low: float, high: float, enough: bool
) -> None:
    for sign in (1.0, -1.0):
        current = sign * np.repeat([low, high], 500)
        made = capture("torque_map", iq_a=current, torque_shaft_nm=current)
        assert ("current_coverage" not in codes(made)) == enough


def step(tau_s: float, path: str) -> Capture:
    """A current step of a thousand samples a time constant."""
    t = np.arange(-2000, 8000)
    current = np.where(t > 0, -np.expm1(-t / 1000.0), 0.0)
    return capture("current_step", path=path, ia_a=current, t_s=t * tau_s / 1000.0)


@pytest.mark.parametrize(("factor", "apart"), [(95.0, False), (105.0, True)])
def test_steps_whose_clocks_are_a_hundredfold_apart(factor: float, apart: bool) -> None:
    made = [step(1e-3, f"{k}.csv") for k in range(3)] + [step(1e-3 * factor, "odd.csv")]
    found = [f for f in motor.agree(Campaign("m", tuple(made))) if f.code == "clock_contradiction"]
    assert [f.file for f in found] == ["odd.csv"] * apart


def test_the_nameplate_that_is_in_the_minority_is_named() -> None:
    made = [
        capture("drive", path=f"{k}.csv", iq_a=1.0, meta={"pole_pairs": p})
        for k, p in enumerate((7, 14, 7, None))
    ]
    (found,) = [f for f in motor.agree(Campaign("m", tuple(made))) if "pole_pairs" in f.code]
    assert found.file == "1.csv"
    assert "14 here alone of the captures of m, but 7 in 0.csv and 1 more" in found.message
    assert "one_test_only" in codes(made[0])
    assert "one_test_only" not in codes(made[0], turn(0.0, 1.2, path="z.csv"))


def test_white_noise_of_a_ramp_and_time_constants_of_an_exponential() -> None:
    rng = np.random.default_rng(3)
    ramp = np.linspace(0.0, 100.0, 20_000)
    assert waveform.noise_of(ramp + 0.1 * rng.standard_normal(20_000)) == pytest.approx(0.1, 0.03)
    assert waveform.noise_of(np.array([1.0, 2.0])) == 0.0
    t = np.arange(20_000.0)
    rise = -np.expm1(-t / 700.0)
    both = np.concatenate([np.zeros(500), rise, np.exp(-t / 700.0)])
    for values in (np.concatenate([np.zeros(500), rise]), both, -both):
        assert waveform.samples_per_time_constant(values) == pytest.approx(700.0, rel=0.01)
    assert waveform.samples_per_time_constant(np.full(100, 0.5)) == math.inf


def test_runs_repeats_and_gaps_by_hand() -> None:
    values = np.array([1.0, 1.0, 2.0, np.nan, np.nan, 2.0, 2.0, 2.0])
    starts, lengths = waveform.runs_of_equal(values)
    assert starts.tolist() == [0, 2, 3, 4, 5]
    assert lengths.tolist() == [2, 1, 1, 1, 3]
    assert waveform.runs_of_equal(np.zeros(0))[0].size == 0
    assert waveform.share_of_repeats(values) == pytest.approx(4.0 / 5.0)
    assert waveform.share_of_repeats(np.array([np.nan, 4.0])) == 1.0
    flat = waveform.rows_of_runs(8, starts[[0, 4]], lengths[[0, 4]])
    assert flat.tolist() == [True, True, False, False, False, True, True, True]
    # a tenth repeats, 1000 samples: 1000 · 0.1^(L - 1) = 1e-6 where L = 10
    tenth = np.arange(1000.0)
    tenth[10::10] = tenth[9:-1:10]
    share = waveform.share_of_repeats(tenth)
    expected = 1.0 + math.log(1e-6 / 1000.0) / math.log(share)
    assert share == pytest.approx(0.1, abs=0.002)
    assert waveform.longest_likely_run(tenth, 1e-6) == pytest.approx(expected)
    assert waveform.longest_likely_run(np.arange(1000.0), 1e-6) == pytest.approx(4.0)
    assert waveform.longest_likely_run(np.repeat(np.arange(9.0), 3), 1e-6) == math.inf
    gaps, usual = waveform.gaps_of(np.array([0.0, 1.0, 2.0, 5.0, 6.0, 8.1, 9.1]), 2.0)
    assert (gaps.tolist(), usual) == ([2, 4], pytest.approx(1.0))
    assert waveform.gaps_of(np.array([1.0]), 2.0)[0].size == 0
    t = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    assert waveform.missing_samples(t, np.array([2]), 1.0) == pytest.approx(2.0)
    hurried = np.array([0.0, 1.0, 2.0, 5.0, 5.2, 5.4, 6.0])
    assert waveform.missing_samples(hurried, np.array([2]), 1.0) == pytest.approx(0.0)


def test_small_currents_share_a_common_part_too() -> None:
    """Milliampere of which a third is common to all lines: the share does not see their size."""
    phase = np.linspace(0.0, 40.0 * TURN, 4000)
    waves = [0.01 * np.cos(phase - k * TURN / 3.0) for k in range(3)]
    from pipeline.contracts.gates.phase_order import _common_share

    names = ("ia_a", "ib_a", "ic_a")
    clean = capture("drive", **dict(zip(names, waves, strict=True)))
    assert _common_share(clean) == pytest.approx(0.0, abs=1e-9)
    turned = capture("drive", **dict(zip(names, [-waves[0], *waves[1:]], strict=True)))
    assert _common_share(turned) == pytest.approx(2.0 / 3.0, rel=1e-3)
    assert _common_share(capture("drive", ia_a=waves[0])) == 0.0
    for nothing in (np.zeros(50), np.full(50, np.nan)):
        assert _common_share(capture("drive", **dict.fromkeys(names, nothing))) == 0.0
