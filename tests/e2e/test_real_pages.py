"""Every page of a real run in a browser, wide, narrow, light and dark: measured, and by axe-core.

Other tests hold pages of made-up motors to the same, which is quick; here are those of the demo.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from pipeline.__main__ import main
from tests.unit.report.test_accessible import violations
from tests.unit.report.test_in_browser import NARROW, WIDE, measure
from tests.viewing import Browser

pytestmark = pytest.mark.slow
DEMO = Path(__file__).parents[2] / "data" / "demo"
MOTOR = "G52-0603"
PAGES = (
    "report/index.html",
    f"report/{MOTOR}.html",
    "report/G52-1402.html",
    f"sheet/{MOTOR}.html",
    f"diagnosis/{MOTOR}.html",
    f"comparison/{MOTOR}.html",
    "regression/report.html",
)


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All that the commands make of the demo: motors, a diagnosis, a comparison, two lots."""
    place = tmp_path_factory.mktemp("real") / "out"
    where = f"output={place}"
    effects = "model.effects=[cogging]"
    assert main(["run", f"input={DEMO}", where, effects, "recordings=false"]) == 1
    assert main(["diagnose", f"input={DEMO}", f"motor={MOTOR}", where, effects]) in (0, 4)
    added = "model.effects=[cogging,stribeck]"
    assert main(["compare", f"input={DEMO}", f"motor={MOTOR}", where, added]) in (0, 4)
    lots = ("baseline=lot:2026-W06", "candidate=lot:2026-W14")
    assert main(["regress", *lots, where]) in (0, 1, 4)
    return place


@pytest.fixture(scope="module")
def measured(output: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    pages = {name: (output / name).read_text("utf-8") for name in PAGES}
    return measure(pages, tmp_path_factory.mktemp("browser"))


@pytest.fixture(scope="module", params=[WIDE, NARROW])
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    with Browser((request.param, 1000)) as browser:
        yield browser


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_scrolls_sideways_and_no_label_is_cut(
    measured: dict[str, Any], name: str, width: int
) -> None:
    told = measured[f"{name} {width}"]
    assert told["width"] == width
    assert told["page"] <= width, told["beyond"][:10]
    assert (told["scrolling"], told["beyond"], told["cut"]) == ([], [], [])


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_a_page_breaks_no_rule(output: Path, browser: Browser, name: str, dark: bool) -> None:
    assert violations(browser, output / name, dark=dark) == []


@pytest.mark.parametrize("name", PAGES)
def test_every_link_leads_to_a_file_of_the_run_or_a_place_on_the_page(
    output: Path, name: str
) -> None:
    page = (output / name).read_text("utf-8")
    places = set(re.findall(r'\bid="([^"]+)"', page))
    for link in re.findall(r'\bhref="([^"]+)"', page):
        path, _, place = unquote(link).partition("#")
        if link.startswith(("http:", "https:", "data:")):
            continue
        if path:
            assert ((output / name).parent / path).resolve().is_file(), link
        else:
            assert place in places, link
