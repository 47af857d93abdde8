"""What is drawn: enough of everything, the same again from the same seed, and sealed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulator.effects import ALWAYS, FORMS
from pipeline.simulator.plant import plant_of
from tests.benchmark.bench import MOTORS, STEMS, station
from tests.benchmark.cases import Case, case_from
from tests.benchmark.corruption import corrupted, noise_of
from tests.benchmark.drawing import cases, small
from tests.benchmark.sealing import blind_campaign, blind_name

SECRETS = [name for name in FORMS if name != "cogging"] + list(MOTORS)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    return list(cases(1, tmp_path_factory.mktemp("sensitivity")))


def test_counts_are_those_asked_for(drawn: list[Case]) -> None:
    families = Counter(case.family for case in drawn)
    assert families == {
        "size": len(FORMS) * 7 * len(MOTORS),
        "null": 100,
        "set": 50,
        "crowd": 30,
        "form": 30,
        "outside": 30,
        "tie": 20,
        "gap": 20,
    }
    assert len({case.key for case in drawn}) == len(drawn)


def test_every_effect_at_every_size_on_every_motor(drawn: list[Case]) -> None:
    seen = {(c.truth[0], c.line, c.motor) for c in drawn if c.family == "size"}
    assert len(seen) == len(FORMS) * 7 * len(MOTORS)


def test_a_seed_gives_its_cases_again_and_another_seed_others(
    drawn: list[Case], tmp_path: Path
) -> None:
    assert [case.key for case in cases(1, tmp_path)] == [case.key for case in drawn]
    other = [case.key for case in cases(2, tmp_path)]
    assert not set(other) & {case.key for case in drawn}


def test_a_case_survives_its_document(drawn: list[Case]) -> None:
    for case in drawn[:: len(drawn) // 40]:
        assert case_from(case.document()).key == case.key


def test_every_motor_can_be_built(drawn: list[Case]) -> None:
    for case in drawn:
        plant_of(case.hidden_motor())


def test_sets_hold_two_to_five_visible_effects(drawn: list[Case]) -> None:
    sizes = Counter(len(case.truth) for case in drawn if case.family == "set")
    assert set(sizes) == {2, 3, 4, 5}
    assert not any(set(c.truth) & set(ALWAYS) for c in drawn if c.family == "set")


def test_a_crowd_is_one_among_25(drawn: list[Case]) -> None:
    for case in drawn:
        if case.family == "crowd":
            assert len(case.effects) == 26
            assert len(case.allowed) == 25


def test_ties_have_rivals_and_gaps_leave_no_trace(drawn: list[Case]) -> None:
    for case in drawn:
        if case.family == "tie":
            assert case.accepted[case.truth[0]]
            assert set(case.keep) < set(STEMS)
        if case.family == "gap":
            assert case.nothing
            assert set(case.keep) < set(STEMS)


def test_the_small_set_has_every_line(drawn: list[Case]) -> None:
    chosen = small(iter(drawn))
    assert {(c.family, c.line) for c in chosen} == {(c.family, c.line) for c in drawn}
    assert len(chosen) < 32
    assert {c.key for c in small(iter(reversed(drawn)))} == {c.key for c in chosen}


def one(drawn: list[Case], family: str, **what: object) -> Case:
    return next(
        c for c in drawn if c.family == family and all(getattr(c, k) == v for k, v in what.items())
    )


@pytest.mark.parametrize("family", ["size", "set", "crowd", "outside", "gap"])
def test_nothing_told_but_samples(drawn: list[Case], family: str) -> None:
    """No metadata, name or path holds an effect, a design, a seed or the case's own key."""
    case = one(drawn, family)
    campaign = blind_campaign(case)
    assert campaign.motor_id == blind_name(case)
    words = [campaign.motor_id]
    for capture in campaign.captures:
        meta = capture.meta
        words += [capture.path, capture.sha256, str(meta)]
        assert meta.extra == {} or set(meta.extra) <= {"u_rel_lcr"}
        assert meta.motor_type == "unit"
    text = "\n".join(words)
    for secret in [*SECRETS, case.key, str(case.seed), case.family + "'", "truth"]:
        assert secret not in text


def test_names_of_captures_do_not_hang_on_what_is_hidden(drawn: list[Case]) -> None:
    plain = blind_campaign(one(drawn, "null", motor="joint-11p"))
    full = blind_campaign(one(drawn, "set", motor="joint-11p"))
    assert [c.path for c in plain.captures] == [c.path for c in full.captures]
    for here, there in zip(plain.captures, full.captures, strict=True):
        assert [t.columns for t in here.tables] == [t.columns for t in there.tables]


def test_leaving_captures_out_changes_no_other(drawn: list[Case]) -> None:
    case = one(drawn, "gap", motor="servo-ipm")
    whole = case_from({**case.document(), "keep": STEMS})
    few = {c.path: c for c in blind_campaign(case).captures}
    all_of = {c.path: c for c in blind_campaign(whole).captures}
    assert set(few) < set(all_of)
    for path, capture in few.items():
        assert capture.tables[0].drop("t_s", strict=False).height == all_of[path].tables[0].height


@pytest.mark.parametrize("kind", ["drift", "hum", "mis-stated noise"])
def test_corruption_is_of_the_kind_and_size(kind: str) -> None:
    """Drift is a walk, hum one line of the mains and its third, noise white; one to four σ."""
    from tests.benchmark.bench import recorded

    place = station("gimbal-5208")
    made = recorded(place.motor, place.quiet, place.plan, 3, ("torque_map_0",))
    spoilt = corrupted(made, kind, place.motor, place.bench, np.random.default_rng(4))
    before, after = made[0].tables[0], spoilt[0].tables[0]
    np.testing.assert_array_equal(before["theta_mech_rad"], after["theta_mech_rad"])
    added = after["iq_a"] - before["iq_a"]
    sigma = noise_of("iq_a", place.motor, place.bench)
    assert sigma == pytest.approx(4e-4 * 9.0)
    rate = 1.0 / (before["t_s"][1] - before["t_s"][0])
    lines = np.abs(np.fft.rfft(added * np.hanning(added.size))) ** 2
    freq = np.fft.rfftfreq(added.size, 1.0 / rate)
    low = float(lines[freq < 200.0].sum() / lines.sum())
    if kind == "mis-stated noise":
        assert 0.4 * sigma < np.std(added) < 4.2 * sigma
        assert low < 0.1
        assert float(spoilt[0].meta["u_rel_current"]) < float(made[0].meta["u_rel_current"])
    else:
        assert low > 0.9
        assert spoilt[0].meta == made[0].meta
    if kind == "hum":
        top = freq[int(np.argmax(lines))]
        assert min(abs(top - 50.0), abs(top - 60.0)) < 2.0 * rate / added.size


def test_a_strange_corruption_is_refused() -> None:
    place = station("gimbal-5208")
    with pytest.raises(ValueError, match="no corruption"):
        corrupted([], "snow", place.motor, place.bench, np.random.default_rng(1))
