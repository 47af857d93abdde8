"""What `import pipeline` offers, held against what the commands write."""

from __future__ import annotations

import doctest
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

import pipeline
from pipeline.__main__ import main
from pipeline.api.figure import figure
from pipeline.records.errors import UsageError

ROOT = Path(__file__).parents[3]
DEMO = ROOT / "data" / "demo"
MOTOR = "G52-0601"
TESTS = ("cogging", "current_step", "lcr", "resistance", "spin_down")
FILES = (
    *("cogging_cw", "cogging_ccw", "current_step_d_0", "current_step_q_0", "lcr"),
    *("resistance", "spin_down_forward"),
)
"""Captures that tell many constants of the motor, and an effect that the model lacks."""
MODULES = ("recordings", "fits", "datasheets", "models", "simulated")
LONG = "pipeline.api.models.diagnose"
"""The function whose example searches a model."""


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """A folder of the motor with a few of its captures."""
    folder = tmp_path_factory.mktemp("captures")
    (folder / MOTOR).mkdir()
    for path in (DEMO / MOTOR).iterdir():
        if path.name.startswith(FILES):
            shutil.copy(path, folder / MOTOR)
    return folder


@pytest.fixture(scope="module")
def recordings(captures):
    return pipeline.read(captures, motor=MOTOR).only(tests=TESTS)


@pytest.fixture(scope="module")
def fits(recordings):
    return pipeline.fit(recordings)


@pytest.fixture(scope="module")
def sheets(fits):
    return pipeline.check(fits)


def test_every_public_name_is_there():
    assert all(callable(getattr(pipeline, name)) for name in pipeline.__all__)
    assert set(pipeline.__all__) <= set(dir(pipeline))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'datasheet'"):
        pipeline.datasheet  # noqa: B018


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        ("pipeline", {"numpy", "polars", "scipy"}),
        ("pipeline.criticism.diagnosis", {"scipy.signal", "scipy.stats"}),
        ("pipeline.stages.diagnose", {"scipy", "polars"}),
    ],
)
def test_importing_a_module_imports_no_slow_library(module, slow):
    """`scipy.signal` and `scipy.stats` were half of what a diagnosis took to begin, and scipy most
    of what it did before its workers were started.
    """
    code = f"import {module}, sys; print(sorted({slow} & set(sys.modules)))"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, check=True
    )
    assert done.stdout.strip() == b"[]"


@pytest.mark.parametrize("long", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", MODULES)
def test_the_examples_in_docstrings_run(name, long, monkeypatch):
    monkeypatch.chdir(ROOT)
    module = importlib.import_module(f"pipeline.api.{name}")
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    every = [one for one in doctest.DocTestFinder().find(module) if one.examples]
    for one in every:
        if (one.name == LONG) == long:
            runner.run(one)
    assert every
    assert runner.summarize().failed == 0


def test_a_run_and_the_functions_give_the_same_datasheet(sheets, captures, tmp_path):
    """To the byte: version, constants, checks and reasons."""
    sheet = sheets[MOTOR]
    output = tmp_path / "out"
    words = ["recordings=false", "report=false", "workers=1"]
    assert main(["run", f"input={captures}", f"output={output}", *words]) in (0, 1)
    written = json.loads((output / "datasheets" / f"{MOTOR}.json").read_text())
    assert json.loads(json.dumps(sheet.document())) == written
    loaded = pipeline.load(output)
    assert loaded[MOTOR] == sheet or loaded[MOTOR].document() == sheet.document()
    assert loaded.constants.filter(pl.col("motor_id") == MOTOR).equals(sheets.constants)


def test_frames_are_tidy_and_agree_with_the_records(recordings, fits):
    constants = fits.constants
    assert constants.select("motor_id", "constant").is_unique().all()
    for row in constants.iter_rows(named=True):
        estimate = fits[MOTOR].constants.chosen()[row["constant"]]
        assert row["value"] == (None if estimate.value is None else float(estimate.value))
        if estimate.known and estimate.u > 0:
            assert row["low_95"] < row["value"] < row["high_95"]
    rows = recordings.captures
    assert rows.height == len(recordings[MOTOR].captures)
    assert rows["rows"].sum() == sum(t.height for c in recordings[MOTOR].captures for t in c.tables)
    residuals = fits.residuals.filter(pl.col("fitted").is_finite())
    difference = residuals["measured"] - residuals["fitted"] - residuals["residual"]
    assert difference.abs().max() == 0.0


def test_a_terminal_shows_a_table_and_no_arrays(recordings, fits, sheets):
    for result, heading, column in (
        (recordings, "Recordings: 1 motor, 0 findings", "test"),
        (fits, "Fits: 1 motor", "constant"),
        (sheets, "Datasheets: 1 motor", "status"),
    ):
        for text in (repr(result), result._repr_html_()):
            assert heading in text
            assert column in text
            assert MOTOR in text
        assert len(repr(result)) < 3000
    assert dict(fits.items()) == dict(fits.motors)


def test_the_result_of_one_motor_fits_a_terminal(recordings, fits, sheets):
    """They were 50 to 125 kB each."""
    results = (recordings[MOTOR], recordings[MOTOR].captures[0], fits[MOTOR], sheets[MOTOR])
    operated = pipeline.operate(sheets[MOTOR], vdc_v=24.0, current_a=9.0)
    for one in (*results, operated):
        assert MOTOR in repr(one)
        assert len(repr(one)) < 4000, type(one)
    assert "captures: 2 cogging, 2 current_step" in repr(recordings[MOTOR])


def test_a_folder_without_a_capture_names_what_it_holds(tmp_path):
    """Somebody's own CSV gave 0 motors and 0 findings, and nothing said why."""
    (tmp_path / "log.csv").write_text("Time,Current\n0.0,1.0\n")
    recordings = pipeline.read(tmp_path)
    assert repr(recordings).startswith(
        "Recordings: 0 motors, 0 findings; 1 file is no capture and was left alone: log.csv"
    )
    assert pipeline.read(DEMO, motor=MOTOR).note.endswith("README.md")


def test_part_of_the_recordings(recordings):
    few = recordings.only(tests=("spin_down",))
    assert set(few.captures["test"]) == {"spin_down"}
    assert recordings.only(tests="spin_down").captures.equals(few.captures)
    assert len(recordings.only(motor="nobody")) == 0
    with pytest.raises(KeyError, match="no capture 'spin_down'; "):
        recordings.signals("spin_down")


def test_a_motor_that_is_not_there_is_named_with_those_that_are(recordings, fits, sheets):
    for get in (recordings, fits, sheets):
        with pytest.raises(KeyError, match=f"no motor 'G52-0602'; did you mean {MOTOR}"):
            get["G52-0602"]
        assert "G52-0602" not in get
    assert sheets.get("G52-0602") is None
    with pytest.raises(KeyError, match="no motor 'G52-0602'"):
        fits.plot("current_step", motor="G52-0602")


def test_a_plot_is_a_document_of_its_own(fits, tmp_path):
    from xml.etree import ElementTree as Xml

    (first, *_) = fits.plot("current_step")
    path = first.save(tmp_path / "plot.svg")
    assert Xml.parse(path).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert "data:image/svg+xml;base64," in first._repr_html_()

    with pytest.raises(KeyError, match="no plot of nothing"):
        fits.plot("nothing")


def test_a_saved_plot_has_the_whole_rules_of_the_report_s_drawings():
    """A style sheet of other line breaks once left selectors without their rules."""
    style = figure("a drawing", "<svg></svg>").svg.partition("<![CDATA[")[2].partition("]]>")[0]
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", style.replace(":root {", "").replace("}\n}", "}"))
    found = {selector.strip(): body for selector, body in rules}
    assert style.count("{") == style.count("}") > 40
    assert "stroke: var(--measured)" in found["svg .measured"]
    assert "text-anchor: end" in found["svg .tick.y,\nsvg .scale"]


def test_what_is_wrong_is_said():
    with pytest.raises(UsageError, match="no capture of motor nobody"):
        pipeline.read(DEMO, motor="nobody")
    with pytest.raises(UsageError, match="no such estimator"):
        pipeline.fit(pipeline.simulate(exact=True).only(tests=("lcr",)), options={"nothing": {}})
    with pytest.raises(UsageError, match="no model 'perfect'"):
        pipeline.compare(pipeline.simulate().only(tests=("lcr",)), "perfect")


def test_arguments_that_cannot_be_meant(recordings, fits, sheets):
    """Each was taken in silence, or ended in an error that did not name it."""
    with pytest.raises(UsageError, match="no such gate"):
        pipeline.read(DEMO / MOTOR, gates={"nothing": {"enabled": 0}})
    with pytest.raises(UsageError, match="enabled=no is not 1 or 0"):
        pipeline.simulate(gates={"clock_jump": {"enabled": "no"}})
    with pytest.raises(UsageError, match="release=at_once is unknown"):
        pipeline.check(fits, release="at_once")
    for function, given in (
        (pipeline.compare, recordings),
        (pipeline.diagnose, recordings),
        (pipeline.check, fits),
    ):
        with pytest.raises(UsageError, match=r"write effects=\['cogging'\]"):
            function(given, effects="cogging")
    for function in (pipeline.fit, pipeline.compare, pipeline.diagnose):
        with pytest.raises(TypeError, match="a Fits is neither Recordings nor a folder"):
            function(fits)
    with pytest.raises(TypeError, match="the result of fit, not a Recordings"):
        pipeline.check(recordings)
    with pytest.raises(TypeError, match="one datasheet"):
        pipeline.operate(sheets, vdc_v=24.0, current_a=9.0)


def test_results_of_no_motor(recordings):
    nobody = recordings.only(motor="nobody")
    fits, comparisons = pipeline.fit(nobody), pipeline.compare(nobody)
    assert comparisons.residuals.columns[:3] == ["motor_id", "capture", "signal"]
    assert comparisons.errors.height == 0
    for plot in (
        lambda: fits.plot("current_step"),
        lambda: comparisons.plot("vq_v", "drive.csv"),
        pipeline.diagnose(nobody).plot,
    ):
        with pytest.raises(KeyError, match="there is no motor"):
            plot()


def test_a_diagnosis_without_a_ladder_says_why(recordings):
    diagnoses = pipeline.diagnose(recordings.only(tests=("resistance",)))
    with pytest.raises(ValueError, match="no ladder to draw: the captures cannot fit"):
        diagnoses.plot()


def test_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings = pipeline.simulate(seed=2).only(tests=("resistance", "lcr"))
    pipeline.check(pipeline.fit(recordings))
    assert list(tmp_path.iterdir()) == []
