"""Forms that are no text tables, through their shipped maps: right numbers, and damage refused."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.map_file import load_source_maps
from pipeline.io.readers.moteus_ld import metadata
from pipeline.io.readers.moteus_ld import read as read_sweep
from pipeline.io.readers.npz import read as read_archive
from pipeline.records.errors import CaptureError

CONF = Path(pipeline.__file__).parents[1] / "conf" / "source"
SWEEP = {
    "params": {"poles": 14},
    "raw": {
        "2.0": [{"omega": 70.0, "y": 0.9}, {"omega": -70.0, "y": -0.9}],
        "-2.0": [{"omega": 140.0, "y": 1.6}],
    },
}


def one(folder: Path):
    found = survey(folder, load_source_maps(CONF))
    assert found.findings == ()
    (entry,) = found.entries
    return read_capture(folder, entry)


def archive(**arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def test_a_sweep_of_d_current_is_rows_of_rising_level(tmp_path: Path) -> None:
    """Electrical speed over seven pole pairs; levels -2 A, 2 A, 2 A."""
    (tmp_path / "ld_mj5208.json").write_text(json.dumps(SWEEP, indent=1))
    capture = one(tmp_path)
    assert (capture.meta.motor_id, capture.meta.pole_pairs) == ("mj5208", 7)
    rows = capture.arrays("id_a", "omega_mech_rad_s", "vq_v")
    assert rows["id_a"].tolist() == [-2.0, 2.0, 2.0]
    assert rows["omega_mech_rad_s"].tolist() == pytest.approx([20.0, -10.0, 10.0])
    assert rows["vq_v"].tolist() == [1.6, -0.9, 0.9]


def test_a_map_of_complex_flux_is_laid_out_row_after_row(tmp_path: Path) -> None:
    current = np.array([[1.0 + 2.0j, 3.0 + 4.0j]])
    flux = np.array([[0.1 + 0.2j, 0.3 + 0.4j]])
    (tmp_path / "baldor_map.npz").write_bytes(archive(i_s_dq=current, psi_s_dq=flux))
    rows = one(tmp_path).arrays("id_a", "iq_a", "psi_d_wb", "psi_q_wb")
    assert {name: values.tolist() for name, values in rows.items()} == {
        "id_a": [1.0, 3.0],
        "iq_a": [2.0, 4.0],
        "psi_d_wb": [0.1, 0.3],
        "psi_q_wb": [0.2, 0.4],
    }


@pytest.mark.parametrize(
    "data",
    [b"", b"{", b"[]", b'{"raw": 3}', b'{"raw": {"1": [{"omega": 1}]}}', b'{"raw": {"x": [{}]}}'],
)
def test_a_damaged_sweep_is_refused(data: bytes) -> None:
    with pytest.raises(CaptureError):
        read_sweep(data)


@pytest.mark.parametrize("poles", [13, 0, -2, "14", None])
def test_poles_that_are_no_even_number_are_not_taken(poles: object) -> None:
    assert metadata(json.dumps({"raw": {}, "params": {"poles": poles}}).encode()) == {}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PK\x03\x04 cut short",
        archive(a=np.zeros(3))[:-40],
        archive(a=np.zeros(3), b=np.zeros(4)),
        archive(a=np.array([{"an": "object"}], dtype=object)),
    ],
    ids=["empty", "cut head", "cut tail", "lengths", "pickle"],
)
def test_an_archive_that_cannot_be_one_table_is_refused(data: bytes) -> None:
    with pytest.raises(CaptureError):
        read_archive(data)
