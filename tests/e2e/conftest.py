"""A bench's folder of two motors, simulated once for all end-to-end tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.__main__ import main


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with `one/` and `two/`, all tests of two gimbal motors; read only."""
    folder = tmp_path_factory.mktemp("bench")
    for seed, name in ((1, "one"), (2, "two")):
        words = [f"output={folder / name}", f"motor_id=gimbal/{name}", f"seed={seed}"]
        assert main(["simulate", "motor=gimbal-5208", *words]) == 0
    return folder
