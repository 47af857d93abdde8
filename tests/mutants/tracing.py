"""A plug-in of pytest: which lines of the package under test each test runs, and its CPU time.

What a fixture of a wider scope runs counts for every test that uses it, and what a cached function
of the tests runs for every test that calls it: caches are cleared before each test.
"""

from __future__ import annotations

import functools
import gc
import sys
import time
from collections.abc import Iterator
from types import FrameType
from typing import Any

import pytest

Lines = set[tuple[str, int]]


class Tracer:
    """Lines of some files under `root` (relative paths), kept by test."""

    def __init__(self, root: str, files: frozenset[str]) -> None:
        self.root = root
        self.files = files
        self.tests: dict[str, Lines] = {}
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self._fixtures: dict[tuple[str, str], Lines] = {}
        self._lines: Lines = set()
        self._files: dict[str, str | None] = {}

    def _local(self, frame: FrameType, event: str, _argument: object) -> Any:
        if event == "line":
            self._lines.add((self._files[frame.f_code.co_filename] or "", frame.f_lineno))
        return self._local

    def _called(self, frame: FrameType, _event: str, _argument: object) -> Any:
        name = frame.f_code.co_filename
        if name not in self._files:
            path = name.removeprefix(self.root)
            self._files[name] = path if path in self.files else None
        return None if self._files[name] is None else self._local

    def start(self) -> None:
        """Traces every thread from now on."""
        import threading

        threading.settrace(self._called)
        sys.settrace(self._called)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """The lines of one test, with those of its fixtures."""
        for cached in gc.get_objects():
            if isinstance(cached, functools._lru_cache_wrapper) and _of_tests(cached):
                cached.cache_clear()
        self._lines = lines = set()
        began = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - began
        for name in getattr(item, "fixturenames", ()):
            for (fixture, base), run in self._fixtures.items():
                if fixture == name and item.nodeid.startswith(base):
                    lines |= run
        self.tests[item.nodeid] = lines
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        """The lines of a fixture of a wider scope."""
        outer, self._lines = self._lines, set()
        result = yield
        if fixturedef.scope != "function":
            kept = self._fixtures.setdefault((fixturedef.argname, fixturedef.baseid), set())
            kept |= self._lines
        outer |= self._lines
        self._lines = outer
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A test that fails unchanged code can judge nothing."""
        if report.failed:
            self.failed.add(report.nodeid)


def _of_tests(function: object) -> bool:
    return str(getattr(function, "__module__", "")).split(".")[0] == "tests"
