"""Shipped captures with tests or columns taken away: what is said then, and what is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.machine_scale import PAIRLESS, machine_of, pole_pairs_of
from pipeline.criticism.diagnosis import UNSTATED, diagnose
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.missing_data import unrecorded_signals
from pipeline.execution.tasks.start import start_constants
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.stages.steps.campaigns import campaigns

DEMO = Path(__file__).parents[3] / "data" / "demo" / "G52-0601"
STANDARD = ModelSpec("standard")
ANGLES = ("theta_mech_rad", "theta_elec_rad")


@cache
def shipped() -> Campaign:
    return campaigns(str(DEMO))[0][0]


def only(*tests: str) -> Campaign:
    return replace(shipped(), captures=shipped().of(*tests))


def without(columns: Mapping[str, tuple[str, ...]], campaign: Campaign | None = None) -> Campaign:
    """A campaign with columns taken from the captures whose test they are listed under."""
    campaign = campaign or shipped()

    def less(capture: Capture) -> Capture:
        gone = columns.get(capture.meta.test, ())
        tables = [t.drop([n for n in gone if n in t.columns]) for t in capture.tables]
        return replace(capture, tables=tuple(tables))

    return replace(campaign, captures=tuple(less(c) for c in campaign.captures))


def unnamed(campaign: Campaign) -> Campaign:
    """The campaign with no pole pairs on its captures."""

    def bare(capture: Capture) -> Capture:
        extra = {k: v for k, v in capture.meta.extra.items() if k != "pole_pairs"}
        return replace(capture, meta=replace(capture.meta, pole_pairs=None, extra=extra))

    return replace(campaign, captures=tuple(bare(c) for c in campaign.captures))


def test_a_loaded_motion_by_a_drives_own_speed_asks_for_the_torque():
    """Nothing is wrong with its samples: a torque that nothing recorded turns the shaft."""
    few = without({"drive": (*ANGLES, "vd_v", "vq_v", "torque_shaft_nm")}, only("drive"))
    found = diagnose(few, STANDARD, start_constants(few))
    assert found.verdict == "insufficient"
    (note,) = (note for note in found.notes if "log torque_shaft_nm" in note)
    assert "too few even samples" not in note


def test_a_short_coast_by_its_speed_has_too_few_samples():
    coasts = without({"spin_down": ANGLES}, only("spin_down"))
    short = [replace(c, tables=tuple(t.head(20) for t in c.tables)) for c in coasts.captures]
    few = replace(coasts, captures=tuple(short))
    notes = diagnose(few, STANDARD, start_constants(few)).notes
    assert any("too few even samples" in note for note in notes)
    assert UNSTATED not in notes


@pytest.mark.slow
def test_the_second_harmonic_of_cogging_is_no_back_emf():
    """Nothing but a holding current shows it, and no spectrum of a torque says that it is there."""
    few = only("holding_current", "flux_map", "current_step", "resistance")
    found = diagnose(few, STANDARD, start_constants(few))
    assert found.missing == ("cogging",)
    assert found.ladder[-1].held_out < 1.0
    for step in found.ladder:
        assert step.errors.keys() == step.signals.keys(), "tables have a noise floor too"
        assert all(one.noise_floor > 0.0 for one in step.errors.values())


def test_an_ohmmeter_lacks_no_column():
    """It said that it needs t_s: with one, it is used no more than without."""
    rows = pl.DataFrame({"rab_ohm": [0.1, 0.1], "temp_winding_degc": [24.0, 25.0]})
    readings = tuple(
        replace(capture, tables=(rows.with_columns(t_s=pl.Series([0.0, 1.0])) if timed else rows,))
        for capture, timed in zip(shipped().of("resistance")[:2], (False, True), strict=True)
    )
    found = compare(replace(shipped(), captures=readings), STANDARD, Constants())
    assert not found.errors
    assert found.held_out is None
    (note,) = found.notes
    assert "needs" not in note and "no equation takes the readings of an ohmmeter" in note
    assert all(capture.path in note for capture in readings)


@pytest.mark.slow
def test_an_open_circuit_of_one_line_is_not_used_and_said_so():
    few = only("open_circuit", "cogging", "resistance", "spin_down")
    campaign = without({"open_circuit": ("vbc_v", "vca_v")}, few)
    found = diagnose(campaign, STANDARD, start_constants(campaign))
    assert (found.verdict, found.missing) == ("missing", ("cogging",))
    assert found.ladder[-1].held_out < 1.0
    (note,) = (note for note in found.notes if note.startswith("not used"))
    assert "open_circuit_forward.mcap" in note


def test_a_log_without_an_angle_tells_of_its_voltages_alone():
    """Where its waves stand at first is not known, nor what a speed that lags makes of J."""
    campaign = without({"drive": ANGLES})
    found = segments(campaign, machine_of(campaign, Constants()))
    logs = [segment for segment in found if segment.test == "drive"]
    assert len(logs) == 2
    for segment in logs:
        assert segment.channels == ("vd_v", "vq_v")
        assert set(segment.weak.orders.tolist()) == {0}


@pytest.mark.slow
def test_a_torque_map_without_torque_excites_less_and_says_what_to_record():
    """With the drives gone, nothing else shows what a load does to friction."""
    few = only("torque_map", "drive", "cogging", "resistance", "spin_down")
    campaign = without({"torque_map": ("torque_shaft_nm",), "drive": ("torque_shaft_nm",)}, few)
    found = diagnose(campaign, STANDARD, start_constants(campaign))
    lacking = {one.effect: one for one in found.unexcited}
    loaded = lacking["load_dependent_friction"]
    assert (loaded.tests, loaded.signals) == (("torque_map",), ("torque_shaft_nm",))
    assert "record torque_map with torque_shaft_nm" in loaded.words
    assert not {"cogging", "saturation", "dead_time"} & set(lacking)


def test_a_temperature_that_nobody_recorded_is_said_to_be_ambient():
    few = only("drive", "open_circuit", "resistance")
    lost = {"drive": ("temp_winding_degc",), "open_circuit": ("temp_magnet_degc",)}
    campaign = without(lost, few)
    notes = compare(campaign, STANDARD, start_constants(campaign)).notes
    cold = {note.split(",")[0]: note for note in notes if "ambient" in note}
    assert set(cold) == {"no temp_winding_degc", "no temp_magnet_degc"}
    assert "drive_1_warm.mcap" in cold["no temp_winding_degc"]
    assert "open_circuit_forward.mcap" in cold["no temp_magnet_degc"]


def test_pole_pairs_are_counted_from_any_two_lines():
    for gone in ("vab_v", "vbc_v", "vca_v"):
        spun = unnamed(without({"open_circuit": (gone,)}))
        assert pole_pairs_of(spun, Constants()) == 7


def test_pole_pairs_that_nothing_tells_are_asked_for_and_not_guessed():
    blind = unnamed(without({"open_circuit": ANGLES}))
    assert pole_pairs_of(blind, Constants()) is None
    assert machine_of(blind, Constants()) is None
    found = diagnose(blind, STANDARD, Constants())
    assert (found.verdict, found.notes) == ("insufficient", (PAIRLESS,))
    assert compare(blind, STANDARD, Constants()).notes == (PAIRLESS,)
    still = unnamed(only("resistance"))
    assert machine_of(still, Constants()).pole_pairs == 1


def test_pole_pairs_that_no_spin_tells_are_estimated_from_the_other_captures():
    blind = unnamed(without({"open_circuit": ANGLES}))
    known = start_constants(blind).best("pole_pairs")
    assert known is not None
    assert known.number == pytest.approx(7)


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        (("id_a", "vd_v"), "id_a that was not recorded, and is taken as zero"),
        (ANGLES, "angle that was not recorded, and is known by omega_mech_rad_s"),
    ],
)
def test_what_was_not_recorded_is_named_beside_what_is_left(lost, words) -> None:
    part = replace(without({"drive": lost}), captures=without({"drive": lost}).of("drive"))
    machine = machine_of(part, start_constants(part))
    assert machine is not None
    cut = segments(part, machine)
    (note,) = unrecorded_signals(part, cut)
    assert words in note
    assert all(segment.capture in note for segment in cut)
    whole = replace(shipped(), captures=shipped().of("drive"))
    assert unrecorded_signals(whole, segments(whole, machine)) == ()
