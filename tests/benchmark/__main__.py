"""The command `python -m tests.benchmark`."""

from __future__ import annotations

import os
import sys

from pipeline.__main__ import THREADS
from pipeline.records.errors import UsageError

if __name__ == "__main__":
    for name in THREADS:  # before anything imports numpy
        os.environ.setdefault(name, "1")
    from tests.benchmark.command import main, options

    try:
        sys.stdout.write(main(options(sys.argv[1:])))
    except UsageError as error:
        sys.exit(f"error: {error}")
