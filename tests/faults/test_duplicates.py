"""One recording under two names counts once; two recordings that look alike count twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.duplicates import CODE, once
from pipeline.estimation.registry import fit_all
from pipeline.execution.tasks.captures import ReadTask, usable_captures
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.survey import survey
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from tests.unit.io.recordings import META, json_messages, mcap_file

ROWS = 600


def resistance(seed: int, rows: int = ROWS) -> dict[str, np.ndarray]:
    """Six levels on a pair of 1.2 ohm, with noise of a ten-thousandth."""
    noise = np.random.default_rng(seed)
    level = 0.5 * (np.arange(rows) // 100 + 1) * (-1.0) ** (np.arange(rows) // 100)
    return {
        "t_s": 0.01 * np.arange(rows),
        "vab_v": 1.2 * level + noise.normal(0.0, 1e-4, rows),
        "ia_a": level + noise.normal(0.0, 1e-4, rows),
        "temp_winding_degc": 25.0 + 1e-3 * np.arange(rows),
    }


def capture(path: str, columns: dict[str, np.ndarray], **meta: object) -> Capture:
    said = CaptureMeta("m", "resistance", pair="ab", **meta)  # type: ignore[arg-type]
    return Capture(path, path, "unverified", said, (pl.DataFrame(columns),))


def test_the_same_rows_narrowed_the_uncertainty_by_a_root_of_two(tmp_path: Path) -> None:
    """Published: u_a of R at 0.6 of its size, for the capture lay there as CSV and as MCAP.

    The forms differ (other digits, other metadata, other bytes); the rows are the same.
    """
    rows = resistance(1)
    head = "# contract: 1\n# motor_id: 000123\n# test: resistance\n# pair: ab\n# station: north\n"
    body = ",".join(rows) + "\n"
    body += "".join(
        ",".join(f"{values[n]:.9g}" for values in rows.values()) + "\n" for n in range(ROWS)
    )
    (tmp_path / "a.csv").write_text(head + body)
    messages = json_messages({k: float(v[n]) for k, v in rows.items()} for n in range(ROWS))
    said = META | {"test": "resistance", "pair": "ab", "station": "south", "operator": "B"}
    (tmp_path / "b.mcap").write_bytes(mcap_file(messages, metadata=said))
    entries = survey(tmp_path, {}).entries
    assert len(entries) == 2
    captures, findings = usable_captures(ReadTask("000123", str(tmp_path), entries, ReadLimits()))
    assert [c.path for c in captures] == ["b.mcap"]
    (told,) = [f for f in findings if f.code == CODE]
    assert (told.file, told.severity) == ("a.csv", "warning")
    assert "b.mcap" in told.message
    assert "station" in told.message
    both = tuple(replace(captures[0], path=path) for path in ("a", "b"))
    twice, alone = (fit_all(Campaign("m", c), {})[0].best("r_ll_ohm") for c in (both, both[:1]))
    assert twice is not None
    assert alone is not None
    assert twice.u_a < 0.8 * alone.u_a


@pytest.mark.parametrize(
    "change",
    [
        lambda rows: rows,
        lambda rows: {k: np.float32(v).astype(np.float64) for k, v in rows.items()},
        lambda rows: {k: v[20:580] for k, v in rows.items()},
        lambda rows: {k: v for k, v in rows.items() if k != "temp_winding_degc"},
        lambda rows: rows | {"t_s": rows["t_s"] + 1000.0},
        lambda rows: {k: v[:590] for k, v in rows.items()} | {"ib_a": rows["ia_a"][:590]},
    ],
    ids=["copied", "as float32", "cut", "a column less", "another clock", "a column more"],
)
def test_a_copy_is_known_again(change) -> None:  # type: ignore[no-untyped-def]
    rows = resistance(1)
    kept, findings = once([capture("a", rows), capture("b", change(rows), station="x")])
    assert (len(kept), [f.code for f in findings]) == (1, [CODE])
    assert kept[0].tables[0].height == ROWS


def test_recordings_that_look_alike_are_two() -> None:
    """Other noise; another pair with the same thermometer; a part of one in front of another."""
    rows, again = resistance(1), resistance(2)
    other_pair = {"t_s": rows["t_s"], "temp_winding_degc": rows["temp_winding_degc"]}
    other_pair |= {"vbc_v": again["vab_v"], "ib_a": again["ia_a"]}
    mixed = {k: np.concatenate([rows[k][:200], again[k][200:]]) for k in rows}
    quiet = {"t_s": rows["t_s"], "ia_a": np.zeros(ROWS), "vab_v": np.ones(ROWS)}
    captures = [
        capture(str(n), columns)
        for n, columns in enumerate([rows, again, other_pair, mixed, quiet, quiet])
    ]
    assert once(captures) == (tuple(captures), ())


def test_the_verified_of_two_is_used() -> None:
    rows = resistance(1)
    sound = replace(capture("z", rows), integrity="verified")
    kept, _ = once([capture("a", rows), sound])
    assert kept == (sound,)
