"""Working through cases: sealed, recorded, diagnosed, kept; whatever is there already is kept."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.io.storage.code_version import closure_digest
from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.io.storage.syntax import syntax_of
from pipeline.records.capture import Campaign
from tests.benchmark.blind import Diagnose, attempted, blind_process
from tests.benchmark.cases import Case, case_from
from tests.benchmark.sealing import blind_campaign

HERE = Path(__file__).parent
JUDGED = ("pipeline.criticism.diagnosis", "pipeline.execution.tasks.start")
SIMULATED = ("pipeline.simulator.bench", "pipeline.simulator.outside")
RECORDED = ("bench.py", "corruption.py", "sealing.py")


def code_digest() -> str:
    """12 hex digits of what a result hangs on: what is judged, what is simulated and how."""
    parts = [closure_digest(module) for module in (*JUDGED, *SIMULATED)]
    parts += [syntax_of((HERE / name).read_bytes(), "tests.benchmark").digest for name in RECORDED]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


@dataclass(frozen=True, slots=True)
class Book:
    """A folder of results: `sealed/` holds truths, `results/CODE/` one diagnosis a case."""

    folder: Path
    code: str

    def sealed(self, case: Case) -> Path:
        """Where the truth of a case lies."""
        return self.folder / "sealed" / f"{case.key}.json"

    def result(self, case: Case) -> Path:
        """Where the diagnosis of a case lies; its name hangs on case, station and code."""
        return self.folder / "results" / self.code / f"{case.key}-{case.station_key}.json"

    def document(self, case: Case) -> dict[str, Any] | None:
        """The diagnosis of a case, None where there is none yet."""
        path = self.result(case)
        if not path.is_file():
            return None
        found: dict[str, Any] = json.loads(path.read_bytes())
        return found

    def cases(self) -> list[Case]:
        """Every case that has been sealed here, in the order of its family and number."""
        found = [
            case_from(json.loads(path.read_bytes()))
            for path in sorted((self.folder / "sealed").glob("*.json"))
        ]
        return sorted(found, key=lambda case: (case.family, case.number))


def share_of(cases: list[Case], shard: str) -> list[Case]:
    """The cases of one shard `i/n`, i from 1; raises ValueError for anything else."""
    words = shard.split("/")
    if len(words) != 2 or not all(word.isdigit() for word in words):
        raise ValueError(f"shard={shard!r} is not i/n")
    i, n = int(words[0]), int(words[1])
    if not 1 <= i <= n:
        raise ValueError(f"shard={shard!r}: i goes from 1 to n")
    return cases[i - 1 :: n]


def run(
    cases: Sequence[Case],
    book: Book,
    diagnose: Diagnose,
    *,
    blind: bool = True,
    record: Callable[[Case], Campaign] = blind_campaign,
) -> int:
    """Diagnoses every case that has no result yet; returns how many it did.

    The next campaign is recorded while the last one is being diagnosed. `blind` False diagnoses
    in this process, for tests with a diagnosis of their own.
    """
    due = [case for case in cases if not book.result(case).is_file()]
    for case in cases:
        if not book.sealed(case).is_file():
            write_whole(book.sealed(case), canonical_json(case.document()))
    if not blind:
        for case in due:
            _keep(book, case, attempted(diagnose, record(case), case.model))
        return len(due)
    with blind_process() as worker:
        waiting = None
        for case in due:
            campaign = record(case)
            if waiting is not None:
                _keep(book, waiting[0], waiting[1].result())
            waiting = case, worker.submit(attempted, diagnose, campaign, case.model)
        if waiting is not None:
            _keep(book, waiting[0], waiting[1].result())
    return len(due)


def _keep(book: Book, case: Case, document: dict[str, Any]) -> None:
    write_whole(book.result(case), canonical_json(document))
