"""Commands on a page can be pasted: the reader names the captures once."""

from __future__ import annotations

import time
from pathlib import Path

from pipeline.report.pages.ladder_page import render_ladder
from tests.unit.ladders import make_diagnosis
from tests.unit.report.test_accessible import evaluated
from tests.viewing import PATIENCE_S, Browser

TYPED = """(() => {
  const box = document.querySelector("label.folder input");
  box.value = "my captures";
  box.dispatchEvent(new Event("input"));
  const codes = [...document.querySelectorAll(".command code")];
  return codes.map((code) => code.textContent).join("\\n");
})()"""


def test_the_folder_that_is_typed_and_the_output_stand_in_every_command(tmp_path: Path) -> None:
    page = tmp_path / "an output" / "diagnosis" / "page.html"
    page.parent.mkdir(parents=True)
    page.write_text(render_ladder(make_diagnosis()), "utf-8")
    with Browser((1400, 1000)) as browser:
        session = browser.page(page.as_uri(), False)
        deadline = time.monotonic() + PATIENCE_S
        while evaluated(browser, session, "[document.readyState, location.protocol].join()") != (
            "complete,file:"
        ):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        commands = evaluated(browser, session, TYPED).splitlines()
    output = f"output='{tmp_path / 'an output'}'"
    assert commands == [
        "motor-datasheets compare input='my captures' motor=joint-P1 "
        f"'model.effects=[dead_time]' {output}",
        f"motor-datasheets run input='my captures' 'model.effects=[dead_time]' {output}",
    ]


def test_a_folder_that_is_known_is_asked_of_nobody() -> None:
    html = render_ladder(make_diagnosis(), (), "captures", "out")
    assert "FOLDER" not in html.split("<main>")[1].split("<script>")[0]
    assert "input=captures" in html and "output=out" in html
