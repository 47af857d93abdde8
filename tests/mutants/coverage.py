"""Which tests run a line, measured once and kept beside the digest of all that it rests on."""

from __future__ import annotations

import ast
import functools
import hashlib
import json
import re
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from tests.mutants.operators import Mutant
from tests.mutants.packages import Package
from tests.mutants.scratch import Scratch
from tests.mutants.tracing import Tracer

MEASURING_CPU_S = 3600.0


@dataclass
class Coverage:
    """Tests by line, by file, by file that their own one imports, and their CPU seconds traced.

    `failed` are those that fail unchanged code.
    """

    by_line: dict[tuple[str, int], set[str]] = field(default_factory=lambda: defaultdict(set))
    by_file: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    by_import: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    seconds: dict[str, float] = field(default_factory=dict)
    failed: set[str] = field(default_factory=set)

    def add(self, kept: dict[str, dict], imported: frozenset[str]) -> None:
        """Takes in the tests of one file, which imports some files of the package."""
        self.failed |= set(kept["failed"])
        for test, files in kept["lines"].items():
            if test in self.failed or not (files or imported):
                continue
            self.seconds[test] = kept["seconds"][test]
            for path in imported:
                self.by_import[path].add(test)
            for path, lines in files.items():
                self.by_file[path].add(test)
                for line in lines:
                    self.by_line[path, line].add(test)

    def of(self, mutant: Mutant, root: Path) -> set[str]:
        """Tests that run the line; for what runs at import, those that may use what it made.

        Those are the tests of files that import the mutant's file, and those that run a line with
        the name that was made; where there are none, every test that runs something of the file.
        """
        end = mutant.line + mutant.before.count("\n")
        run = {t for line in range(mutant.line, end + 1) for t in self.by_line[mutant.path, line]}
        at_import = mutant.function.isupper() or mutant.function == "module"
        if run and not at_import:
            return run
        run |= self.by_import[mutant.path]
        if mutant.function.isupper():
            for path, line in _uses(root, mutant.function):
                run |= self.by_line[path, line]
        return run or self.by_file[mutant.path]

    def order(self, tests: set[str], limit_s: float) -> list[str]:
        """The quickest first, as many as the limit allows and one at least; files stay together."""
        chosen: list[str] = []
        spent = 0.0
        for test in sorted(tests, key=lambda t: (self.seconds[t], t)):
            if chosen and spent + self.seconds[test] > limit_s:
                break
            chosen.append(test)
            spent += self.seconds[test]
        cost: dict[str, float] = defaultdict(float)
        for test in chosen:
            cost[test.split("::")[0]] += self.seconds[test]
        return sorted(chosen, key=lambda t: (cost[t.split("::")[0]], t.split("::")[0]))


def measure(scratch: Scratch, package: Package, cache: Path) -> Coverage:
    """The coverage of a package by its own tests; a file that has not changed is not run again."""
    found = Coverage()
    cache.mkdir(parents=True, exist_ok=True)
    base = _digest(scratch.tree)
    files = frozenset(p.relative_to(scratch.tree).as_posix() for p in package.files(scratch.tree))

    def tracer(tree: Path) -> Tracer:
        made = Tracer(f"{tree}/", files)
        made.start()
        return made

    for path in package.test_files(scratch.tree):
        name = path.relative_to(scratch.tree).as_posix()
        key = hashlib.sha256(f"{base} {name} {package.name}".encode() + path.read_bytes())
        kept = cache / f"{key.hexdigest()[:24]}.json"
        if not kept.exists():
            left_out = [f"--deselect={test}" for test in package.slow]
            _, text = scratch.run([name, *left_out], MEASURING_CPU_S, tracer)
            if not text.startswith("{"):
                said = (scratch.tree.parent / "output").read_text()[-2000:]
                raise RuntimeError(f"{name} cannot be measured: {said}")
            kept.write_text(text)
        found.add(json.loads(kept.read_text()), _imported(path) & files)
    return found


def _imported(path: Path) -> frozenset[str]:
    """Files that a test file imports, by their paths in the tree."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(f"{module.replace('.', '/')}.py" for module in modules)


def _digest(tree: Path) -> str:
    """What every test may rest on: the code, the settings, and helpers of the tests."""
    digest = hashlib.sha256()
    paths = [*tree.glob("pipeline/**/*.py"), *tree.glob("conf/**/*.yaml")]
    paths += [p for p in tree.glob("tests/**/*.py") if not p.name.startswith("test_")]
    for path in sorted(paths):
        if "mutants" not in path.parts:
            digest.update(path.relative_to(tree).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


@functools.cache
def _uses(root: Path, name: str) -> tuple[tuple[str, int], ...]:
    word = re.compile(rf"\b{re.escape(name)}\b")
    return tuple(
        (path.relative_to(root).as_posix(), number)
        for path in sorted(root.glob("pipeline/**/*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if word.search(line)
    )
