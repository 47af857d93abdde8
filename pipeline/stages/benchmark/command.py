"""`benchmark`: draws sealed cases, lets `diagnose` work on them blind, and prints the table."""

from __future__ import annotations

from pathlib import Path

from pipeline.io.storage.publish import write_whole
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.settings import BenchmarkSettings
from pipeline.stages.benchmark.blind import product
from pipeline.stages.benchmark.cases import Case
from pipeline.stages.benchmark.drawing import cases, small
from pipeline.stages.benchmark.running import Book, code_digest, run, share_of
from pipeline.stages.benchmark.table import by_effect, table

ACTIONS = ("run", "table", "sensitivity")
SUBSETS = ("small", "full")
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"


def main(settings: BenchmarkSettings) -> Outcome:
    """Runs one shard of the benchmark, or prints the table of what has been run."""
    if settings.action not in ACTIONS:
        raise UsageError(f"no action {settings.action!r}", f"known are {', '.join(ACTIONS)}")
    if settings.subset not in SUBSETS:
        raise UsageError(f"no subset {settings.subset!r}", f"known are {', '.join(SUBSETS)}")
    output = Path(settings.output)
    if settings.action == "sensitivity":
        from pipeline.stages.benchmark.sensitivity import measure_all

        measure_all(output)
        return Outcome(text=f"sensitivities of every motor in {output}\n")
    watch, book = Stopwatch(), Book(output, code_digest())
    with watch.stage("draw"):
        drawn = list(cases(settings.seed, output / "sensitivity"))
        chosen = small(iter(drawn)) if settings.subset == "small" else drawn
    done = 0
    if settings.action == "run":
        try:
            mine = share_of(chosen, settings.shard)
        except ValueError as error:
            raise UsageError(str(error), "write shard=1/4 for the first of four") from error
        with watch.stage("diagnose"):
            done = run(mine, book, product)
    text = _table(settings, book, chosen)
    if settings.docs:
        _into_page(Path(settings.docs), text)
    return Outcome(text=f"{done} cases diagnosed\n\n{text}", timings=watch.table())


def _table(settings: BenchmarkSettings, book: Book, chosen: list[Case]) -> str:
    found = [(case, document) for case in chosen if (document := book.document(case)) is not None]
    date = f", {settings.date}" if settings.date else ""
    heading = (
        f"{len(found)} of {len(chosen)} cases of the {settings.subset} set, "
        f"seed {settings.seed}, code {book.code}{date}"
    )
    whole = table(found, heading)
    if settings.subset == "full":
        whole += "\n" + by_effect(found)
    return whole


def _into_page(page: Path, text: str) -> None:
    """Puts a table between the marks of a page; raises UsageError where it has none."""
    words = page.read_text(encoding="utf-8")
    if BEGIN not in words or END not in words:
        raise UsageError(f"{page} has no place for the table", f"write {BEGIN} and {END} into it")
    before, rest = words.split(BEGIN, 1)
    _, after = rest.split(END, 1)
    write_whole(page, f"{before}{BEGIN}\n{text}{END}{after}".encode())
