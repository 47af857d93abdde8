"""Draws of finished blocks of seeds, kept by what they depend on, so that a stopped run goes on.

A block's file name is the digest of the seeds and of every source file that its draws run through:
the estimator's, those of the estimators that the case calls for what is known, the simulator's, the
case's own and the harness, each with all that it imports. A change of one estimator so leaves the
blocks of the others standing. The numerical libraries count by their versions.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from tests.recovery.harness import Case, Draw, draw

OF_PROJECT = ("pipeline", "tests")
LIBRARIES = ("numpy", "scipy", "polars", "numba")


def draws_of(case: Case, seeds: range, folder: Path, expected: str) -> list[Draw]:
    """The draws of a block of seeds, from the folder where they are kept, else made and kept.

    `expected` is the digest when the run began; raises RuntimeError where the sources have changed
    since, for the modules in memory may then be either.
    """
    if digest(case, seeds) != expected:
        raise RuntimeError("the sources changed during the run; start it again, it goes on")
    path = folder / f"{case.name}-{expected[:20]}.json"
    if path.exists():
        return [Draw(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    draws = draw(case, seeds)
    folder.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps([asdict(d) for d in draws]), encoding="utf-8")
    partial.replace(path)
    return draws


def digest(case: Case, seeds: range) -> str:
    """SHA-256 of all that the draws of these seeds depend on."""
    parts = [case.name, repr(sorted(case.options.items())), repr(seeds), sys.version]
    parts += [f"{name} {version(name)}" for name in LIBRARIES]
    parts += [f"{name} {_source_digest(name)}" for name in sorted(modules_of(case))]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def modules_of(case: Case) -> set[str]:
    """Names of the project's modules that the draws of a case run through."""
    home = case.simulate.__module__
    globals_ = sys.modules[home].__dict__
    called = {case.estimator.fit.__module__, "tests.recovery.simulated"}
    functions = [case.simulate]
    seen = set()
    while functions:
        code = functions.pop().__code__
        for name in code.co_names:
            value = globals_.get(name)
            if isinstance(value, ModuleType):
                called.add(value.__name__)
            elif callable(value) and getattr(value, "__module__", None) == home:
                inner = getattr(value, "__wrapped__", value)
                if hasattr(inner, "__code__") and name not in seen:
                    seen.add(name)
                    functions.append(inner)
    return {home, "tests.recovery.harness"} | closure(called)


def closure(names: Iterable[str]) -> set[str]:
    """The modules and all modules of the project that they import, at any depth."""
    found: set[str] = set()
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _imports(name)
    return found


@cache
def _imports(name: str) -> tuple[str, ...]:
    found = set()
    for node in ast.walk(ast.parse(_source(name))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    own = {n for n in found if n.split(".")[0] in OF_PROJECT}
    return tuple(sorted(n for n in own if _origin(n) is not None))


@cache
def _origin(name: str) -> str | None:
    try:
        spec = find_spec(name)
    except ModuleNotFoundError:
        return None
    return None if spec is None else spec.origin


def _source(name: str) -> str:
    origin = _origin(name)
    return "" if origin is None else Path(origin).read_text(encoding="utf-8")


@cache
def _source_digest(name: str) -> str:
    return hashlib.sha256(_source(name).encode()).hexdigest()
