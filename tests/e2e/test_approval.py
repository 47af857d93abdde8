"""What a person decides reaches every page, table and export, and no datasheet changes by it."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.execution.workers.worker_pool import WorkerPool

HEAD = "# contract: 1\n# motor_id: J/1\n# test: resistance\n# pair: ab\n# station: hall\n# lot: 7\n"
LEVELS = [-2.0, -1.0, 1.0, 2.0]
UNDECIDED = 4  # one test: nothing to check it against
WHO = ("by=A. Smith", "why=first <article>")


class Bench:
    """A resistance test of one motor, which is all that its limits file wants, and an output."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.input, self.output, self.place = folder / "in", folder / "out", folder
        self.input.mkdir()
        (folder / "limits.yaml").write_text("required: [r_phase_ohm]\n")
        monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "home"))
        # a file as young as this one is not believed to be noted whole: nobody changes it here
        monkeypatch.setattr("pipeline.io.storage.identity._instant_ns", lambda _: 0)
        self.record("ab.csv", 0.6)
        self.worked: list[str] = []
        whole = WorkerPool.map_tasks

        def watched(workers: WorkerPool, function: Any, tasks: Any, done: Any = None) -> list[Any]:
            self.worked += [task.name for task in tasks]
            return whole(workers, function, tasks, done)

        monkeypatch.setattr(WorkerPool, "map_tasks", watched)

    def record(self, name: str, r_ohm: float) -> None:
        rows = [
            f"{0.001 * (200 * level + k):.3f},{r_ohm * i_a},{i_a},25.0\n"
            for level, i_a in enumerate(LEVELS)
            for k in range(200)
        ]
        body = "t_s,vab_v,ia_a,temp_winding_degc\n" + "".join(rows)
        digest = hashlib.sha256(body.encode()).hexdigest()
        (self.input / name).write_text(f"{HEAD}# sha256_rows: {digest}/{len(rows)}\n{body}")

    def run(self, *more: str) -> list[str]:
        """What was worked on."""
        self.worked.clear()
        words = [f"input={self.input}", f"output={self.output}", "recordings=false", "workers=1"]
        limits = f"limits={self.place / 'limits.yaml'}"
        assert main(["run", *words, limits, *more]) == UNDECIDED
        return list(self.worked)

    def decide(self, what: str, revision: int, *more: str) -> int:
        registry = f"registry={self.output / 'registry'}"
        words = ("registry", what, "J/1", f"revision={revision}", *WHO)
        return main([*words, *(more or (registry,))])

    def export(self, *more: str) -> int:
        return main(["export", "csv", "J/1", f"output={self.output}", *more])

    def page(self) -> str:
        (path,) = (self.output / "report").glob("*1*.html")
        return path.read_text(encoding="utf-8")

    def index(self) -> str:
        return (self.output / "report" / "index.html").read_text(encoding="utf-8")

    def sheet(self) -> bytes:
        (path,) = (self.output / "datasheets").iterdir()
        return path.read_bytes()

    def status(self) -> str:
        """The status that the motor's page and the table of motors show."""
        (heading,) = re.findall(r'<h1>.*?<span class="badge (\w+)">', self.page())
        row = re.findall(r"<tbody>\n<tr>.*?</tr>", self.index(), re.DOTALL)[0]
        (cell,) = re.findall(r'<td data-sort="(\w+)"><span class="badge \w+">', row)[:1]
        assert cell == heading
        assert f"1 {heading}" in self.index()
        return heading


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


def test_export_of_what_the_page_calls_not_approved(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    """Approved, the page went on saying provisional while export wrote the motor."""
    bench.run()
    content = bench.sheet()
    assert bench.status() == "provisional"
    assert bench.export() == 2
    assert "is provisional, not released" in capsys.readouterr().err

    assert bench.decide("approve", 1) == 0
    said = capsys.readouterr().out
    assert "J/1 revision 1 is released: approved by A. Smith" in said
    assert "stands: model: the captures cannot fit the base model" in said
    assert "shown in" in said
    assert bench.status() == "released"
    assert "approved by A. Smith on" in bench.page()
    assert "first &lt;article&gt;" in bench.page()
    assert bench.export() == 0
    assert "revision 1, approved by A. Smith" in capsys.readouterr().err
    assert bench.sheet() == content, "a decision never changes a datasheet"

    pages = bench.page(), bench.index()
    assert bench.run() == [], "all is kept, the pages are not made anew"
    told = capsys.readouterr().out
    assert "1 released, 0 provisional" in told
    assert "approved by A. Smith" in told
    assert (bench.page(), bench.index()) == pages
    assert bench.run() == []
    assert "1 released" in capsys.readouterr().out
    bench.run("cache=false")
    assert (bench.page(), bench.index(), bench.sheet()) == (*pages, content)

    assert bench.decide("revoke", 1) == 0
    assert bench.status() == "revoked"
    assert bench.export() == 2
    assert bench.run() == ["motor J/1"], "a revoked version is looked at anew"
    assert "1 revoked" in capsys.readouterr().out
    assert bench.status() == "revoked"


def test_export_of_a_version_that_is_not_the_one_on_the_page(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    """A newer version that nobody approved: page, terminal and export name the one that counts."""
    bench.run()
    bench.decide("approve", 1)
    bench.record("ab.csv", 0.61)
    assert "motor J/1" in bench.run()
    said = capsys.readouterr().out
    assert bench.status() == "provisional"
    assert "export writes revision 1, approved by A. Smith" in bench.page()
    assert "export writes revision 1, approved by A. Smith" in said
    assert bench.export() == 0
    notes = capsys.readouterr().err
    assert "revision 1, approved by A. Smith" in notes
    assert "revision 2 is newer and provisional" in notes
    assert bench.export("revision=2") == 2

    bench.decide("approve", 2)
    assert bench.status() == "released"
    assert "not this one" not in bench.page()
    capsys.readouterr()
    assert bench.export() == 0
    notes = capsys.readouterr().err
    assert "revision 2, approved" in notes
    assert "newer" not in notes

    bench.decide("revoke", 2)
    assert bench.status() == "revoked"
    assert "export writes revision 1, approved by A. Smith" in bench.page()


def test_a_decision_in_a_registry_elsewhere_shows_after_the_next_run(bench: Bench) -> None:
    """No page is beside it; a cached run shows it."""
    place = f"registry={bench.place / 'shared'}"
    bench.run(place)
    assert bench.decide("approve", 1, place) == 0
    assert bench.status() == "provisional"
    assert bench.run(place) == []
    assert bench.status() == "released"
    assert bench.run("registry=null") == []
    assert bench.status() == "provisional", "without a registry nothing was decided"


def test_nothing_was_found_wrong_is_said_of_a_model_that_was_tested_alone(bench: Bench) -> None:
    bench.run()
    assert "Nothing was found wrong" not in bench.page()
    assert "The captures cannot fit the base model" in bench.page()
    bench.run("residual_test=false")
    assert "Nothing was found wrong" not in bench.page()
    assert "residual_test=false" in bench.page()
    assert ">not tested</span>" in bench.index()
