"""Every case of every `cases_*.py`, and the table of `docs/recovery.md`."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from tests.recovery.harness import BIAS_LIMIT_U, COVERAGE_LIMITS, SCATTER_LIMIT, Case, Verdict, run

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs" / "recovery.md"
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


def judged(index: int, seeds: int) -> tuple[Verdict, ...]:
    """The verdicts of one case by its number, for a worker process."""
    return run(cases()[index], range(seeds))


def main(arguments: Sequence[str]) -> int:
    """Runs all cases, writes the page, returns 1 where a limit is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--output", type=Path, default=DOCUMENT)
    chosen = parser.parse_args(arguments)
    count = len(cases())
    if chosen.workers == 1:
        found = [judged(index, chosen.seeds) for index in range(count)]
    else:
        with ProcessPoolExecutor(chosen.workers, get_context("spawn")) as pool:
            found = list(pool.map(judged, range(count), [chosen.seeds] * count))
    verdicts = [verdict for group in found for verdict in group]
    chosen.output.parent.mkdir(parents=True, exist_ok=True)
    chosen.output.write_text(document(verdicts, chosen.seeds), encoding="utf-8")
    return 1 if any(verdict.faults for verdict in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
