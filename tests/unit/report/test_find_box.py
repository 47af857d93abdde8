"""The box that finds motors hides the others, on a telephone as on a desk."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from pipeline.report.pages.fleet_page import render_fleet
from tests.unit.report.test_accessible import evaluated
from tests.unit.views.test_fleet import motor
from tests.viewing import PATIENCE_S, Browser

TYPED = """(() => {
  const box = document.querySelector("input");
  box.value = "m3";
  box.dispatchEvent(new Event("input"));
  return [...document.querySelectorAll("tbody tr")].filter((row) => row.offsetHeight > 0).length;
})()"""


@pytest.mark.parametrize("width", [1400, pytest.param(420, marks=pytest.mark.slow)])
def test_the_box_leaves_the_motor_that_is_typed(tmp_path: Path, width: int) -> None:
    page = tmp_path / "page.html"
    page.write_text(render_fleet([motor(f"m{n}", 252.0) for n in range(6)], ()), "utf-8")
    with Browser((width, 1000)) as browser:
        session = browser.page(page.as_uri(), False)
        size = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        browser.call("Emulation.setDeviceMetricsOverride", size, session)
        deadline = time.monotonic() + PATIENCE_S
        while evaluated(browser, session, "[document.readyState, location.protocol].join()") != (
            "complete,file:"
        ):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert evaluated(browser, session, "innerWidth") == width
        assert evaluated(browser, session, TYPED) == 1
