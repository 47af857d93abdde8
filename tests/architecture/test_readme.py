"""README and CONTRIBUTING say what is there: commands, links, and examples that run."""

from __future__ import annotations

import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from pipeline.cli.commands import COMMANDS
from pipeline.contracts.protocol import Gate
from pipeline.criticism.effect import Effect
from pipeline.crosscheck.protocol import Rule
from pipeline.estimation.protocol import Estimator
from pipeline.export.protocol import Exporter, Source
from pipeline.io.maps.map_file import parse_source_file
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PAGES = {"README.md": README, "CONTRIBUTING.md": CONTRIBUTING}


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", CONTRIBUTING, flags=re.MULTILINE | re.DOTALL)


def example(name: str) -> types.ModuleType:
    """The module that the example defining `name` makes."""
    (source,) = [text for text in blocks("python") if re.search(rf"^(def )?{name}\b", text, re.M)]
    module = types.ModuleType("example")
    exec(compile(source, f"CONTRIBUTING.md:{name}", "exec", dont_inherit=True), vars(module))
    return module


def capture(test: str, table: dict[str, Any], **meta: Any) -> Capture:
    known = CaptureMeta("M1", test, **meta)
    return Capture("a.csv", "0" * 64, "unverified", known, (pl.DataFrame(table),))


@pytest.mark.parametrize("page", PAGES)
def test_make_targets_exist(page: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"(?:`|^ {4})make ([a-z-]+)", PAGES[page], flags=re.MULTILINE))
    assert "test" in named
    assert named <= targets


def test_every_command_is_in_the_readme_and_exists() -> None:
    section = README.split("## Commands")[1].split("| exit code")[0]
    named = re.findall(r"^\| `([a-z]+)[^`]*` \|", section, flags=re.MULTILINE)
    assert sorted(named) == sorted(COMMANDS)


@pytest.mark.parametrize("page", PAGES)
def test_links_and_files_exist(page: str) -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", PAGES[page])
    paths = re.findall(r"`((?:pipeline|conf|tests|docs|\.ci)/[^`]*)`", PAGES[page])
    absent = [name for name in {*links, *paths} if not (ROOT / name).exists()]
    assert not absent


def test_packages_are_all_named() -> None:
    packages = {p.name for p in (ROOT / "pipeline").iterdir() if (p / "__init__.py").is_file()}
    named = set(re.findall(r"^ {6}([a-z]+)/ ", README, flags=re.MULTILINE))
    assert named <= packages
    assert packages - named <= {"lots"}


def test_example_estimator_finds_the_supply() -> None:
    estimator = example("ESTIMATOR").ESTIMATOR
    assert isinstance(estimator, Estimator)
    current = np.linspace(0.0, 20.0, 200)
    volts = 48.0 - 0.05 * current + 1e-3 * np.sin(37.0 * current)
    table = {"t_s": current, "vdc_v": volts, "idc_a": current}
    campaign = Campaign("M1", (capture("drive", table, u_rel_voltage=0.003, u_rel_current=0.004),))
    (found,) = estimator.fit(campaign, Constants(), estimator.options).estimates
    assert found.number == pytest.approx(0.05, abs=3.0 * found.u_a)
    assert found.u_b == pytest.approx(0.05 * 0.005, rel=0.01)
    (missing,) = estimator.fit(Campaign("M1", ()), Constants(), estimator.options).estimates
    assert missing.status == "not_identifiable"


@pytest.mark.parametrize(
    ("measured", "status"), [(300.0, "pass"), (360.0, "fail"), (None, "not_evaluated")]
)
def test_example_check(measured: float | None, status: str) -> None:
    rule = example("RULE").RULE
    assert isinstance(rule, Rule)
    name, budget = "kv_ll_peak_rpm_v", type_a("scatter:x", 1.0)
    constants = Constants()
    if measured is not None:
        kv = Estimate(name, measured, "rpm/V", "measured", "x", budget)
        constants = Constants((kv,))
    campaign = Campaign("M1", (capture("drive", {"t_s": [0.0]}, extra={"kv_rpm_v": "300"}),))
    assert rule.check(constants, campaign, rule.options).status == status


def test_example_gate() -> None:
    gate = example("GATE").GATE
    assert isinstance(gate, Gate)
    hot = capture("heat_run", {"t_s": [0.0, 1.0, 2.0], "temp_winding_degc": [20.0, 160.0, 170.0]})
    (finding,) = gate.check(hot, gate.options).findings
    assert finding.rows == (1, 2)
    cool = capture("heat_run", {"t_s": [0.0], "temp_winding_degc": [20.0]})
    assert gate.check(cool, gate.options).findings == ()


def test_example_effect() -> None:
    effect = example("EFFECT").EFFECT
    assert isinstance(effect, Effect)
    assert effect.hook == "torque"


def test_example_source_map_is_read() -> None:
    (source,) = blocks("yaml")
    found = parse_source_file(source.encode(), "hall")["hall"]
    assert found.recognises("x.csv", "Time;RPM;Iq;Vbus\n0;1;2;3\n", ())
    assert {part.column for part in found.fields} == {"t_s", "omega_mech_rad_s", "iq_a", "vdc_v"}
    assert found.metadata_for("x.csv")["test"] == "drive"


def test_example_exporter() -> None:
    exporter = example("EXPORTER").EXPORTER
    assert isinstance(exporter, Exporter)
    constants = {
        name: Estimate(name, 7.0, unit, "measured", "x")
        for name, unit in (("r_phase_ohm", "ohm"), ("kv_ll_peak_rpm_v", "rpm/V"))
    }
    none = ("M", None, None, "v", "released", (), (), "c", "0", constants, (), ())
    source = Source(Datasheet(*none), 1)  # type: ignore[arg-type]
    text = exporter.render(source, {})
    assert "resistance_line_ohm=14.0" in text
    assert exporter.read(text) == {"r_phase_ohm": 7.0, "kv_ll_peak_rpm_v": 7.0}
    constants["r_phase_ohm"] = not_identifiable("r_phase_ohm", "ohm", "x", "record a resistance")
    with pytest.raises(UsageError, match="record a resistance"):
        exporter.render(source, {})


@pytest.mark.parametrize(
    "package", ["estimation/estimators", "crosscheck/rules", "contracts/gates", "export/exporters"]
)
def test_examples_are_in_the_style_of_the_project(package: str) -> None:
    """Each example passes the linter and the formatter in the package it is for."""
    mark = {
        "estimation/estimators": "ESTIMATOR",
        "crosscheck/rules": "RULE",
        "contracts/gates": "GATE",
        "export/exporters": "EXPORTER",
    }
    (source,) = [text for text in blocks("python") if f"\n{mark[package]} = " in text]
    name = f"--stdin-filename=pipeline/{package}/example.py"
    for words in (["check", name], ["format", "--check", name]):
        command = [sys.executable, "-m", "ruff", *words, "-"]
        done = subprocess.run(
            command, input=source, cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
