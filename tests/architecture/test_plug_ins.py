"""A plug-in is one file: dropped into its package, it is found, and nothing else is touched."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import polars as pl
import pytest

from pipeline.contracts import gates as gates_package
from pipeline.contracts.registry import gates
from pipeline.contracts.validate import validate
from pipeline.criticism import equations as equations_package
from pipeline.criticism.library.equations import equations
from pipeline.criticism.machine.model import Model
from pipeline.criticism.parameter import SCALES, Machine
from pipeline.criticism.regression.gauss_newton import start_values
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.crosscheck import rules as rules_package
from pipeline.crosscheck.registry import check_all, rules
from pipeline.estimation import estimators as estimators_package
from pipeline.estimation.registry import estimators, fit_all
from pipeline.export import exporters as exporters_package
from pipeline.export.registry import exporters
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants

ESTIMATOR = '''
"""Rows a capture, as a constant."""
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.physics.glossary import Term
from pipeline.records.estimate import Estimate

def fit(campaign, known, options):
    rows = sum(table.height for c in campaign.captures for table in c.tables)
    value = rows * options["weight"]
    return Fit((Estimate("dropped_in_count", value, "1", "measured", "dropped_in"),))

ESTIMATOR = Estimator(
    "dropped_in", ("dropped_in_count",), ("flux_map",), "record a flux_map", fit,
    terms=(Term("dropped_in_count", "1", "rows", "constant", 0.0, 1e9),), options={"weight": 2.0},
)
'''

RULE = '''
"""Whether anything was dropped in."""
from pipeline.crosscheck.protocol import Rule
from pipeline.records.datasheet import Check

def check(constants, campaign, options):
    return Check("dropped_in", "pass", f"of {len(campaign.captures)} captures")

RULE = Rule("dropped_in", check)
'''

GATE = '''
"""A gate that says how many rows it saw."""
from pipeline.contracts.protocol import Gate, Passed, warning

def check(capture, options):
    rows = capture.tables[0].height
    return Passed(findings=(warning(capture, "dropped_in", f"{rows} rows", "none"),))

GATE = Gate("dropped_in", ("flux_map",), check)
'''

EXPORTER = '''
"""Pole pairs alone."""
from pipeline.export.protocol import Exporter

def render(source, options):
    return repr(source.value("pole_pairs"))

def read(text):
    return {"pole_pairs": float(text)}

EXPORTER = Exporter("dropped_in", "txt", "pole pairs", render, read)
'''

EQUATION = '''
"""A flux map whose rows count twice."""
from dataclasses import replace
from pipeline.criticism.equations.flux_map import EQUATION as FLUX_MAP

def cut(capture, machine):
    return replace(FLUX_MAP.cut(capture, machine), kind="dropped_in")

EQUATION = replace(FLUX_MAP, name="dropped_in", cut=cut)
'''


@pytest.fixture
def drop_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Puts one file into a package for the length of a test."""
    registries = (estimators, rules, gates, exporters, equations)

    def drop(package: ModuleType, source: str) -> None:
        (tmp_path / "dropped_in.py").write_text(source)
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
        for registry in registries:
            registry.cache_clear()

    yield drop
    monkeypatch.undo()
    for registry in registries:
        registry.cache_clear()
    for name in [n for n in sys.modules if n.endswith(".dropped_in")]:
        del sys.modules[name]


@pytest.fixture
def capture() -> Capture:
    table = pl.DataFrame(
        {
            "id_a": [0.0, 1.0, 0.0, 1.0],
            "iq_a": [0.0, 0.0, 1.0, 1.0],
            "psi_d_wb": [0.01, 0.0102, 0.01, 0.0102],
            "psi_q_wb": [0.0, 0.0, 0.0003, 0.0003],
        }
    )
    meta = CaptureMeta("m", "flux_map")
    return Capture("map.csv", "0" * 64, "verified", meta, (table,))


def test_an_estimator_is_one_file(drop_in: Callable[..., None], capture: Capture) -> None:
    """Found, run with its own option and its own constant, with no other file edited."""
    drop_in(estimators_package, ESTIMATOR)
    assert "dropped_in" in {estimator.name for estimator in estimators()}
    constants = fit_all(Campaign("m", (capture,)), {"dropped_in": {"weight": 3.0}})[0]
    best = constants.best("dropped_in_count")
    assert best is not None
    assert best.value == 12.0


def test_a_rule_is_one_file(drop_in: Callable[..., None], capture: Capture) -> None:
    drop_in(rules_package, RULE)
    checks = check_all(Constants(), Campaign("m", (capture,)), {})
    assert [c.meaning for c in checks if c.name == "dropped_in"] == ["of 1 captures"]


def test_a_gate_is_one_file(drop_in: Callable[..., None], capture: Capture) -> None:
    assert validate(capture, {})[1] == ()
    drop_in(gates_package, GATE)
    findings = validate(capture, {})[1]
    assert [(f.code, f.message) for f in findings] == [("dropped_in", "4 rows")]
    assert validate(capture, {"dropped_in": {"enabled": 0.0}})[1] == ()


def test_an_exporter_is_one_file(drop_in: Callable[..., None]) -> None:
    drop_in(exporters_package, EXPORTER)
    assert exporters()["dropped_in"].read("7.0") == {"pole_pairs": 7.0}


def test_an_equation_is_one_file(drop_in: Callable[..., None], capture: Capture) -> None:
    """A capture of its test makes a segment more, and residuals are its own."""
    machine = Machine(7, None, dict.fromkeys(SCALES, 1.0))
    model = Model(machine, ())
    drop_in(equations_package, EQUATION)
    made = segments(Campaign("m", (capture,)), machine)
    assert {segment.kind for segment in made} == {"flux_map", "dropped_in"}
    values = start_values(model, machine)
    first, second = (residual(segment, model, values) for segment in made)
    assert (first == second).all()


def test_packages_are_clean_again() -> None:
    """The tests above leave nothing behind."""
    plugs = (
        *estimators(),
        *rules(),
        *gates(),
        *exporters().values(),
        *equations().values(),
    )
    assert "dropped_in" not in {plug.name for plug in plugs}
