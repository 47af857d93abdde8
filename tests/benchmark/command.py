"""What `python -m tests.benchmark` does: sealed cases, diagnosed blind, and the table of marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from pipeline.io.storage.publish import write_whole
from pipeline.records.errors import UsageError
from tests.benchmark.blind import product
from tests.benchmark.cases import Case
from tests.benchmark.drawing import cases, small
from tests.benchmark.policy_sensitivity import chosen_entries, measure, page, spread
from tests.benchmark.running import Book, code_digest, run, share_of
from tests.benchmark.table import by_effect, table

ACTIONS = ("run", "table", "sensitivity", "policy")
SUBSETS = ("small", "full")
MARKS = "<!-- {}: begin -->", "<!-- {}: end -->"


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """The keys of the command.

    `action`: run, table (of what has been run), sensitivity (measure a* anew), or policy (halve and
    double the chosen numbers `fields`, or `all`, on `count` cases). `output`: folder
    of sealed truths and results. `subset`: small, of minutes, or full, of hours. `shard`: which
    part of the cases to work on, i/n with i from 1. `seed`: of every random draw, and of the motors
    of a world, from 1. `docs`: Markdown page to put the table into, between its marks. `date`: date
    to write over the table. `world`:
    somebody else's plant to record in place of the project's simulator. `method`: another method
    to judge on a world in place of `diagnose` (`worlds/rivals.py`).
    """

    action: str = "run"
    output: str = "reports/benchmark"
    subset: str = "small"
    shard: str = "1/1"
    seed: int = 1
    docs: str = ""
    date: str = ""
    world: str = ""
    method: str = ""
    fields: str = ""
    count: int = 8


def options(words: Sequence[str]) -> Options:
    """Options from `key=value` words; raises UsageError for what is none."""
    known = {field.name: field.type for field in fields(Options)}
    given: dict[str, Any] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign or key not in known:
            raise UsageError(f"{word!r} is no key=value", f"known keys are {', '.join(known)}")
        if known[key] == "int" and not value.isdecimal():
            raise UsageError(f"{word} is no whole number", f"write {key}= and a whole number")
        given[key] = int(value) if known[key] == "int" else value
    return Options(**given)


def main(chosen: Options) -> str:
    """Runs one shard of the benchmark, or makes the table of what has been run."""
    if chosen.action not in ACTIONS:
        raise UsageError(f"no action {chosen.action!r}", f"known are {', '.join(ACTIONS)}")
    if chosen.subset not in SUBSETS:
        raise UsageError(f"no subset {chosen.subset!r}", f"known are {', '.join(SUBSETS)}")
    output = Path(chosen.output)
    if chosen.action == "sensitivity":
        from tests.benchmark.sensitivity import measure_all

        measure_all(output)
        return f"sensitivities of every motor in {output}\n"
    book = Book(output, code_digest())
    if chosen.world:
        return _world(chosen, book)
    drawn = list(cases(chosen.seed, output / "sensitivity"))
    wanted = small(iter(drawn)) if chosen.subset == "small" else drawn
    if chosen.action == "policy":
        return _policy(chosen, spread(wanted, chosen.count), book)
    done = 0
    if chosen.action == "run":
        try:
            own = share_of(wanted, chosen.shard)
        except ValueError as error:
            raise UsageError(str(error), "write shard=1/4 for the first of four") from error
        done = run(own, book, product)
    text = _table(chosen, book, wanted)
    if chosen.docs:
        _into_page(Path(chosen.docs), "table", text)
    return f"{done} cases diagnosed\n\n{text}"


def _world(chosen: Options, book: Book) -> str:
    """Diagnoses the cases of somebody else's plant; recorded many at once, so in chunks."""
    from tests.benchmark.worlds.recording import WORLDS, Recorder
    from tests.benchmark.worlds.rivals import METHODS, judged_by
    from tests.benchmark.worlds.table import beside, by_programme
    from tests.benchmark.worlds.table import cases as world_cases
    from tests.benchmark.worlds.table import table as world_table

    if chosen.world not in WORLDS:
        raise UsageError(f"no world {chosen.world!r}", f"known are {', '.join(WORLDS)}")
    if chosen.method and chosen.method not in METHODS:
        raise UsageError(f"no method {chosen.method!r}", f"known are {', '.join(METHODS)}")
    try:
        drawn = world_cases(chosen.world, chosen.seed)
    except ImportError as error:
        remedy = f"install {WORLDS[chosen.world]}: docs/benchmark.md says how"
        raise UsageError(f"world={chosen.world} needs {error.name}", remedy) from error
    books = {name: replace(book, code=f"{book.code}-{name}") for name in METHODS} | {"": book}
    wanted, own, done = share_of(drawn, chosen.shard), books[chosen.method], 0
    if chosen.action == "run":
        due = [case for case in wanted if own.document(case) is None]
        judge = judged_by(chosen.method) if chosen.method else product
        done = run(wanted, own, judge, record=Recorder(due))
    found = {
        name or "diagnose": [(c, d) for c in drawn if (d := one.document(c)) is not None]
        for name, one in books.items()
    }
    shown = found[chosen.method or "diagnose"]
    heading = f"{len(shown)} of {len(drawn)} cases of world `{chosen.world}`, code {own.code}\n\n"
    text = f"{heading}{by_programme(shown)}\n{world_table(shown)}\n{beside(found)}"
    if chosen.docs:
        _into_page(Path(chosen.docs), f"world {chosen.world}", text)
    return f"{done} cases diagnosed\n\n{text}"


def _policy(chosen: Options, some: list[Case], book: Book) -> str:
    """Halves and doubles the fields, and writes the table of all that has been run."""
    fields = [name for name in chosen.fields.split(",") if name]
    if fields == ["all"]:
        fields = [entry.name for entry in chosen_entries([])]
    done = measure(some, book, fields)
    text = page(some, book, fields, chosen.seed)
    if chosen.docs:
        write_whole(Path(chosen.docs), text.encode())
    return f"{done} cases diagnosed\n\n{text}"


def _table(options: Options, book: Book, chosen: list[Case]) -> str:
    found = [(case, document) for case in chosen if (document := book.document(case)) is not None]
    date = f", {options.date}" if options.date else ""
    heading = (
        f"{len(found)} of {len(chosen)} cases of the {options.subset} set, "
        f"seed {options.seed}, code {book.code}{date}"
    )
    whole = table(found, heading)
    if options.subset == "full":
        whole += "\n" + by_effect(found)
    return whole


def _into_page(page: Path, name: str, text: str) -> None:
    """Puts a table between its marks on a page; raises UsageError where there are none."""
    begin, end = (mark.format(name) for mark in MARKS)
    words = page.read_text(encoding="utf-8")
    if begin not in words or end not in words:
        raise UsageError(f"{page} has no place for the table", f"write {begin} and {end} into it")
    before, rest = words.split(begin, 1)
    _, after = rest.split(end, 1)
    write_whole(page, f"{before}{begin}\n{text}{end}{after}".encode())
