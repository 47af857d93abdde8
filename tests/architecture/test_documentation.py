"""The documentation: links that lead somewhere, pages in the side bar, pictures of the effects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.site.gallery import signature
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
