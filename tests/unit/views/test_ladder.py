"""A diagnosis in words: sizes, what adding them does, the commands, what else it could be."""

from __future__ import annotations

from dataclasses import replace

from pipeline.records.diagnosis import Diagnosis, RankedEffect, Separation, StepRecord
from pipeline.report.text.ladder_text import ladder_text
from pipeline.views.ladder import headline, ladder_view, mapped_signals, percent, shown_signals
from tests.unit.ladders import make_diagnosis, make_step


def ranked(effect: str, words: str) -> RankedEffect:
    return RankedEffect(effect, 1.0, 0.5, 0.0, (), "formula", "a test", {}, headline=words)


def two() -> Diagnosis:
    """What P3 of the rig comes to."""
    words = ("encoder disc off-centre by 9.0 ± 0.1 mrad", "extra friction below 7.0 rad/s")
    names = ("angle_eccentricity", "stribeck")
    steps = [
        StepRecord(names[:n], held_out, {})
        for n, held_out in enumerate((76.29498559941, 1.1646, 0.5162))
    ]
    ranking = tuple(map(ranked, names, words))
    return replace(make_diagnosis(), missing=names, ranking=ranking, ladder=tuple(steps))


def test_what_is_unknown_is_tried_as_an_effect_with_all_that_is_known() -> None:
    unknown = make_diagnosis(unknown=True)
    assert unknown.unknown is not None and unknown.unknown.sketch
    view = ladder_view(replace(unknown, asked=("cogging",)), "in", "out")
    effects = f"[cogging,dead_time,{unknown.unknown.effect}]"
    assert view.try_start == (
        f"motor-datasheets compare input=in motor=joint-P1 'model.effects={effects}' "
        "effects_path=out/diagnosis/effects output=out"
    )
    assert ladder_view(make_diagnosis()).try_start == ""


def test_the_headline_says_what_is_missing_with_sizes_and_what_adding_it_does() -> None:
    assert headline(two()) == (
        "Encoder disc off-centre by 9.0 ± 0.1 mrad, and extra friction below 7.0 rad/s. "
        "With both, the error falls from 76 to 0.52 noise floors."
    )
    one = replace(two(), missing=("stribeck",))
    assert headline(one).startswith("Extra friction below 7.0 rad/s. With it, the error falls")


def test_no_fall_is_claimed_where_the_error_stays_or_grows() -> None:
    first, *between, last = two().ladder

    def said(without: float, after: float) -> str:
        ladder = (replace(first, held_out=without), *between, replace(last, held_out=after))
        return headline(replace(two(), ladder=ladder)).rpartition("With both, ")[2]

    means = "they show in means of many samples only."
    assert said(0.6874, 0.6856) == f"the error stays at 0.69 noise floors; {means}"
    assert said(0.70, 0.71) == f"the error goes from 0.7 to 0.71 noise floors; {means}"
    assert said(67.9, 69.4) == "the error goes from 68 to 69 noise floors."
    assert said(0.71, 0.70) == "the error falls from 0.71 to 0.7 noise floors."


def test_other_verdicts_in_words() -> None:
    base = make_diagnosis(unknown=True)
    known = "Voltage lost in the inverter, 179.90 ± 0.24 mV a phase. With it, the error falls from "
    assert headline(base) == (
        f"{known}20 to 0.41 noise floors. Something is missing that no known effect explains: "
        "odd in i_q."
    )
    adequate = replace(make_diagnosis(), verdict="adequate", missing=())
    assert "to 0.41 noise floors; nothing is missing" in headline(adequate)
    assert "do not decide it" in headline(replace(adequate, verdict="insufficient", ladder=()))


def test_the_commands_name_folder_motor_and_all_effects() -> None:
    asked = replace(two(), asked=("cogging", "-coulomb_friction"))
    view = ladder_view(asked, "my captures")
    effects = "'model.effects=[cogging,-coulomb_friction,angle_eccentricity,stribeck]'"
    assert view.compare == (
        f"motor-datasheets compare input='my captures' motor=joint-P1 {effects} output=OUTPUT"
    )
    assert view.add == f"motor-datasheets run input='my captures' {effects} output=OUTPUT"
    none = ladder_view(replace(make_diagnosis(), verdict="adequate", missing=()))
    assert (none.compare, none.add) == ("", "")
    assert " model=ideal " in ladder_view(replace(two(), model="ideal")).add


def test_a_doubt_names_rivals_and_the_test_that_tells_with_its_power() -> None:
    (doubt,) = ladder_view(make_diagnosis()).doubts
    assert (doubt.effect, doubt.alternatives) == ("dead_time", "phase_imbalance")
    assert doubt.tests == ("low-speed current steps",)
    apart = (Separation("phase_imbalance", "slow steps", 0.97), Separation("x", "y", None))
    told = replace(make_diagnosis().ranking[0], separation=apart)
    (doubt,) = ladder_view(replace(make_diagnosis(), ranking=(told,))).doubts
    assert doubt.tests == ("against phase_imbalance: slow steps, predicted power 97%",)


def test_steps_tell_what_came_its_numbers_and_the_fall() -> None:
    first, last = ladder_view(make_diagnosis()).steps
    assert (first.title, first.came, first.change) == ("model standard", (), "")
    assert (last.title, last.came, last.change) == ("+ dead_time", ("dead_time",), "−98 %")
    assert last.parameters == (("dead_time.loss_v", "179.90 ± 0.24 mV"),)
    assert last.others == (("coulomb_friction.torque_nm", "4.000 ± 0.020 mN·m"),)
    cells = [cell for cell in last.errors if cell is not None]
    assert [(c.signal, c.rmse, c.floor, c.ratio, c.change) for c in cells] == [
        ("v_q", "2.60 mV", "2.00 mV", "1.30", "−98 %"),
        ("line voltage", "500 µV", "500 µV", "1.00", "0 %"),
    ]
    gone = replace(make_diagnosis(), ladder=(make_step(("dead_time",), 1.0), make_step((), 1.0)))
    assert ladder_view(gone).steps[1].title == "− dead_time"


def test_the_signal_farthest_over_its_floor_comes_first_and_one_without_map_last() -> None:
    assert shown_signals(make_diagnosis()) == ("vq_v", "v_pair_v")
    assert mapped_signals(make_diagnosis()) == ("vq_v", "v_pair_v")
    assert shown_signals(replace(make_diagnosis(), ladder=())) == ()


def test_a_terminal_says_the_same() -> None:
    assert "Encoder disc off-centre" in ladder_text(two())


def test_a_change_that_rounds_to_nothing_has_no_sign() -> None:
    assert [percent(now, 1.0) for now in (0.999, 1.0, 1.001, 0.9, 1.1)] == [
        *["0 %"] * 3,
        "−10 %",
        "+10 %",
    ]
    assert percent(1.0, 0.0) == ""
