"""The golden file: every constant and diagnosis of the rig, bench B and the demo.

`python -m tests.golden --output FILE` writes it; `--against FILE` compares today's with a file of
before, prints what differs and returns 1 where anything does. `--sets rig` takes some alone. A
change that should move code and no number is shown to be one so.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.__main__ import THREADS


def main(words: Sequence[str]) -> int:
    """Collects, writes, compares."""
    from tests.golden.collect import SETS, collect, without_diagnoses
    from tests.golden.differences import differences

    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("--output", type=Path, help="file to write")
    parser.add_argument("--against", type=Path, help="file to compare with")
    parser.add_argument("--sets", nargs="*", choices=SETS, default=list(SETS))
    parser.add_argument("--constants", action="store_true", help="no diagnoses")
    chosen = parser.parse_args(words)
    if chosen.output is None and chosen.against is None:
        parser.error("give --output FILE, --against FILE or both")
    before = None if chosen.against is None else json.loads(chosen.against.read_bytes())
    found = collect({name: SETS[name] for name in chosen.sets}, diagnoses=not chosen.constants)
    if chosen.output is not None:
        text = json.dumps(found, indent=1, sort_keys=True, ensure_ascii=False)
        chosen.output.write_text(text + "\n", encoding="utf-8")
    if before is None:
        return 0
    old = {name: before.get(name, {}) for name in chosen.sets}
    lines = list(differences(without_diagnoses(old) if chosen.constants else old, found))
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.write(f"{len(lines)} differences\n")
    return 1 if lines else 0


if __name__ == "__main__":
    for name in THREADS:  # before anything imports numpy
        os.environ.setdefault(name, "1")
    sys.exit(main(sys.argv[1:]))
