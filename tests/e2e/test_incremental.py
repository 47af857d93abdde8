"""A rerun does what has changed, and gives the bytes of a clean run."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.execution.caches import fits
from pipeline.execution.jobs import ModelTest
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.stages import run

WORDS = ("report=true", "recordings=false", "residual_test=false")
CLEAN: dict[object, tuple[int, dict[str, bytes]]] = {}
"""Clean runs by the bytes of their input and their words."""


class Folder:
    """Captures of two motors, an output folder, and what of the work was done."""

    def __init__(self, bench: Path, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.input, self.output, self.place = place / "in", place / "out", place
        for motor in ("one", "two"):
            (self.input / motor).mkdir(parents=True)
            for name in ("resistance_ab.csv", "lcr.csv", "open_circuit_forward.mcap"):
                shutil.copyfile(bench / motor / name, self.input / motor / name)
        monkeypatch.setenv("XDG_CACHE_HOME", str(place / "home"))
        # a file as young as these is not believed to be noted whole: nobody changes it meanwhile
        monkeypatch.setattr("pipeline.io.storage.identity._instant_ns", lambda _: 0)
        self.worked: list[str] = []
        whole = WorkerPool.map_tasks

        def watched(workers: WorkerPool, function: Any, tasks: Any, done: Any = None) -> list[Any]:
            self.worked += [task.name for task in tasks if not isinstance(task, ModelTest)]
            return whole(workers, function, tasks, done)

        monkeypatch.setattr(WorkerPool, "map_tasks", watched)

    def run(self, *more: str) -> list[str]:
        """The tasks that the run gave to its workers; its results must be those of a clean run."""
        self.worked.clear()
        code = main(["run", f"input={self.input}", f"output={self.output}", *WORDS, *more])
        worked = list(self.worked)
        assert (code, results(self.output)) == self.clean(*more)
        return worked

    def clean(self, *more: str) -> tuple[int, dict[str, bytes]]:
        """Exit code and results of a clean run, which hang on bytes and words alone: done once."""
        content = {p.relative_to(self.input).as_posix(): p.read_bytes() for p in files(self.input)}
        key = (tuple(sorted(content.items())), more)
        if key not in CLEAN:
            output = self.place / "clean"
            shutil.rmtree(output, ignore_errors=True)
            words = [f"input={self.input}", f"output={output}", *WORDS, *more, "cache=false"]
            code = main(["run", *words])
            CLEAN[key] = code, results(output)
        return CLEAN[key]


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def results(output: Path) -> dict[str, bytes]:
    named = {path.relative_to(output).as_posix(): path.read_bytes() for path in files(output)}
    return {k: v for k, v in named.items() if not k.startswith((".cache/", "registry/"))}


@pytest.fixture
def folder(bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folder:
    return Folder(bench, tmp_path, monkeypatch)


LOOK = "the survey of one/lcr.csv and 5 more files"
ONE, TWO = "motor gimbal/one", "motor gimbal/two"


def test_nothing_changed_nothing_done(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    folder.clean()
    capsys.readouterr()
    assert folder.run() == [LOOK, ONE, TWO]
    first = capsys.readouterr()
    assert folder.run() == []
    again = capsys.readouterr()
    assert again.err == first.err
    assert again.out == first.out.replace("2 new, 0 known", "0 new, 2 known", 1)


def test_what_a_changed_capture_touches_is_done(folder: Folder) -> None:
    """A row more in one capture: that file is looked at, that motor is fitted."""
    folder.run()
    changed = folder.input / "two" / "lcr.csv"
    text = changed.read_text()
    lines = [line for line in text.splitlines() if not line.startswith("# sha256_rows")]
    changed.write_text("\n".join(lines[:-1]) + "\n")
    assert folder.run() == ["the survey of two/lcr.csv and 0 more files", TWO]
    changed.unlink()
    assert folder.run() == [TWO]
    shutil.rmtree(folder.input / "one")
    assert folder.run("prune=true") == []
    assert [path.name for path in (folder.output / "datasheets").iterdir()] == ["gimbal~2ftwo.json"]


def test_another_input_into_the_same_output_keeps_the_motors_of_the_first(
    folder: Folder, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two inputs one after the other give the fleet of one input that holds both."""
    folder.run()
    together = results(folder.output)
    shutil.rmtree(folder.output)
    outputs = f"output={folder.output}"
    for motor in ("one", "two"):
        main(["run", f"input={folder.input / motor}", outputs, *WORDS])
        (folder.output / "findings.json").unlink()
    (line,) = (one for one in capsys.readouterr().err.splitlines() if "keeps" in one)
    assert line.startswith(f"note: {folder.output} keeps 1 motor of earlier runs: gimbal/one; ")
    for name in ("fleet.csv", "datasheets/gimbal~2fone.json", "report/gimbal~2fone.html"):
        assert name in results(folder.output)
    index = (folder.output / "report" / "index.html").read_text()
    assert all(f"gimbal~2f{motor}.html" in index for motor in ("one", "two"))
    assert set(results(folder.output)) == set(together) - {"findings.json"}
    assert results(folder.output)["fleet.csv"].count(b"gimbal/one") > 5


def test_prune_says_what_it_removes(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    """What goes is counted and named, once; a user's file stays."""
    folder.run()
    own = folder.output / "datasheets" / "notes.txt"
    own.write_text("mine")
    (folder.input / "one").rename(folder.place / "elsewhere")
    capsys.readouterr()
    words = ["run", f"input={folder.input}", f"output={folder.output}", *WORDS, "prune=true"]
    main(words)
    (line,) = (one for one in capsys.readouterr().err.splitlines() if "removed" in one)
    assert line.startswith(f"note: {folder.output}: 4 files of an earlier run removed: ")
    kinds = {"datasheets": "json", "performance": "json", "report": "html", "sheet": "html"}
    names = ", ".join(f"{kind}/gimbal~2fone.{form}" for kind, form in kinds.items())
    assert line.endswith(f"removed: {names}")
    assert own.read_text() == "mine"
    main(words)
    assert "removed" not in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["touched", "torn", "gone", "registry"])
def test_results_that_are_not_whole_are_made_again(folder: Folder, kind: str) -> None:
    folder.run()
    sheet = folder.output / "datasheets" / "gimbal~2fone.json"
    if kind == "touched":
        sheet.write_bytes(sheet.read_bytes().replace(b"7", b"8", 1))
    elif kind == "torn":
        sheet.write_bytes(sheet.read_bytes()[:100])
    elif kind == "gone":
        sheet.unlink()
    else:
        shutil.rmtree(folder.output / "registry")
    assert folder.run() == ([] if kind == "registry" else [ONE])
    assert (folder.output / "registry" / "_delta_log").is_dir()


@pytest.mark.slow
def test_notes_are_not_believed_blindly(folder: Folder) -> None:
    """Every note replaced by another of its kind, or by noise: the work is done again."""
    folder.run("residual_test=true")
    notes = files(folder.output / ".cache")
    assert len(notes) == 8  # survey, batch, and of each motor: it, its fits, its model
    for note in notes:
        note.write_bytes(note.read_bytes().replace(b"gimbal", b"gimbol"))
    assert folder.run("residual_test=true") == [LOOK, ONE, TWO]
    for note in notes:
        note.write_bytes(b"\x80\x04K\x01." * 100)
    for note in (folder.place / "home").rglob("*.json"):
        note.write_bytes(b"{}")
    assert folder.run("residual_test=true") == [LOOK, ONE, TWO]


@pytest.mark.slow
def test_a_changed_setting_is_a_change(folder: Folder) -> None:
    folder.run()
    assert folder.run("crosscheck.kt_vs_ke.allowance=0.5") == [ONE, TWO]
    assert folder.run("workers=3", "crosscheck.kt_vs_ke.allowance=0.5") == []
    assert folder.run("report=false", "crosscheck.kt_vs_ke.allowance=0.5") == [ONE, TWO]


def test_without_a_home_files_are_read_again(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nobody notes which files kept their bytes, they are read; finished motors stay so."""
    (folder.place / "home").write_text("in the way")
    folder.run()
    assert folder.run() == [LOOK]


def test_a_changed_estimator_is_fitted_again_with_those_that_use_it(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own fit is done anew; as it gives the same, no other one is. Other values: its users."""
    fitted: list[str] = []
    call = fits.FitMemory.__call__

    def watched(self: Any, estimator: Any, known: Any, options: Any, fit: Any) -> Any:
        def counted() -> Any:
            fitted.append(estimator.name)
            found = fit()
            if estimator.name == "open_circuit" and shifted:
                found = shift(found)
            return found

        return call(self, estimator, known, options, counted)

    def shift(found: Any) -> Any:
        from dataclasses import replace

        moved = tuple(
            replace(e, value=e.value * 1.01) if e.name == "psi_pm_wb" and e.known else e
            for e in found.estimates
        )
        return replace(found, estimates=moved)

    shifted = False
    words = ["run", f"input={folder.input / 'one'}", f"output={folder.output}", *WORDS]
    monkeypatch.setattr(fits.FitMemory, "__call__", watched)
    main(words)
    everything = sorted(fitted)
    assert {"resistance", "open_circuit"} <= set(everything)

    def edit(number: int, module_end: str = ".open_circuit") -> None:
        """As if the source of one estimator had been changed."""
        fitted.clear()
        digest = fits.closure_digest

        def changed(module: str) -> str:
            return digest(module) + (f"{number}" if module.endswith(module_end) else "")

        monkeypatch.setattr(fits, "closure_digest", changed)
        monkeypatch.setattr(run, "tools", lambda _: f"edit {number}")
        main(words)

    edit(1)
    assert fitted == ["open_circuit"]
    shifted = True
    edit(2)
    assert fitted[0] == "open_circuit"
    assert set(fitted) > {"open_circuit"}
    assert "resistance" not in fitted
    edit(3, ".derived")
    assert fitted == ["derived"], "its fit is made elsewhere, of the formulas in its own file"
