"""Constants of judgement are in the policy: what modules of criticism still hold is arithmetic."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.criticism.policy.policy import DEFAULT
from pipeline.records.policy import entries

CRITICISM = Path(__file__).resolve().parents[2] / "pipeline" / "criticism"
IN_POLICY = (
    "selection",
    "regression",
    "discovery",
    "validation",
    "design",
    "equations",
    "signals",
    "residuals",
    "data",
    "machine",
)
ARITHMETIC = {
    "discovery/bases.py": {"_EDGE"},  # beside zero and not at it
    "discovery/description.py": {"_POINTS", "_TURN_POINTS", "_DENSE", "_A_WAVE"},  # of a picture
    "discovery/dictionary.py": {"SHAPES", "_ABOVE_DEGC"},  # formulas; the model's temperature
    "discovery/matching_pursuit.py": {"_RIDGE"},  # against rounding
    "discovery/residual_inputs.py": {"_WIDE"},  # no bound
    "machine/iron.py": {"PARALLEL"},  # a choice of an effect
    "machine/inverter.py": {
        "_OTHERS",
        "_ROUNDS",
        "_SHARP",
        "_SHORT",
        "_SIN_120",
    },  # rounding; legs
    "machine/coenergy.py": {"_STEP"},  # a complex step
    "machine/model.py": {"BASE", "_NOTHING"},  # a centre of ±1/12; all but zero
    "machine/two_masses.py": {"LINEAR_COUPLING"},  # sizes that an effect states for itself
    "regression/bounds.py": {"_AT"},  # rounding
    "selection/free_shares.py": {"_FREE"},  # the whole of a share
    "signals/voltage.py": {"_EIGHTH_ORDER"},  # of a difference
    "residuals/segments.py": {"_ALTERNATING"},  # of third differences
    "signals/between_rows.py": {"ORDERS"},  # of three equal phases
    "selection/other_readings.py": {"_HALF_HOLD"},  # from the start of a hold to its middle
    "regression/fit.py": {"_SEED"},
    "regression/cross_validation.py": {"_MOST_BLOCKS"},  # numbers that are apart
    "regression/identifiability.py": {"_EDGE"},  # rounding
    "regression/linearise.py": {"_CHUNK"},  # the cache
    "regression/mains_hum.py": {"LINES_HZ", "_BESIDE", "_LOBE", "_FINER"},  # mains; Hann's window
    "regression/normal_equations.py": {"_TIE", "_SAFE"},  # rounding
    "regression/parallel.py": {"_THREADS"},  # how work is run
    "regression/sampler.py": {"_NOTHING", "_FINE"},  # rounding; differences
    "validation/free_run.py": {"_SEED"},
    # cells of a picture, when its waves are laid over each other; a turn
    "validation/signature.py": {"_CELLS", "_FEWEST", "_MANY_WAVES", "_FINE", "_FEWEST_PHASES"},
    "validation/trajectories.py": {"_PAD", "_START_S", "_PROBE"},  # samples kept; differences
    "data/segment.py": {"PAIR_RAD"},  # a turn
    # the grid of a search for a step; rounding; of a fixed point
    "data/rounding.py": {
        "_BITS",
        "_LOOKED_AT",
        "_STEPS",
        "_FIRST_WINDOW",
        "_WIDER",
        "_PLACES",
        "_KNOWN",
        "_SPACING",
        "_FINEST",
        "_REACH",
        "_FLOATING",
        "_DIGITS",
        "_MOST_DECIMALS",
        "_STAIRS",
        "_ALIKE",
    },
    "data/kept_digits.py": {"_MOST", "_LOOKED_AT", "_DISTINCT", "_FLOATING"},  # digits of a file
    "data/sensors.py": {"FREE"},  # of third differences
    # the grid of a search for a noise; digits of a file
    "data/encoder_noise.py": {"_SHIFTS", "_SHARES", "_BETWEEN", "_BLOCKS", "_NONE"},
    "data/machine_scale.py": {"_BINS_AN_ORDER", "_SAME_ANGLE"},  # twice Nyquist; rounding
    "data/traces.py": {"PAD", "_SHORTEST"},  # samples kept; three windows of eight
    "design/experiments.py": {"_SEED"},
    "equations/holding.py": {"_CRAWL", "_ROUNDS"},  # beside zero and not at it; of a fixed point
    "equations/lcr.py": {"_PROBE"},  # differences
    "equations/load.py": {"EQUATION"},  # an order of equations
    "equations/motion.py": {"EQUATION"},  # an order of equations
}
"""Numbers that are no judgement: rounding, seeds, formulas, pictures, how work is run."""


LATER = {"q_log", "drive_log"}
"""Modules whose numbers of judgement are not in the policy yet."""


def numbers(tree: ast.Module) -> Iterator[str]:
    """Names at the top of a module that hold a number."""
    for node in tree.body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None:
            continue
        held = (n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant))
        if any(isinstance(one, (int, float)) and not isinstance(one, bool) for one in held):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                yield from (n.id for n in ast.walk(target) if isinstance(n, ast.Name))


def modules() -> list[str]:
    found = [path for part in IN_POLICY for path in (CRITICISM / part).glob("*.py")]
    found += [
        path for path in CRITICISM.glob("*.py") if path.name not in ("effect.py", "operating.py")
    ]
    found = [path for path in found if path.stem not in LATER]
    return sorted(path.relative_to(CRITICISM).as_posix() for path in found)


@pytest.mark.parametrize("name", modules())
def test_a_number_at_the_top_of_a_module_is_no_judgement(name: str) -> None:
    left = set(numbers(ast.parse((CRITICISM / name).read_text(encoding="utf-8"))))
    known = ARITHMETIC.get(name, set())
    assert left - known == set(), "make it a field of pipeline/criticism/policy"
    assert known - left == set(), "no longer there"


def test_a_threshold_is_seen() -> None:
    tree = ast.parse("_SHARE, _MOST = 0.5, 3\nNAMES = ('a',)\n_LEAST: float = 1e-3\n")
    assert set(numbers(tree)) == {"_SHARE", "_MOST", "_LEAST"}


def test_every_number_of_the_policy_is_used() -> None:
    """By its attribute, or by its name in a table of names."""
    modules = [p for p in CRITICISM.rglob("*.py") if p.parent.name != "policy"]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in modules]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    used = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    used |= {node.value for node in nodes if isinstance(node, ast.Constant) and node.value}
    idle = {"quick_starts", "quick_rounds", "thorough_starts", "thorough_rounds"}  # by pairs
    names = {entry.name.rpartition(".")[2] for entry in entries(DEFAULT)}
    assert names - used - idle == set()
