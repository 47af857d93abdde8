"""Whether the demo came out as it should: `make demo` fails for another finding than the expected.

python -m tests.demo reports/demo
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.io.storage.datasheets import read_datasheets
from pipeline.records.datasheet import Datasheet

EXPECTED = {("G52-1402", "resistance_balance")}
"""Motor and check that fail: that motor has a poor joint."""
MISSING = {("G52-0603", "stribeck"), ("G52-1402", "phase_imbalance")}
"""Motor and effect that its model lacks: a dry bearing, and the same joint."""


def surprises(sheets: Sequence[Datasheet]) -> list[str]:
    """What failed or is missing beside the expected, and what of that did not, a line each."""
    missing = {(s.motor_id, name) for s in sheets if s.model for name in s.model.missing}
    failed = {(s.motor_id, c.name) for s in sheets for c in s.checks if c.status == "fail"}
    return [
        *(f"{motor}: {check} failed, and should hold" for motor, check in failed - EXPECTED),
        *(f"{motor}: {check} holds, and should fail" for motor, check in EXPECTED - failed),
        *(f"{motor}: lacks {effect}, and should not" for motor, effect in missing - MISSING),
        *(f"{motor}: {effect} was not found" for motor, effect in MISSING - missing),
    ]


def main() -> int:
    """Prints the surprises of the output folder named; 1 where there are any."""
    lines = sorted(surprises(read_datasheets(Path(sys.argv[1]))))
    sys.stderr.writelines(f"{line}\n" for line in lines)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
