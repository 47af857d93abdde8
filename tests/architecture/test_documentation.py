"""The documentation: links that lead somewhere, pages in the side bar, pictures of the effects."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.site.gallery import signature, simulated
from tests.site.links import broken_in_markdown, broken_in_site
from tests.site.pages import GROUPS, all_effects, notebook_page

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]
WRITTEN = {"api", "gallery", "contributing", "changelog", "decisions/index"}
"""Pages that the build writes."""


def test_every_link_of_the_pages_leads_somewhere() -> None:
    assert broken_in_markdown(ROOT, PAGES) == []


def test_a_broken_link_of_a_page_is_seen(tmp_path: Path) -> None:
    (tmp_path / "b.md").write_text("# Two words: *here*\n")
    text = "[a](b.md#two-words-here) [b](b.md#three) [c](c.md)\n```\n[d](d.md)\n```\n"
    (tmp_path / "a.md").write_text(text)
    assert broken_in_markdown(tmp_path, [tmp_path / "a.md"]) == [
        "a.md: b.md#three: no such heading",
        "a.md: c.md: no such file",
    ]


def test_a_broken_link_of_the_site_is_seen(tmp_path: Path) -> None:
    (tmp_path / "b.html").write_text('<p id="there">')
    links = ["b.html#there", "b.html#not", "c.html", "../out.html", "https://example.org/x"]
    page = "".join(f'<a href="{link}">' for link in links) + '<img src="d.svg">'
    (tmp_path / "a.html").write_text(page)
    assert broken_in_site(tmp_path) == [
        "a.html: b.html#not: no such anchor",
        "a.html: c.html: no such file",
        "a.html: ../out.html: leaves the site",
        "a.html: d.svg: no such file",
    ]


def test_every_entry_of_the_side_bar_is_a_page() -> None:
    named = {name for names in GROUPS.values() for name in names}
    assert named - {path.stem for path in DOCS.glob("*.md")} - WRITTEN == {"notebooks/*"}


def test_a_notebook_keeps_its_outputs() -> None:
    """Markdown, source, a table as HTML, and text where a result has no other form."""
    shown = {"data": {"text/html": ["<table>"], "text/plain": ["t"]}}
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n"]},
        {"cell_type": "code", "source": ["x = 1"], "outputs": [shown, {"text": ["said\n"]}]},
    ]
    page = notebook_page({"cells": cells})
    assert "# Title" in page and "```python\nx = 1\n```" in page
    assert "```{raw} html\n<table>\n```" in page and "```text\nsaid\n" in page


@pytest.mark.parametrize(
    ("name", "column", "cause"),
    [
        ("unbalance", "torque_shaft_nm", "theta_mech_rad"),
        ("phase_imbalance", "vab_v", "ia_a"),
        ("windage", "omega_mech_rad_s", "t_s"),
    ],
)
def test_the_signature_of_an_effect(name: str, column: str, cause: str) -> None:
    """The change is drawn against what explains it, and the drawing is the same again."""
    (effect,) = (one for one in all_effects() if one.name == name)
    found = signature(effect)
    assert (found.column, found.cause) == (column, cause)
    assert found.explained > 0.99
    assert found.figure(name).svg == signature(effect).figure(name).svg


def test_unbalance_is_one_wave_a_turn() -> None:
    (effect,) = (one for one in all_effects() if one.name == "unbalance")
    found = signature(effect)
    wave = np.column_stack([np.sin(found.x), np.cos(found.x), np.ones_like(found.x)])
    rest = found.change - wave @ np.linalg.lstsq(wave, found.change, rcond=None)[0]
    assert np.std(rest) < 0.02 * np.std(found.change)


PRIVATE = (
    r"told|tells|telling|hears?|heard|hearing|rungs?|climb(?:s|ed)?|kin|crew|mate|crumbs?|"
    r"wanders?|calm|misfit|guess(?:es)?|denied|rooms?|house|door|strangers?|rivals?|nibble|besides"
)
"""Words that have a standard term, or none that a newcomer knows."""
CODE = re.compile(r"^(```|~~~).*?^\1|`[^`\n]*`", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_has_a_private_word(page: Path) -> None:
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    found = re.findall(rf"\b(?:{PRIVATE})\b", text, flags=re.IGNORECASE)
    assert found == []


MANUALS = ["criticism", "uncertainty", "lots", "registry", "export", "review", "fleet", "simulator"]


def prose(text: str) -> list[str]:
    """The paragraphs of a page, list items each by itself, without tables, code and headings."""
    text = re.sub(r"^(```|~~~).*?^\1", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^(?: {4}.*|\|.*|#.*|!\[.*)$", "", text, flags=re.MULTILINE)
    parts = re.split(r"\n\s*\n|\n(?=- |\d+\. )", text)
    return [part for part in parts if re.search(r"\w", part)]


def words(text: str) -> int:
    return len(re.findall(r"\w[\w'./-]*", text))


@pytest.mark.parametrize("name", MANUALS)
def test_manuals_have_short_sentences_and_paragraphs(name: str) -> None:
    parts = prose((DOCS / f"{name}.md").read_text(encoding="utf-8"))
    sentences = [s for part in parts for s in re.split(r"(?<=[.:!?])\s+", part) if words(s)]
    assert sum(map(words, sentences)) / len(sentences) <= 16.0
    assert sum(map(words, parts)) / len(parts) <= 48.0


def test_modules_that_the_manual_of_criticism_cites_are_there() -> None:
    text = (DOCS / "criticism.md").read_text(encoding="utf-8")
    cited = set(re.findall(r"`([a-z_]+/[a-z_]+(?:\.py)?)`", text))
    cited |= set(re.findall(r"─ ([a-z_]+/[a-z_]+)", text))
    assert len(cited) > 10
    homes = (ROOT / "pipeline", ROOT / "pipeline" / "criticism")
    lost = {c for c in cited if not any((h / c).with_suffix(".py").is_file() for h in homes)}
    assert lost == set()


ARCHITECTURE = (DOCS / "architecture.md").read_text(encoding="utf-8")
BRANCH = re.compile(r"^((?:[│ ]  )*)(?:[├└]─ )?([a-z_]+(?:\.[a-z_]+)+)")


def imported(module: str) -> set[str]:
    """The modules of the package that a module imports, anywhere in its text."""
    path = ROOT.joinpath("pipeline", *module.split("."))
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    names: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
    return {name.removeprefix("pipeline.") for name in names}


def arrows(tree: str) -> list[tuple[str, str]]:
    """Parent and child of every branch of a text tree."""
    found, above = [], []
    for line in tree.splitlines():
        match = BRANCH.match(line)
        assert match, line
        depth = len(match[1]) // 3 + ("─" in line)
        above = [*above[:depth], match[2]]
        found += [(above[-2], above[-1])] if depth else []
    return found


def test_the_walks_are_those_of_the_imports() -> None:
    trees = re.findall(r"^```text\n(.*?)^```", ARCHITECTURE, flags=re.MULTILINE | re.DOTALL)
    walks = [arrow for tree in trees for arrow in arrows(tree)]
    assert len(trees) == 4 and len(walks) > 35
    assert [(a, b) for a, b in walks if b not in imported(a)] == []


def test_a_tree_is_read_as_it_is_drawn() -> None:
    tree = "a.a\n├─ b.b   text\n│  └─ c.c\n└─ d.d\n   └─ e.e\n"
    assert arrows(tree) == [("a.a", "b.b"), ("b.b", "c.c"), ("a.a", "d.d"), ("d.d", "e.e")]


def test_every_package_is_in_the_table() -> None:
    named = set(re.findall(r"^\| (.*?) \|", ARCHITECTURE, flags=re.MULTILINE)) - {"package", "---"}
    names = {name for cell in named for name in re.findall(r"`([a-z_]+)`", cell)}
    there = {
        path.stem
        for path in (ROOT / "pipeline").iterdir()
        if (path / "__init__.py").is_file() or (path.suffix == ".py" and path.stem != "__init__")
    }
    assert names == there


def test_nearly_every_effect_has_a_picture() -> None:
    """The simulator has nine in ten effects at least."""
    drawn = [simulated(effect) for effect in all_effects()]
    assert sum(drawn) >= 0.9 * len(drawn)


def names_and_prose(path: Path) -> Iterator[str]:
    """What a module calls things, and its docstrings without code in backticks."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name.replace("_", " ")
        elif isinstance(node, ast.arg):
            yield node.arg.replace("_", " ")
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id.replace("_", " ")
        if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.Module)):
            yield CODE.sub("", ast.get_docstring(node) or "")


def test_no_name_and_no_docstring_of_the_package_has_a_private_word() -> None:
    """Fields of a policy are keys that people override, and keep their names."""
    word = re.compile(rf"\b(?:{PRIVATE}|foreseen?|surely|parted|nought)\b", re.IGNORECASE)
    ordinary = {"room", "rooms"}  # for a label, in memory
    found = [
        f"{path.relative_to(ROOT)}: {hit.group()}"
        for path in sorted((ROOT / "pipeline").rglob("*.py"))
        if path.parent.name != "policy"
        for text in names_and_prose(path)
        for hit in word.finditer(text)
        if hit.group().lower() not in ordinary
    ]
    assert found == []
