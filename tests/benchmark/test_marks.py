"""Marks of hand-made diagnoses, and the shares and intervals made of them."""

from __future__ import annotations

from typing import Any

import pytest

from tests.benchmark.cases import Case
from tests.benchmark.scoring import judged
from tests.benchmark.table import Line, by_effect, interval, lines, table
from tests.benchmark.values import compared


def case(family: str = "size", **what: Any) -> Case:
    values: dict[str, Any] = {
        "line": "2 a*",
        "number": 0,
        "motor": "gimbal-5208",
        "model": "standard",
        "seed": 7,
    }
    return Case(family, **{**values, **what})


def document(
    verdict: str,
    *missing: str,
    confused: dict[str, list[str]] | None = None,
    held_out: float = 1.0,
    variables: tuple[str, ...] = (),
    parameters: dict[str, dict[str, dict[str, float]]] | None = None,
    remainder: tuple[bool, ...] = (),
) -> dict[str, Any]:
    return {
        "schema": "model-diagnosis/1",
        "verdict": verdict,
        "missing": list(missing),
        "ranking": [
            {
                "effect": name,
                "confused_with": (confused or {}).get(name, []),
                "parameters": (parameters or {}).get(name, {}),
            }
            for name in missing
        ],
        "ladder": [{"effects": list(missing), "held_out": held_out, "signals": {}}],
        "unknown": {"variables": list(variables)} if verdict == "unknown" else None,
        "remainder": [{"matters": matters} for matters in remainder],
    }


def slight(*told: tuple[str, float, float | None]) -> dict[str, Any]:
    """An `adequate` with effects (name, score, size over the least that matters) in its ranking."""
    ranking = [
        {"effect": name, "score": score, "size": size, "confused_with": [], "parameters": {}}
        for name, score, size in told
    ]
    return {**document("adequate"), "ranking": ranking}


PLAIN = case(truth=("windage",), accepted={"windage": ()})
TIED = case("tie", truth=("windage",), accepted={"windage": ("iron_eddy",)})
PAIR = case("set", truth=("windage", "cogging"), accepted={"windage": (), "cogging": ()})
UNSEEN = case("gap", truth=("windage",), accepted={"windage": ()}, nothing=True)
NULL = case("null", line="clean")
STRANGE = case("outside", outside="contact", outside_size=1.0)
CROWD = case("crowd", truth=("windage",), accepted={"windage": ()}, allowed=("cogging",))


@pytest.mark.parametrize(
    ("sealed", "said", "mark", "points"),
    [
        (PLAIN, document("missing", "windage"), "right", 1),
        (PLAIN, document("missing", "iron_eddy"), "wrong", -5),
        (PLAIN, document("missing", "windage", "cogging"), "wrong", -5),
        (PLAIN, document("unknown", "iron_eddy"), "unknown", 0),
        (PLAIN, document("unknown"), "unknown", 0),
        (PLAIN, document("adequate"), "missed", 0),
        (PLAIN, document("insufficient"), "missed", 0),
        (PLAIN, {"failure": "ValueError: x"}, "failed", 0),
        (TIED, document("missing", "windage", confused={"windage": ["iron_eddy"]}), "tie", 1),
        (TIED, document("missing", "iron_eddy", confused={"iron_eddy": ["windage"]}), "tie", 1),
        (TIED, document("missing", "windage"), "singled out", 0),
        (TIED, document("missing", "iron_eddy"), "wrong", -5),
        (TIED, document("missing", "cogging", confused={"cogging": ["windage"]}), "wrong", -5),
        (PAIR, document("missing", "cogging", "windage"), "right", 1),
        (PAIR, document("missing", "cogging"), "missed", 0),
        (PAIR, document("missing", "cogging", "windage", "unbalance"), "wrong", -5),
        (UNSEEN, document("insufficient"), "right", 1),
        (UNSEEN, document("adequate"), "right", 1),
        (UNSEEN, document("missing", "cogging"), "wrong", -5),
        (NULL, document("adequate"), "right", 1),
        (NULL, document("insufficient"), "missed", 0),
        (NULL, document("unknown"), "unknown", 0),
        (NULL, document("missing", "cogging"), "wrong", -5),
        (STRANGE, document("adequate"), "missed", 0),
        (STRANGE, document("missing", "dead_time"), "wrong", -5),
        (STRANGE, document("unknown", "dead_time"), "unknown", 0),
        (CROWD, document("missing", "windage", "cogging"), "right", 1),
        (CROWD, document("missing", "cogging"), "missed", 0),
        (CROWD, document("missing", "windage", "unbalance"), "wrong", -5),
    ],
)
def test_marks(sealed: Case, said: dict[str, Any], mark: str, points: int) -> None:
    found = judged(sealed, said)
    assert (found.mark, found.points) == (mark, points)


def test_sets_count_what_was_found_of_what_was_hidden() -> None:
    found = judged(PAIR, document("missing", "cogging"))
    assert (found.found, found.hidden, found.exact) == (1, 2, False)
    assert judged(PAIR, document("missing", "windage", "cogging")).exact


def test_names_told_beside_an_unknown_remainder_are_found_but_no_exact_set() -> None:
    found = judged(PAIR, document("unknown", "windage", "cogging"))
    assert (found.mark, found.found, found.exact) == ("unknown", 2, False)
    tied = judged(TIED, document("missing", "iron_eddy", confused={"iron_eddy": ["windage"]}))
    assert (tied.found, tied.exact) == (1, True)


def test_flag_and_sketch_of_the_unknown() -> None:
    right = judged(STRANGE, document("unknown", variables=("iq_a",)))
    other = judged(STRANGE, document("unknown", variables=("omega_mech_rad_s",)))
    assert (right.flagged, right.sketch) == (True, True)
    assert (other.flagged, other.sketch) == (True, False)
    assert judged(STRANGE, document("adequate")).sketch is False
    assert judged(PLAIN, document("missing", "windage", remainder=(True, False))).flagged


def test_a_remainder_too_small_to_matter_is_told_and_no_flag() -> None:
    small = judged(PLAIN, document("missing", "windage", remainder=(False,)))
    assert (small.left, small.flagged) == (True, False)
    assert not judged(PLAIN, document("missing", "windage")).left
    assert judged(STRANGE, document("unknown")).left


@pytest.mark.parametrize(
    ("count", "total", "low", "high"),
    [(0, 10, 0.0, 0.3085), (5, 10, 0.1871, 0.8129), (10, 10, 0.6915, 1.0), (1, 30, 0.0008, 0.1722)],
)
def test_interval_of_clopper_and_pearson(count: int, total: int, low: float, high: float) -> None:
    """Values of published tables."""
    assert interval(count, total) == (pytest.approx(low, abs=6e-5), pytest.approx(high, abs=6e-5))


def test_a_line_says_whether_it_is_what_was_asked_for() -> None:
    assert Line("x", 99, 100, least=0.98).met is True
    assert Line("x", 97, 100, least=0.98).met is False
    assert Line("x", 2, 100, most=0.01).met is False
    assert Line("x", 95, 100, 0.92, 0.98).met is True
    assert Line("x", 99, 100, 0.92, 0.98).met is False
    assert Line("x", 0, 0, least=0.9).met is None
    assert Line("x", 5, 100).met is None


PAIRS = [
    (PLAIN, document("missing", "windage", held_out=1.04)),
    (case(truth=("windage",), number=1), document("missing", "cogging", held_out=1.3)),
    (case(truth=("skin_effect",), number=2), document("unknown")),
    (PAIR, document("missing", "cogging", held_out=1.2)),
    (NULL, document("adequate")),
    (case("null", line="hum"), document("missing", "cogging")),
    (STRANGE, document("unknown", variables=("iq_a",))),
    (TIED, document("missing", "windage")),
]


def test_shares_of_the_table() -> None:
    found = {line.what: (line.count, line.total, line.met) for line in lines(PAIRS)}
    assert found["2 a*: right"] == (1, 3, False)
    assert found["2 a*: wrong with confidence"] == (1, 3, False)
    assert found["2 a*: unknown"] == (1, 3, None)
    assert found["nothing hidden, clean: false name"] == (0, 1, True)
    assert found["nothing hidden, coloured: false name"] == (1, 1, False)
    assert found["2 to 5 effects: exact set"] == (0, 1, False)
    assert found["2 to 5 effects: recall (also under `unknown`)"] == (1, 2, False)
    assert found["outside the library: flagged"] == (1, 1, True)
    assert found["outside the library: right variable"] == (1, 1, True)
    assert found["ties: one singled out"] == (1, 1, False)
    assert found["held-out error at most 1.05 of the floor"] == (3, 5, False)
    assert found["diagnosis broke down"] == (0, 8, True)


def test_the_table_holds_counts_intervals_and_points() -> None:
    text = table(PAIRS, "heading")
    assert "| 2 a*: right | 33.3 % (1/3) | 0.8 to 90.6 % | at least 98 % | no (few) |" in text
    assert "| 1 a*" not in text
    assert "-8 of 8" in text.splitlines()[-1]
    assert "| `windage` | 1/2 |" in by_effect(PAIRS)


def test_values_where_both_mean_the_same() -> None:
    hidden = case(truth=("torque_offset",), effects={"torque_offset": {"size": 0.02}})
    said = {"torque_offset": {"offset_nm": {"value": 0.0202, "u": 1.5e-4}}}
    (found,) = compared(hidden, document("missing", "torque_offset", parameters=said))
    assert (found.error, found.covered) == (pytest.approx(0.01), True)
    said = {"torque_offset": {"offset_nm": {"value": 0.0202, "u": 0.9e-4}}}
    (found,) = compared(hidden, document("missing", "torque_offset", parameters=said))
    assert not found.covered
    assert list(compared(hidden, document("missing", "windage"))) == []


def test_a_sine_and_a_cosine_make_one_magnitude() -> None:
    hidden = case(truth=("unbalance",), effects={"unbalance": {"size": 0.005}})
    said = {
        "unbalance": {"sin_nm": {"value": 0.003, "u": 1e-5}, "cos_nm": {"value": -0.004, "u": 1e-5}}
    }
    (found,) = compared(hidden, document("missing", "unbalance", parameters=said))
    assert found.error == pytest.approx(0.0, abs=1e-12)


def test_a_gain_is_the_fault_and_the_stations_own() -> None:
    """The station's gain is drawn from the case's seed; the fault alone would be judged wrongly."""
    import numpy as np

    from tests.benchmark.bench import station

    place = station("gimbal-5208")
    first = np.random.SeedSequence(7).spawn(1)[0]
    gain = place.bench.drawn(np.random.default_rng(first)).torque
    hidden = case(truth=("torque_scale",), effects={"torque_scale": {"size": 0.02}})
    said = {"torque_scale": {"gain": {"value": 1.02 * gain - 1.0, "u": 1e-6}}}
    (found,) = compared(hidden, document("missing", "torque_scale", parameters=said))
    assert found.error < 1e-12
    assert abs(gain - 1.0) > 1e-5


@pytest.mark.parametrize(
    ("effect", "names"),
    [
        ("phase_imbalance", ("cosine", "sine")),
        ("current_gain", ("cosine", "sine")),
        ("current_offset", ("alpha_a", "beta_a")),
    ],
)
def test_vectors_of_three_phases(effect: str, names: tuple[str, str]) -> None:
    """The vector of three phases, worked out from the phases, gives the size back."""
    import numpy as np

    size, angle = 0.03, 0.4
    axis = np.exp(2j * np.pi * np.arange(3) / 3.0)
    if effect == "phase_imbalance":
        # (2/3) sum R_k i_k a_k with i_k = Re(i conj(a_k)): the part along conj(i)
        factor = size * np.cos(2.0 * np.pi * np.arange(3) / 3.0 - angle)
        vector = np.sum(factor * axis**2) / 3.0
    elif effect == "current_gain":
        vector = np.sum(np.array([0.0, size, 0.0]) * axis**2) / 3.0
    else:
        vector = 2.0 / 3.0 * np.sum(np.array([0.0, size, 0.0]) * axis)
    said = {
        effect: {
            names[0]: {"value": float(vector.real), "u": 1e-6},
            names[1]: {"value": float(vector.imag), "u": 1e-6},
        }
    }
    hidden = case(truth=(effect,), effects={effect: {"size": size}})
    (found,) = compared(hidden, document("missing", effect, parameters=said))
    assert (found.error, found.covered) == (pytest.approx(0.0, abs=1e-9), True)


def test_size_of_an_effect_of_another_form() -> None:
    """Windage c w² at 0.95 of rated speed; 2 % more is an error of 2 %, without an interval."""
    from tests.benchmark.bench import station

    speed = 0.95 * station("gimbal-5208").motor.speed_rated_rad_s
    hidden = case(truth=("windage",), effects={"windage": {"size": 1e-7}})
    said = {"windage": {"drag_nm": {"value": 1.02 * 1e-7 * speed**2, "u": 1e-9}}}
    (found,) = compared(hidden, document("missing", "windage", parameters=said))
    assert (found.error, found.covered) == (pytest.approx(0.02), None)


@pytest.mark.parametrize(
    ("of", "told", "expected"),
    [
        (PLAIN, [("windage", 40.0, 0.2), ("cogging", 3.0, 0.1)], True),
        (PLAIN, [("cogging", 40.0, 0.2), ("windage", 3.0, 0.1)], False),
        (TIED, [("iron_eddy", 40.0, 0.2)], True),
        (PLAIN, [("windage", -3.0, 0.2)], None),
        (PLAIN, [("compliance", 40.0, 12.0), ("windage", 20.0, 0.3)], True),
        (NULL, [("windage", 40.0, 0.2)], False),
        (NULL, [("windage", 40.0, None)], None),
    ],
)
def test_what_is_seen_and_too_small_is_marked_by_the_clearest(of, told, expected):
    assert judged(of, slight(*told)).slight is expected


def test_a_slight_effect_is_missed_and_has_its_own_line():
    pairs = [(PLAIN, slight(("windage", 40.0, 0.2))), (PLAIN, slight(("cogging", 40.0, 0.2)))]
    shares = {line.what: (line.count, line.total) for line in lines(pairs)}
    assert shares["2 a*: right"] == (0, 2)
    assert shares["2 a*: right, or reported as too small to matter"] == (1, 2)
    assert shares["2 a*: another reported as too small to matter"] == (1, 2)
