"""The tool itself: it sees a mutant die, sees an equivalent one live, and changes no checkout."""

from __future__ import annotations

import ast
import json
from dataclasses import asdict
from pathlib import Path

import pytest

from tests.mutants import coverage, run, table
from tests.mutants.operators import Mutant, draw, find
from tests.mutants.packages import PACKAGES, Package
from tests.mutants.scratch import Scratch

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = '''
"""A text with 2.0 in it."""

LIMIT = 3.0


def area(width: float, height: float = 2.0) -> float:
    """An area of 1.0 * 1.0."""
    if width > LIMIT or not height:
        raise ValueError(f"{width + 1} is above {LIMIT}")
    product = width * height
    return max(product, product)


def endless(n: int) -> int:
    while n > 0:
        n -= 1
    return n
'''
TESTS = """
from pipeline.sample import area, endless


def test_area():
    assert area(3.0, 2.0) == 6.0


def test_endless():
    assert endless(4) == 0


def test_elsewhere():
    pass
"""


def changed(text: str, kind: str = "") -> list[Mutant]:
    """Mutants of the sample whose change is of `text`."""
    found = [m for m in find(SAMPLE, "pipeline/sample.py") if m.before == text]
    return [m for m in found if kind in ("", m.kind)]


def test_every_mutant_parses_and_differs() -> None:
    plain = ast.unparse(ast.parse(SAMPLE))
    found = find(SAMPLE, "pipeline/sample.py")
    texts = [ast.unparse(ast.parse(m.apply(SAMPLE))) for m in found]
    assert plain not in texts
    assert len({m.key for m in found}) == len(found) > 10


def test_text_messages_and_types_stay() -> None:
    """Neither docstrings nor what is raised nor annotations are in any change."""
    for mutant in find(SAMPLE, "pipeline/sample.py"):
        text = mutant.apply(SAMPLE)
        assert "with 2.0 in it" in text
        assert "{width + 1} is above {LIMIT}" in text
        assert "height: float = " in text


def test_every_kind_of_change() -> None:
    text = """
def f(a, b):
    for x in a[b:]:
        if a:
            continue
    a += 1
    return -a if not b and a <= 2 else np.argmin(a**b, axis=0), 1.5, True, 0
"""
    found = {(m.kind, m.before, m.after) for m in find(text, "x.py")}
    assert found >= {
        ("slice", "b", "b + 1"),
        ("negation", "a", "not a"),
        ("jump", "continue", "break"),
        ("arithmetic", "a += 1", "a -= 1"),
        ("sign", "-a", "a"),
        ("negation", "not b", "b"),
        ("logic", "not b and a <= 2", "not b or a <= 2"),
        ("relation", "a <= 2", "a < 2"),
        ("relation", "a <= 2", "a >= 2"),
        ("function", "np.argmin", "np.argmax"),
        ("arithmetic", "a ** b", "a * b"),
        ("constant", "1.5", "1.725"),
        ("constant", "True", "False"),
        ("constant", "0", "1"),
    }


def test_a_key_outlives_a_move_and_a_comment_but_no_change() -> None:
    before = {m.key for m in find(SAMPLE, "a.py") if m.function == "endless"}
    moved = SAMPLE.replace("LIMIT = 3.0", "LIMIT = 3.0  # more\nOTHER = 7")
    moved = moved.replace("def endless(n: int)", "\n\ndef endless(n: int)")
    assert {m.key for m in find(moved, "b.py") if m.function == "endless"} == before
    edited = SAMPLE.replace("return n", "return n + 0")
    assert not {m.key for m in find(edited, "a.py") if m.function == "endless"} & before


def test_a_draw_is_of_its_seed_and_holds_a_place_once() -> None:
    found = find(SAMPLE, "pipeline/sample.py")
    assert draw(found, 1, 8) == draw(list(reversed(found)), 1, 8)
    assert draw(found, 1, 8) != draw(found, 2, 8)
    places = [(m.start, m.end) for m in draw(found, 1, 100)]
    assert len(set(places)) == len(places)


def test_every_source_belongs_to_one_package() -> None:
    """Entry points and settings, which lie beside the packages, belong to none."""
    owned = [path for package in PACKAGES.values() for path in package.files(ROOT)]
    assert len(set(owned)) == len(owned)
    left = set(ROOT.glob("pipeline/*/**/*.py")) - set(owned)
    assert not left, "name their package in tests/mutants/packages.py"


def test_judgements_have_a_verdict_and_a_reason() -> None:
    for key, judgement in run.judgements().items():
        assert len(key) == 12
        assert judgement["verdict"] in {"equivalent", "survived"}
        assert len(judgement["why"]) > 5


def test_a_page_keeps_the_rows_of_what_is_not_measured_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row goes with its package and seed: only a new result of both takes its place."""
    monkeypatch.setattr(table, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(table, "CACHE", tmp_path)
    (alive, *_, dead) = (
        asdict(m) for m in find("def f(a, b):\n    return a < b or a | b\n", "f.py")
    )

    def call(name: str, verdicts: tuple[str, str]) -> str:
        """The page after a checkout that holds this result alone."""
        kept = zip((alive, dead), verdicts, strict=True)
        text = json.dumps([{"mutant": m, "verdict": v, "why": "seen"} for m, v in kept])
        (tmp_path / f"result-{name}.json").write_text(text)
        table.main(["--page"])
        (tmp_path / f"result-{name}.json").unlink()
        return (tmp_path / "page.md").read_text()

    call("lots-3", ("survived", "killed"))
    call("fit-4", ("survived", "survived"))
    assert call("fit-5", ("killed", "killed")) == call("fit-5", ("killed", "killed"))
    page = call("fit-4", ("killed", "survived"))
    rates, survivors = page.split("## Survivors")
    assert [line for line in rates.splitlines() if line[2:5] in ("fit", "lot")] == [
        "| fit | 4 | 2 | 1 | 0 | 1 | 50 % (short) |",
        "| fit | 5 | 2 | 2 | 0 | 0 | 100 % |",
        "| lots | 3 | 2 | 1 | 0 | 1 | 50 % (short) |",
    ]
    assert [line for line in survivors.splitlines() if line[2:5] in ("fit", "lot")] == [
        "| fit | 4 | `f.py` `f` | `a \\| b` to `a & b` | seen |",
        "| lots | 3 | `f.py` `f` | `a < b or a \\| b` to `a < b and a \\| b` | seen |",
    ]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sample")
    for name, text in (("pipeline/sample.py", SAMPLE), ("tests/test_sample.py", TESTS)):
        (root / name).parent.mkdir()
        (root / name).write_text(text)
    (root / "pipeline" / "__init__.py").touch()
    (root / "pyproject.toml").write_text(
        '[tool.pytest.ini_options]\naddopts = "--import-mode=importlib"\n'
    )
    return root


@pytest.mark.slow
def test_a_mutant_dies_and_an_equivalent_one_lives(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One package of one file: each verdict, the test that gave it, and the source as it was."""
    monkeypatch.setattr("tests.mutants.scratch.LIBRARIES", ())
    monkeypatch.setattr(run, "LEAST_CPU_S", 4.0)
    package = Package("sample", ("pipeline/sample.py",), ("tests",))
    place = tmp_path / "place"
    place.mkdir()
    scratch = Scratch(tree, place)
    covered = coverage.measure(scratch, package, tmp_path / "cache")
    line = next(m.line for m in changed("max"))
    assert covered.by_line["pipeline/sample.py", line] == {"tests/test_sample.py::test_area"}
    (product,) = changed("width * height")
    limit = next(m for m in changed("3.0"))
    assert covered.of(limit, tree) >= {"tests/test_sample.py::test_elsewhere"}
    (equal,) = changed("max")
    (loop,) = changed("n -= 1")
    tried = {m.key: run.attempt(m, scratch, covered, "") for m in (product, equal, loop)}
    assert tried[product.key] == ("killed", "tests/test_sample.py::test_area")
    assert tried[equal.key] == ("survived", "")
    assert tried[loop.key][0] == "killed"
    assert (tree / "pipeline/sample.py").read_text() == SAMPLE
    assert (scratch.tree / "pipeline/sample.py").read_text() == SAMPLE
