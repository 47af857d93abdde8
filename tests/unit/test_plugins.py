"""Plug-ins of other packages: found by entry point, and named where they are at fault."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GROUPS = {
    "readers": ("pipeline.io.tables.foreign", "readers"),
    "gates": ("pipeline.contracts.registry", "gates"),
    "estimators": ("pipeline.estimation.registry", "estimators"),
    "rules": ("pipeline.crosscheck.registry", "rules"),
    "exporters": ("pipeline.export.registry", "exporters"),
    "effects": ("pipeline.criticism.library.registry", "effects"),
    "equations": ("pipeline.criticism.library.equations", "equations"),
}
MARKS = {
    "gates": "GATE",
    "estimators": "ESTIMATOR",
    "rules": "RULE",
    "exporters": "EXPORTER",
    "effects": "EFFECT",
    "equations": "EQUATION",
}
READER = """
from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable

READER = Reader("hall_binary", lambda data: (RawTable("hall", {}),))
"""

HAND_TURN = """
import json
import numpy as np
import polars as pl
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants

t = 1e-3 * np.arange(4000)
theta = 3.0 * (1.0 - np.cos(2.0 * t))
eps = 7 * theta - 0.4
flux = np.sqrt(3.0) * 0.0123 * np.exp(1j * (eps + np.pi / 6.0))
volts = np.gradient(flux, t).real + 1e-3 * np.random.default_rng(1).normal(size=t.size)
table = pl.DataFrame({"t_s": t, "vab_v": volts, "theta_mech_rad": theta})
meta = CaptureMeta("m", "hand_turn", pole_pairs=7)
capture = Capture("turn.csv", "0", "verified", meta, (table,))
campaign = Campaign("m", (capture,))
machine = machine_of(campaign, Constants())
made = segments(campaign, machine)
fitted = first_fit(rough_fit(made, Model(machine, ()))).fit
left = residual(made[0], fitted.model, fitted.values)[0, 50:-50]
print(json.dumps([made[0].kind, fitted.values["psi_wb"], float(np.std(left))]))
"""


def package(
    folder: Path, group: str, source: str, mark: str, name: str = "outside_plug_in"
) -> None:
    """An installed package of one module that offers one plug-in."""
    (folder / f"{name}.py").write_text(source)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    told = f"Metadata-Version: 2.1\nName: {name.replace('_', '-')}\nVersion: 1.0\n"
    (info / "METADATA").write_text(told)
    (info / "entry_points.txt").write_text(f"[motor_datasheets.{group}]\nours = {name}:{mark}\n")


def python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def example(mark: str) -> str:
    """The complete example of CONTRIBUTING.md that ends in a plug-in of this name."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)
    (source,) = [text for text in blocks if f"\n{mark} = " in text]
    return source


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[bool, int]]:
    """Of each group, whether its plug-in of another package is found, and how many there are: one
    process sees a package for each.
    """
    folder = tmp_path_factory.mktemp("outside")
    code = ["import json, importlib", "told = {}"]
    for group, (module, function) in GROUPS.items():
        mark, name = MARKS.get(group, "READER"), f"outside_{group}"
        package(folder, group, READER if group == "readers" else example(mark), mark, name)
        code += [
            f"own = importlib.import_module({name!r}).{mark}.name",
            f"found = importlib.import_module({module!r}).{function}()",
            "names = [getattr(one, 'name', one) for one in found]",
            f"told[{group!r}] = own in names, len(names)",
        ]
    done = python(folder, "-c", "\n".join([*code, "print(json.dumps(told))"]))
    assert done.returncode == 0, done.stderr
    found: dict[str, tuple[bool, int]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("group", GROUPS)
def test_one_file_of_another_package_is_found(
    group: str, told: dict[str, tuple[bool, int]]
) -> None:
    """The documented examples, each in a package outside; nothing of this one is edited."""
    there, count = told[group]
    assert there
    assert count > 1


def test_compare_holds_captures_against_an_equation_of_another_package(tmp_path: Path) -> None:
    """A hand turn, which no equation of this package takes: its flux is that of its voltage."""
    package(tmp_path, "equations", example("EQUATION"), "EQUATION")
    done = python(tmp_path, "-c", HAND_TURN)
    assert done.returncode == 0, done.stderr
    kind, psi_wb, error_v = json.loads(done.stdout)
    assert kind == "hand"
    assert psi_wb == pytest.approx(0.0123, rel=1e-3)
    assert error_v < 0.002


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("EFFECT = 7", "is no Effect"),
        pytest.param("import nothing_there", "ModuleNotFoundError", marks=pytest.mark.slow),
        pytest.param(
            "from pipeline.criticism.effects.cogging import EFFECT",
            "cogging is in pipeline.criticism.effects.cogging already",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_one_at_fault_is_named_and_no_traceback_shown(
    source: str, said: str, tmp_path: Path
) -> None:
    package(tmp_path, "effects", source, "EFFECT")
    words = [f"input={ROOT / 'data' / 'demo' / 'G52-0601'}", f"output={tmp_path / 'out'}"]
    done = python(tmp_path, "-m", "pipeline", "compare", *words, "model.effects=[cogging]")
    assert done.returncode == 2
    assert said in done.stderr
    assert "outside_plug_in:EFFECT" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_is_kept_hangs_on_the_sources_of_outside_plug_ins(tmp_path: Path) -> None:
    """A fit that is kept must not outlive an edit of the estimator that gave it."""
    package(tmp_path, "estimators", example("ESTIMATOR"), "ESTIMATOR")
    code = "from pipeline.plugins import outside_version as v; print(v())"
    before = python(tmp_path, "-c", code).stdout
    assert "outside_plug_in:ESTIMATOR 1.0" in before
    module = tmp_path / "outside_plug_in.py"
    module.write_text(module.read_text().replace("least_swing_a", "smallest_swing_a"))
    after = python(tmp_path, "-c", code).stdout
    assert after != before
    assert python(ROOT, "-c", code).stdout == "\n"
    whole = "from pipeline.execution.caches.versions import datasheet_libraries as v; print(v())"
    assert after.strip() in python(tmp_path, "-c", whole).stdout
