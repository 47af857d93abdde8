"""Every page by the rules of WCAG, in light and dark: contrast, names, order of headings, labels.

The judge is axe-core, in a browser that reaches no other machine.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.unit.report.test_in_browser import PAGES
from tests.viewing import PATIENCE_S, Browser

BAD = """<!doctype html><title>bad</title><body><main><h1>Bad</h1>
<p style="color:#ccc;background:#fff">pale</p><img src="data:,"></main>"""
RUN = """axe.run().then((found) => found.violations.flatMap((rule) => rule.nodes.map(
  (node) => `${rule.id}: ${node.html.slice(0, 120)}: ${node.failureSummary.slice(0, 200)}`)))"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser((1400, 1000)) as browser:
        yield browser


def evaluated(browser: Browser, session: str, script: str) -> Any:
    asked = {"expression": script, "returnByValue": True, "awaitPromise": True}
    told = browser.call("Runtime.evaluate", asked, session)
    assert "exceptionDetails" not in told, told["exceptionDetails"]
    return told["result"].get("value")


def violations(browser: Browser, path: Path, *, dark: bool) -> list[str]:
    """A line for each element that breaks a rule."""
    spec = find_spec("axe_core_python")
    assert spec is not None and spec.origin is not None
    rules = (Path(spec.origin).parent / "axe.min.js").read_text("utf-8")
    session = browser.page(path.as_uri(), dark)
    deadline = time.monotonic() + PATIENCE_S
    while evaluated(browser, session, "[document.readyState, document.title]")[0] != "complete":
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert evaluated(browser, session, "matchMedia('(prefers-color-scheme: dark)').matches") == dark
    evaluated(
        browser, session, "for (const one of document.querySelectorAll('details')) one.open = true"
    )
    evaluated(browser, session, rules + ";0")
    found: list[str] = evaluated(browser, session, RUN)
    return found


DARK = ("sheet",)
"""Pages that the default run sees in the dark as well."""


@pytest.mark.parametrize(
    ("name", "dark"),
    [
        pytest.param(
            name,
            dark,
            id=f"{name}-{'dark' if dark else 'light'}",
            marks=pytest.mark.slow if dark and name not in DARK else (),
        )
        for name in PAGES
        for dark in (False, True)
    ],
)
def test_a_page_breaks_no_rule(tmp_path: Path, browser: Browser, name: str, dark: bool) -> None:
    page = tmp_path / "page.html"
    page.write_text(PAGES[name](), "utf-8")
    assert violations(browser, page, dark=dark) == []


def test_what_breaks_a_rule_is_seen(tmp_path: Path, browser: Browser) -> None:
    page = tmp_path / "bad.html"
    page.write_text(BAD, "utf-8")
    rules = {line.split(":")[0] for line in violations(browser, page, dark=False)}
    assert {"color-contrast", "image-alt", "html-has-lang"} <= rules
