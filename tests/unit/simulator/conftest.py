"""Compiled kernels are kept by their own file's date; one that calls another file's is not."""

from pathlib import Path

import pipeline.simulator

PACKAGE = Path(pipeline.simulator.__file__).parent
KERNELS = tuple(path for path in PACKAGE.glob("*.py") if "@njit" in path.read_text())


def pytest_configure() -> None:
    """Forget kernels compiled before the newest of their sources, so that no edit goes untested."""
    newest = max(path.stat().st_mtime for path in KERNELS)
    for kept in (PACKAGE / "__pycache__").glob("*.nb[ic]"):
        if kept.stat().st_mtime < newest:
            kept.unlink(missing_ok=True)
