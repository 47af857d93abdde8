"""Running: nothing is done twice, nothing is lost, and the diagnosing side is blind."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.records.capture import Campaign
from pipeline.records.errors import UsageError
from tests.benchmark import bench
from tests.benchmark import cases as cases_module
from tests.benchmark.blind import attempted, blind_process
from tests.benchmark.cases import Case
from tests.benchmark.command import MARKS, Options, main, options
from tests.benchmark.drawing import cases
from tests.benchmark.running import Book, code_digest, run, share_of


def fake(campaign: Campaign, model: str) -> dict[str, Any]:
    """A diagnosis that hangs on the samples, so that other samples give another document."""
    rows = sum(table.height for capture in campaign.captures for table in capture.tables)
    mean = float(campaign.captures[0].tables[0].to_series(1).mean())  # type: ignore[arg-type]
    return {
        "schema": "model-diagnosis/1",
        "motor_id": campaign.motor_id,
        "model": model,
        "verdict": "adequate",
        "missing": [],
        "ranking": [],
        "ladder": [{"effects": [], "held_out": rows + mean, "signals": {}}],
        "unknown": None,
    }


def what_it_sees(campaign: Campaign, model: str) -> dict[str, Any]:
    """Everything in reach of the blind process but the campaign."""
    return {"cwd": str(Path.cwd()), "argv": sys.argv, "files": [*map(str, Path().iterdir())]}


def broken(campaign: Campaign, model: str) -> dict[str, Any]:
    raise ZeroDivisionError(model)


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    drawn = list(cases(3, tmp_path_factory.mktemp("sensitivity")))
    nulls = [case for case in drawn if case.family == "null" and case.motor == "joint-11p"]
    return nulls[:2] + [case for case in drawn if case.family == "gap"][:2]


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_stopped_and_run_again_gives_the_same_bytes(few: list[Case], tmp_path: Path) -> None:
    whole, halves = Book(tmp_path / "whole", "code"), Book(tmp_path / "halves", "code")
    assert run(few, whole, fake, blind=False) == 4
    calls = 0

    def stopped(campaign: Campaign, model: str) -> dict[str, Any]:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt
        return fake(campaign, model)

    with pytest.raises(KeyboardInterrupt):
        run(few, halves, stopped, blind=False)
    assert len(list((tmp_path / "halves" / "results").rglob("*.json"))) == 2
    assert run(few, halves, fake, blind=False) == 2
    assert bytes_of(tmp_path / "halves") == bytes_of(tmp_path / "whole")
    assert run(few, halves, broken, blind=False) == 0


def test_shards_together_are_the_whole(few: list[Case], tmp_path: Path) -> None:
    whole, parts = Book(tmp_path / "whole", "code"), Book(tmp_path / "parts", "code")
    run(few, whole, fake, blind=False)
    for shard in ("2/3", "1/3", "3/3"):
        run(share_of(few, shard), parts, fake, blind=False)
    assert bytes_of(tmp_path / "parts") == bytes_of(tmp_path / "whole")


@pytest.mark.parametrize("shard", ["0/2", "3/2", "1", "a/b", "1/2/3"])
def test_a_strange_shard_is_refused(shard: str) -> None:
    with pytest.raises(ValueError, match="shard"):
        share_of([], shard)


def test_results_of_other_code_do_not_count(few: list[Case], tmp_path: Path) -> None:
    run(few[:1], Book(tmp_path, "old"), fake, blind=False)
    assert Book(tmp_path, "new").document(few[0]) is None
    assert Book(tmp_path, "old").document(few[0]) is not None
    assert len(code_digest()) == 12
    assert code_digest() == code_digest()


def test_results_of_another_station_do_not_count(
    few: list[Case], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a case nor the code holds what conf/motor says: another bench, another result."""
    run(few[:1], Book(tmp_path, "code"), fake, blind=False)
    now = Book(tmp_path, "code").result(few[0])
    place = bench.station(few[0].motor)
    for other in (
        replace(place, motor=replace(place.motor, r_phase_ohm=1.01 * place.motor.r_phase_ohm)),
        replace(place, bench=replace(place.bench, torque_noise_rel=1e-2)),
        replace(place, plan=place.plan[:-1]),
    ):
        cases_module._station_key.cache_clear()
        monkeypatch.setattr(cases_module, "station", lambda _, told=other: told)
        assert Book(tmp_path, "code").result(few[0]) != now
        assert Book(tmp_path, "code").document(few[0]) is None
    cases_module._station_key.cache_clear()
    monkeypatch.undo()
    assert Book(tmp_path, "code").result(few[0]) == now


def test_truth_lies_apart_from_results(few: list[Case], tmp_path: Path) -> None:
    book = Book(tmp_path, "code")
    run(few, book, fake, blind=False)
    assert {case.key for case in book.cases()} == {case.key for case in few}
    for path in (tmp_path / "results").rglob("*.json"):
        assert b"truth" not in path.read_bytes()
    for case in few:
        assert book.sealed(case).parent != book.result(case).parent


def test_the_blind_process_has_an_empty_folder_and_no_arguments(
    few: list[Case], tmp_path: Path
) -> None:
    from tests.benchmark.sealing import blind_campaign

    campaign = blind_campaign(few[0])
    with blind_process() as worker:
        seen = worker.submit(attempted, what_it_sees, campaign, "standard").result()
        again = worker.submit(attempted, fake, campaign, "standard").result()
    assert seen["files"] == []
    assert seen["argv"] == [""]
    assert str(tmp_path) not in seen["cwd"]
    assert again == fake(campaign, "standard")


def test_a_diagnosis_that_breaks_is_a_result(few: list[Case], tmp_path: Path) -> None:
    book = Book(tmp_path, "code")
    run(few[:1], book, broken, blind=False)
    assert book.document(few[0]) == {"failure": "ZeroDivisionError: standard"}


def test_a_document_with_nan_is_a_failure(few: list[Case], tmp_path: Path) -> None:
    """No file may hold NaN; the case counts as broken down and the run goes on."""

    def odd(campaign: Campaign, model: str) -> dict[str, Any]:
        return {**fake(campaign, model), "ladder": [{"held_out": float("nan")}]}

    book = Book(tmp_path, "code")
    assert run(few[:2], book, odd, blind=False) == 2
    assert "nan" in (book.document(few[0]) or {})["failure"]


def test_the_command_prints_what_there_is(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    begin, end = (mark.format("table") for mark in MARKS)
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    settings = Options(
        action="table", output=str(tmp_path / "out"), docs=str(page), date="2026-01-01"
    )
    text = main(settings)
    assert "0 of 28 cases of the small set, seed 1" in text
    words = page.read_text()
    assert words.startswith("before\n")
    assert words.endswith("after\n")
    assert "\nold\n" not in words
    assert "2026-01-01" in words


@pytest.mark.parametrize(
    ("key", "value"), [("action", "guess"), ("subset", "tiny"), ("docs", "{page}")]
)
def test_wrong_use_is_said(tmp_path: Path, key: str, value: str) -> None:
    (tmp_path / "page.md").write_text("no marks\n")
    given = {"output": str(tmp_path / "out"), "action": "table"}
    given[key] = value.format(page=tmp_path / "page.md")
    with pytest.raises(UsageError):
        main(Options(**given))


def test_words_are_options() -> None:
    assert options(["subset=full", "seed=7"]) == Options(subset="full", seed=7)
    for word in ("full", "sed=7", "seed=x"):
        with pytest.raises(UsageError, match=re.escape(word)):
            options([word])


def test_wrong_use_ends_in_one_line() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmark", "action=guess"],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("error: no action 'guess'")
