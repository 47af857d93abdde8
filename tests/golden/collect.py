"""Constants and diagnoses of folders of captures, as the commands write them."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pipeline.__main__ import main

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"
SETS = {"demo": ROOT / "data" / "demo", "rig": SHARED / "rig", "benchB": SHARED / "benchB"}
"""Folders of captures by name; those that this project did not write lie beside the checkout."""
DONE = (0, 1, 3, 4)
"""Exit codes of a command that did its work, whatever it found."""
Golden = dict[str, Any]


def collect(sets: dict[str, Path], *, diagnoses: bool = True) -> Golden:
    """By set and motor: status, `constants` (value, u, status) and `diagnosis`.

    Raises FileNotFoundError where a set is not there, RuntimeError where a command breaks down.
    """
    return {name: _set(folder, diagnoses) for name, folder in sets.items()}


def without_diagnoses(golden: Golden) -> Golden:
    """The same with constants and checks alone."""
    return {
        name: {
            motor: {key: part for key, part in found.items() if key != "diagnosis"}
            for motor, found in motors.items()
        }
        for name, motors in golden.items()
    }


def _set(folder: Path, diagnoses: bool) -> Golden:
    if not folder.is_dir():
        raise FileNotFoundError(folder)
    with TemporaryDirectory() as place:
        said = [f"input={folder}", f"output={place}"]
        _command("run", *said, "report=false", "recordings=false")
        if diagnoses:
            _command("diagnose", *said)
        output = Path(place)
        found = {path.stem: _sheet(_document(path)) for path in _files(output / "datasheets")}
        for path in _files(output / "diagnosis"):
            found[path.stem]["diagnosis"] = _diagnosis(_document(path))
    return found


def _command(*words: str) -> None:
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as errors:
        code = main(list(words))
    if code not in DONE:
        raise RuntimeError(f"{' '.join(words)}: exit {code}: {errors.getvalue()}")


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.json"))


def _document(path: Path) -> Any:
    return json.loads(path.read_bytes())


def _sheet(sheet: Any) -> Golden:
    constants = {
        name: {key: one[key] for key in ("value", "u", "status")}
        for name, one in sheet["constants"].items()
    }
    checks = {one["name"]: one["status"] for one in sheet["checks"]}
    return {"status": sheet["status"], "constants": constants, "checks": checks}


def _diagnosis(document: Any) -> Golden:
    """Verdict, names in their order with their sizes, and the error of each step."""
    missing = document["missing"]
    sizes = {
        one["effect"]: {name: [p["value"], p["u"]] for name, p in one["parameters"].items()}
        for one in document["ranking"]
        if one["effect"] in missing
    }
    steps = [[step["effects"], step["held_out"]] for step in document["ladder"]]
    return {
        "verdict": document["verdict"],
        "missing": missing,
        "sizes": sizes,
        "unknown": document["unknown"],
        "ladder": steps,
    }
