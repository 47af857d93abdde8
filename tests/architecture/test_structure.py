"""The structure is as documented: import direction, small files, nothing done at import."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "pipeline"
LINES = 400
"""Most lines of a file, those of its docstrings aside."""
SLOW = ("pandera", "rerun", "altair", "numba", "scipy.stats", "scipy.optimize", "polars", "mcap")
ENTRY_POINT = "__main__.py"
EVERYTHING = {"Exception", "BaseException"}

SOURCES = sorted(PACKAGE.rglob("*.py"))


@cache
def _trees() -> tuple[tuple[str, ast.Module], ...]:
    """Path in the package and syntax tree of every source."""
    return tuple(
        (path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text())) for path in SOURCES
    )


def _python(*words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_imports_point_down() -> None:
    """The contracts of `pyproject.toml`: layers, the blind simulator, criticism without disk."""
    pytest.importorskip("importlinter", reason="import-linter is a development tool")
    code = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    done = _python("-c", code)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " 0 broken" in done.stdout


def _imports() -> dict[str, set[str]]:
    """Modules of the package by name, and which others each imports anywhere in its text."""
    trees = {
        "pipeline." + name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): tree
        for name, tree in _trees()
    }
    found: dict[str, set[str]] = {}
    for name, tree in trees.items():
        wanted: set[str] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                wanted |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
            elif isinstance(node, ast.Import):
                wanted |= {one.name for one in node.names}
        found[name] = wanted & trees.keys() - {name}
    return found


def _circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules in a ring or above one; empty where there is none."""
    left = dict(imports)
    while ends := [name for name, wanted in left.items() if not wanted & left.keys()]:
        left = {name: wanted for name, wanted in left.items() if name not in ends}
    return sorted(left)


def test_no_module_imports_one_that_imports_it() -> None:
    """Late imports count: they hide a circle from the interpreter, not from the reader."""
    assert _circle(_imports()) == []
    assert _circle({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == ["a", "b", "c"]


def test_an_import_upwards_is_seen(tmp_path: Path) -> None:
    """The tool itself: an import of the upper of two layers by the lower one is reported."""
    pytest.importorskip("importlinter", reason="import-linter is a development tool")
    plant = tmp_path / "plant"
    for layer in ("", "upper", "lower"):
        (plant / layer).mkdir()
        (plant / layer / "__init__.py").write_text("")
    (plant / "lower" / "__init__.py").write_text("import plant.upper\n")
    (tmp_path / ".importlinter").write_text(
        "[importlinter]\nroot_package = plant\n[importlinter:contract:1]\nname = down\n"
        "type = layers\nlayers =\n    upper\n    lower\ncontainers = plant\n"
    )
    code = (
        f"import os, sys; os.chdir({str(tmp_path)!r}); sys.path.insert(0, '.')\n"
        "from importlinter.cli import lint_imports_command; lint_imports_command()"
    )
    done = _python("-c", code)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "plant.lower -> plant.upper" in done.stdout


def test_no_file_is_long() -> None:
    lengths = {path: _lines_without_docstrings(path, tree) for path, tree in _trees()}
    assert {name: length for name, length in lengths.items() if length >= LINES} == {}


def _lines_without_docstrings(path: str, tree: ast.Module) -> int:
    text = (PACKAGE / path).read_text()
    prose = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            prose += (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
    return len(text.splitlines()) - prose


def test_no_drawer_for_everything() -> None:
    """No module or package has a name without a subject."""
    drawers = {"utils", "util", "helpers", "helper", "misc", "common", "tools"}
    names = {part.removesuffix(".py") for p in SOURCES for part in p.relative_to(PACKAGE).parts}
    assert names & drawers == set()


def test_print_is_the_doors_alone() -> None:
    callers = [
        f"{path}:{node.lineno}"
        for path, tree in _trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
        and path != ENTRY_POINT
    ]
    assert callers == []


def test_no_bare_except() -> None:
    """No `except:`, and none of everything that goes on as if nothing were."""
    offenders = []
    for path, tree in _trees():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ExceptHandler):
                continue
            silent = all(isinstance(step, (ast.Pass, ast.Continue)) for step in node.body)
            broad = node.type is not None and ast.unparse(node.type) in EVERYTHING
            if node.type is None or (broad and silent):
                offenders.append(f"{path}:{node.lineno}")
    assert offenders == []


def test_nothing_acts_at_import() -> None:
    """No loop, `with`, `try` or bare call stands at the top of a module.

    Constants may be built there; what acts stands in a function, or under `if __name__`.
    """
    offenders = [
        f"{path}:{node.lineno}" for path, tree in _trees() for node in tree.body if _acts(node)
    ]
    assert offenders == []


def _acts(node: ast.stmt) -> bool:
    if isinstance(node, ast.Expr):
        return not isinstance(node.value, ast.Constant)
    if isinstance(node, ast.If):
        return ast.unparse(node.test) not in {"TYPE_CHECKING", "__name__ == '__main__'"}
    return isinstance(node, (ast.For, ast.While, ast.With, ast.Try))


def test_every_module_says_what_it_is() -> None:
    assert [path for path, tree in _trees() if tree.body and not ast.get_docstring(tree)] == []


def _modules_after(statement: str) -> set[str]:
    code = f"{statement}\nimport sys\nsys.stdout.write(' '.join(sys.modules))"
    done = _python("-c", code)
    assert done.returncode == 0, done.stderr[-2000:]
    return set(done.stdout.split())


def test_the_door_opens_light() -> None:
    """Listing the commands costs no polars, pandera, rerun, altair or numba."""
    loaded = _modules_after("import pipeline.__main__")
    assert sorted(loaded & set(SLOW)) == []


@pytest.mark.parametrize("module", ["validate", "registry", "motor", "json_schema", "schemas"])
def test_contracts_load_without_pandera(module: str) -> None:
    """Importing pandera costs most of a second; only a capture that is validated pays it."""
    loaded = _modules_after(f"import pipeline.contracts.{module}")
    assert sorted(loaded & {"pandera", "rerun", "altair", "numba"}) == []


@pytest.mark.parametrize("module", ["pipeline.estimation.registry", "pipeline.crosscheck.registry"])
def test_plug_ins_load_light(module: str) -> None:
    """Finding the plug-ins costs neither a plotting library nor a compiler."""
    name = module.rsplit(".", 2)[1]
    find = {"estimation": "estimators", "crosscheck": "rules"}[name]
    loaded = _modules_after(f"import {module}\n{module}.{find}()")
    assert sorted(loaded & {"pandera", "rerun", "altair", "scipy.stats"}) == []
