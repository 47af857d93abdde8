"""The core works without the packages of its extras, and says which extra a user lacks."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
EVERY_MODULE = """
import importlib, pkgutil, sys
for name in {blocked!r}:
    sys.modules[name] = None
import pipeline
names = [m.name for m in pkgutil.walk_packages(pipeline.__path__, "pipeline.")]
for name in names:
    if name != "pipeline.__main__":
        importlib.import_module(name)
lost = [name for name in pipeline.__all__ if not callable(getattr(pipeline, name))]
print(len(names), *lost)
"""
RUN = """
import sys
for name in {blocked!r}:
    sys.modules[name] = None
from pipeline.__main__ import main
sys.exit(main(["run", "input=data/demo", "output={output}", "executor=dask", "recordings=false"]))
"""


def declared() -> tuple[list[str], dict[str, list[str]], list[str]]:
    """Names of the packages of the core, of each extra, and of the development group."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text())

    def names(texts: list[str]) -> list[str]:
        return [text.split(">")[0].split("[")[0] for text in texts]

    extras = told["project"]["optional-dependencies"]
    return (
        names(told["project"]["dependencies"]),
        {extra: names(texts) for extra, texts in extras.items()},
        names(told["dependency-groups"]["dev"]),
    )


def python(code: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", code]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)


def test_every_module_is_imported_without_the_packages_of_the_extras() -> None:
    """And the functions of `pipeline` stay functions whatever is imported: a package of the same
    name would replace one.
    """
    brought = (name for names in declared()[1].values() for name in names)
    blocked = [*brought, "dask", "tornado"]
    done = python(EVERY_MODULE.format(blocked=blocked))
    assert done.returncode == 0, done.stderr
    count, *lost = done.stdout.split()
    assert int(count) > 300
    assert lost == []


def test_what_an_extra_brings_is_no_part_of_the_core() -> None:
    core, extras, dev = declared()
    assert set(extras) >= {"dask", "hdf5", "tdms", "mdf"}
    for extra, names in extras.items():
        assert not set(names) & set(core), extra
    assert "distributed" in dev, "the tests of Dask need it"


def test_dask_without_its_package_names_the_extra_before_any_work(tmp_path: Path) -> None:
    output = tmp_path / "out"
    done = python(RUN.format(blocked=["distributed"], output=output))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "pip install 'motor-datasheets[dask]'" in line
    assert not output.exists()
