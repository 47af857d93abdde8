"""Every case of every `cases_*.py`, and the table of `docs/recovery.md`.

Blocks of seeds that are done are kept under `reports/recovery`, so that a stopped run goes on where
it was, and after a change of one estimator only that one's cases are drawn anew.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path

from tests.recovery.harness import (
    BIAS_LIMIT_U,
    COVERAGE_LIMITS,
    SCATTER_LIMIT,
    Case,
    Draw,
    Verdict,
    judge,
)
from tests.recovery.kept import digest, draws_of

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs" / "recovery.md"
KEPT = HERE.parents[1] / "reports" / "recovery"
BLOCK = 100
HEAD = (
    "| estimator | constant | seeds | bias / u | coverage of 95 % | scatter / bound | u, relative "
    "| verdict |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n"
)


def cases() -> tuple[Case, ...]:
    """All cases, sorted by file and in each file's order."""
    names = sorted(path.stem for path in HERE.glob("cases_*.py"))
    modules = [importlib.import_module(f"tests.recovery.{name}") for name in names]
    return tuple(case for module in modules for case in module.CASES)


def row(verdict: Verdict) -> str:
    """One line of the table."""
    scatter = "" if verdict.scatter is None else f"{verdict.scatter:.3f}"
    if verdict.scatter_interval is not None:
        low, high = verdict.scatter_interval
        scatter += f" ({low:.2f} to {high:.2f})"
    low, high = verdict.coverage_interval
    exact = verdict.u_relative == 0.0
    bias = "exact" if exact else f"{verdict.bias_u:+.3f} ± {verdict.bias_half_width_u:.3f}"
    coverage = f"{verdict.coverage:.3f}" + ("" if exact else f" ({low:.3f} to {high:.3f})")
    words = "; ".join(verdict.faults) or "holds"
    cells = [verdict.case, verdict.constant, str(verdict.n), bias, coverage, scatter]
    return "| " + " | ".join([*cells, f"{verdict.u_relative:.2g}", words]) + " |\n"


def document(verdicts: Sequence[Verdict], seeds: int) -> str:
    """The page: what was done, the limits, the table."""
    return (
        "# Recovery\n\n"
        f"Every estimator over {seeds} seeds of simulated captures, instrument gains drawn per "
        "seed from their stated uncertainty. In brackets and after ± the 99 % interval of each "
        "figure. Limits: "
        f"bias below {BIAS_LIMIT_U} u, coverage {COVERAGE_LIMITS[0]:.0%} to "
        f"{COVERAGE_LIMITS[1]:.0%}, scatter below {SCATTER_LIMIT} times the Cramér-Rao bound of "
        "the noise, gains taken out; a limit is broken where the whole interval lies beyond it.\n\n"
        "Made by `python -m tests.recovery.table --seeds N`; do not edit.\n\n"
        + HEAD
        + "".join(row(verdict) for verdict in verdicts)
    )


def block(index: int, seeds: range, folder: Path, expected: str) -> list[Draw]:
    """The draws of a block of seeds of one case by its number, for a worker process."""
    return draws_of(cases()[index], seeds, folder, expected)


def verdicts_of(seeds: int, workers: int, folder: Path, names: Sequence[str]) -> list[Verdict]:
    """The verdicts of the cases, each printed when its last block of seeds is done."""
    chosen = [k for k, case in enumerate(cases()) if not names or case.name in names]
    blocks = [range(first, min(first + BLOCK, seeds)) for first in range(0, seeds, BLOCK)]
    jobs = [(k, own, folder, digest(cases()[k], own)) for k in chosen for own in blocks]
    verdicts = []
    with ExitStack() as stack:
        if workers == 1:
            done = (block(*job) for job in jobs)
        else:
            pool = ProcessPoolExecutor(workers, get_context("spawn"))
            done = stack.enter_context(pool).map(block, *zip(*jobs, strict=True))
        for k in chosen:
            draws = [d for _ in blocks for d in next(done)]
            for verdict in judge(cases()[k], draws):
                verdicts.append(verdict)
                sys.stdout.write(row(verdict))
            sys.stdout.flush()
    return verdicts


def main(arguments: Sequence[str]) -> int:
    """Runs all cases, writes the page, returns 1 where a limit is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--output", type=Path, default=DOCUMENT)
    parser.add_argument("--kept", type=Path, default=KEPT, help="where finished blocks are kept")
    parser.add_argument("--cases", nargs="*", default=[], help="only these; no page is written")
    chosen = parser.parse_args(arguments)
    verdicts = verdicts_of(chosen.seeds, chosen.workers, chosen.kept, chosen.cases)
    if not chosen.cases:
        chosen.output.parent.mkdir(parents=True, exist_ok=True)
        chosen.output.write_text(document(verdicts, chosen.seeds), encoding="utf-8")
    return 1 if any(verdict.faults for verdict in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
