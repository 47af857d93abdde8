"""A copy of the tree to change, and processes that run tests in it.

Each run is a fork of this process, which has imported the libraries and nothing of the project:
a mutant costs the import of the project, not that of the libraries.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

LEFT_OUT = (".git", ".venv", "reports", "__pycache__", ".*_cache", ".hypothesis", "outputs")
LIBRARIES = (
    "numpy",
    "scipy.integrate",
    "scipy.interpolate",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.signal",
    "scipy.sparse",
    "scipy.stats",
    "polars",
    "pandera.polars",
    "yaml",
    "omegaconf",
    "hydra",
    "hypothesis",
    "pytest",
    "numba",
    "jinja2",
)
OPTIONS = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:benchmark"]
MEMORY_BYTES = 8 << 30


class Scratch:
    """A copy of `root` in `place`; `../shared` is reached from it as from the checkout."""

    def __init__(self, root: Path, place: Path) -> None:
        self.tree = place / "tree"
        shutil.copytree(root, self.tree, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=True)
        shared = root.parent / "shared"
        if shared.exists():
            (place / "shared").symlink_to(shared.resolve())
        self._place = place
        self._changes = 0
        for name in LIBRARIES:
            importlib.import_module(name)

    def run(
        self, tests: list[str], cpu_s: float, report: Callable[[Path], object] | None = None
    ) -> tuple[str, str]:
        """(`passed`, `failed`, `time` or `broken`; the first test that failed).

        `report` makes a plug-in of pytest that gets the file for its report; without it the first
        failure ends the run. `cpu_s` is CPU time: a busy machine changes no verdict.
        """
        answer = self._place / "answer"
        answer.unlink(missing_ok=True)
        child = os.fork()
        if child == 0:
            self._in_child(tests, cpu_s, answer, report)
        until = time.monotonic() + 30.0 * cpu_s + 300.0
        status = None
        while status is None:
            done, status_now = os.waitpid(child, os.WNOHANG)
            if done:
                status = status_now
            elif time.monotonic() > until:
                os.killpg(child, signal.SIGKILL)
                status = os.waitpid(child, 0)[1]
            else:
                time.sleep(0.02)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what a test started and left
        first = answer.read_text() if answer.exists() else ""
        if os.WIFSIGNALED(status):
            late = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
            return ("time" if late else "broken"), first
        code = os.waitstatus_to_exitcode(status)
        return {0: "passed", 1: "failed"}.get(code, "broken"), first

    def _in_child(
        self,
        tests: list[str],
        cpu_s: float,
        answer: Path,
        report: Callable[[Path], object] | None,
    ) -> None:
        os.setpgid(0, 0)
        code = 3
        try:
            code = _run_tests(self.tree, tests, cpu_s, answer, report)
        finally:
            sys.stdout.flush()
            os._exit(code)

    def change(self, path: str, text: str | None) -> None:
        """Puts a text in the place of a file, and the file back with None.

        Each change has its own time, so that no compiled file passes for another's.
        """
        target = self.tree / path
        kept = self._place / "kept.py"
        if text is None:
            shutil.copy2(kept, target)
            return
        shutil.copy2(target, kept)
        self._changes += 1
        target.write_text(text, encoding="utf-8")
        later = int(kept.stat().st_mtime) + 10 * self._changes
        os.utime(target, (later, later))


class _FirstFailure:
    """Writes the first test that fails, or the file that cannot be collected."""

    def __init__(self, answer: Path) -> None:
        self._answer = answer

    def pytest_runtest_logreport(self, report: object) -> None:
        """A test's outcome."""
        self._write(report)

    def pytest_collectreport(self, report: object) -> None:
        """A file's outcome."""
        self._write(report)

    def _write(self, report: object) -> None:
        if getattr(report, "failed", False) and not self._answer.exists():
            self._answer.write_text(str(getattr(report, "nodeid", "")))


def _run_tests(
    tree: Path,
    tests: list[str],
    cpu_s: float,
    answer: Path,
    report: Callable[[Path], object] | None,
) -> int:
    import pytest

    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 5))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sink = os.open(answer.parent / "output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    os.chdir(tree)
    for name in [n for n in sys.modules if n.split(".")[0] in {"tests", "pipeline"}]:
        del sys.modules[name]
    sys.path.insert(0, str(tree))
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    options = [*OPTIONS, "--rootdir", str(tree)]
    if report is None:
        sys.dont_write_bytecode = True
        return int(pytest.main([*options, "-x", *tests], plugins=[_FirstFailure(answer)]))
    sys.dont_write_bytecode = False
    plugin = report(tree)
    code = int(pytest.main([*options, *tests], plugins=[plugin]))
    answer.write_text(json.dumps(_plain(plugin)))
    return code


def _plain(plugin: object) -> dict[str, object]:
    """What a tracer found, as JSON can hold it."""
    tests: dict[str, set[tuple[str, int]]] = plugin.tests  # type: ignore[attr-defined]
    lines: dict[str, dict[str, list[int]]] = {}
    for test, run in tests.items():
        by_file: dict[str, list[int]] = {}
        for path, line in sorted(run):
            by_file.setdefault(path, []).append(line)
        lines[test] = by_file
    return {
        "lines": lines,
        "seconds": plugin.seconds,  # type: ignore[attr-defined]
        "failed": sorted(plugin.failed),  # type: ignore[attr-defined]
    }
