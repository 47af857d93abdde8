"""Forms that recorders and tools write: the same rows out of each, and damage refused by name."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.columns import to_frame
from pipeline.io.maps.map_file import load_source_maps, parse_source_file
from pipeline.io.tables import foreign
from pipeline.io.tables.foreign import find_reader, readers
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from pipeline.settings import configuration_folder

T_S = np.arange(0.0, 0.5, 0.01)
SPEED = 100.0 - 20.0 * T_S
CURRENT = np.sin(3.0 * T_S)


def parquet() -> bytes:
    buffer = io.BytesIO()
    frame = pl.DataFrame({"time": T_S, "speed": SPEED, "iq": CURRENT, "note": ["x"] * T_S.size})
    frame.write_parquet(buffer)
    return buffer.getvalue()


def npy() -> bytes:
    buffer = io.BytesIO()
    rows = np.zeros(T_S.size, dtype=[("time", "f8"), ("speed", "f4"), ("iq", "f8")])
    rows["time"], rows["speed"], rows["iq"] = T_S, SPEED, CURRENT
    np.save(buffer, rows)
    return buffer.getvalue()


def npz() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, time=T_S, speed=SPEED, iq=CURRENT)
    return buffer.getvalue()


def mat() -> bytes:
    from scipy.io import savemat

    buffer = io.BytesIO()
    log = {"time": T_S, "speed": SPEED, "iq": CURRENT, "unit": "rad/s"}
    savemat(buffer, {"log": log, "gain": 3.0, "name": "bench"})
    return buffer.getvalue()


def hdf5() -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name, values in {"time": T_S, "speed": SPEED, "iq": CURRENT[:, None]}.items():
            file[f"log/{name}"] = values
        file["log/about"] = "a bench"
        file["log/away"] = h5py.ExternalLink("/etc/hostname", "/x")
        file["map"] = np.zeros((4, 5))
    return buffer.getvalue()


def mat73() -> bytes:
    return b"MATLAB 7.3 MAT-file".ljust(512, b"\0") + hdf5()


def tdms() -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    clock = {"wf_increment": 0.01, "wf_start_offset": 0.0}
    with TdmsWriter(buffer) as writer:
        channels = [
            ChannelObject("log", name, values, properties=clock)
            for name, values in (("speed", SPEED), ("iq", CURRENT))
        ]
        writer.write_segment(channels)
    return buffer.getvalue()


def mdf4() -> bytes:
    why = "asammdf brings pandas, which slows every start: installed by hand to run this test"
    pytest.importorskip("asammdf", reason=why)
    from asammdf import MDF, Signal

    buffer = io.BytesIO()
    with MDF(version="4.10") as file:
        units = {"speed": "rad/s", "iq": "A"}
        file.append(
            [Signal(v, T_S, unit=units[n], name=n) for n, v in (("speed", SPEED), ("iq", CURRENT))]
        )
        slow = T_S[::10]
        file.append([Signal(20.0 + slow, slow, unit="degC", name="temp")])
        file.save(buffer)
    return buffer.getvalue()


def wpilog(speed: str = "speed", current: str = "iq", units: tuple[str, str] = ("", "")) -> bytes:
    """Two entries of doubles, one of texts, one of arrays; the last is closed."""
    parts = [b"WPILOG", struct.pack("<HI", 0x0100, 3), b"bot"]

    def record(entry: int, time_us: int, payload: bytes) -> None:
        # one byte of entry, two of size, four of time
        parts.append(struct.pack("<BBHI", 0b0110100, entry, len(payload), time_us) + payload)

    def start(entry: int, name: str, kind: str) -> None:
        unit = dict(zip((speed, current), units, strict=True)).get(name, "")
        parts = (name.encode(), kind.encode(), unit.encode())
        text = b"".join(struct.pack("<I", len(t)) + t for t in parts)
        record(0, 0, struct.pack("<BI", 0, entry) + text)

    for entry, (name, kind) in enumerate(
        [(speed, "double"), (current, "double"), ("state", "string"), ("both", "double[]")], start=1
    ):
        start(entry, name, kind)
    for t, w, i in zip(T_S, SPEED, CURRENT, strict=True):
        at = round(t * 1e6)
        record(1, at, struct.pack("<d", w))
        record(2, at, struct.pack("<d", i))
        record(3, at, b"running")
        record(4, at, struct.pack("<2d", w, i))
    record(0, 10**6, struct.pack("<BI", 1, 4))
    return b"".join(parts)


FORMS = {
    "parquet": (parquet, "", "time", "parquet"),
    "npy": (npy, "", "time", "npy"),
    "npz": (npz, "", "time", "npz"),
    "mat": (mat, "log.", "time", "mat"),
    "hdf5": (hdf5, "log/", "time", "h5"),
    "mat73": (mat73, "log/", "time", "mat"),
    "tdms": (tdms, "log/", "time", "tdms"),
    "mdf4": (mdf4, "", "time", "mf4"),
    "wpilog": (wpilog, "", "timestamp", "wpilog"),
}
MAP = """
about: a test
recognise: {{files: ['run.{ending}']}}
reader: {reader}
fields:
  {prefix}{time}: {{column: t_s, unit: s}}
  {prefix}speed: {{column: omega_mech_rad_s, unit: rad/s}}
  {prefix}iq: {{column: iq_a, unit: A}}
metadata: {{motor_id: M1, test: drive}}
"""


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_rows(form: str, tmp_path: Path) -> None:
    make, prefix, time, ending = FORMS[form]
    reader = "mat" if form == "mat73" else form
    source = parse_source_file(
        MAP.format(ending=ending, reader=reader, prefix=prefix, time=time).encode(), "bench"
    )["bench"]
    (tmp_path / f"run.{ending}").write_bytes(make())
    found = survey(tmp_path, {"bench": source})
    assert found.findings == ()
    (entry,) = found.entries
    capture = read_capture(tmp_path, entry)
    assert capture.integrity == "unverified"
    rows = capture.arrays("t_s", "omega_mech_rad_s", "iq_a")
    assert rows["t_s"] == pytest.approx(T_S, abs=1e-9)
    assert rows["omega_mech_rad_s"] == pytest.approx(SPEED, rel=1e-6)
    assert rows["iq_a"] == pytest.approx(CURRENT, abs=1e-12)


# asammdf's own object complains of itself when its constructor fails
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("form", FORMS)
def test_a_file_that_is_cut_off_or_another_is_refused(form: str) -> None:
    """Or gives less, never another number: every cut at a tenth of the file."""
    make, *_ = FORMS[form]
    reader = find_reader("mat" if form == "mat73" else form)
    whole, true = make(), {"speed": SPEED, "iq": CURRENT}
    for share in range(10):
        try:
            tables = reader.read(whole[: share * len(whole) // 10])
        except CaptureError as error:
            assert error.remedy
            continue
        for table in tables:
            for name, values in table.fields.items():
                for known in (wave for ending, wave in true.items() if name.endswith(ending)):
                    assert values == pytest.approx(known[: values.size], rel=1e-6)
    with pytest.raises(CaptureError):
        reader.read(b"t_s,iq_a\n0,1\n")


def test_instants_are_seconds_from_the_first_and_null_is_nan() -> None:
    from datetime import UTC, datetime, timedelta

    begun = datetime(2026, 1, 2, tzinfo=UTC)
    frame = pl.DataFrame(
        {"at": [begun, begun + timedelta(milliseconds=1500)], "n": [None, 3], "s": ["a", "b"]}
    )
    buffer = io.BytesIO()
    frame.write_parquet(buffer)
    (table,) = find_reader("parquet").read(buffer.getvalue())
    assert set(table.fields) == {"at", "n"}
    assert table.fields["at"].tolist() == [0.0, 1.5]
    assert np.isnan(table.fields["n"][0])


def test_columns_of_a_plain_array_are_numbered() -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([[1.0, 2.0], [3.0, 4.0]]))
    (table,) = find_reader("npy").read(buffer.getvalue())
    assert {n: v.tolist() for n, v in table.fields.items()} == {"0": [1.0, 3.0], "1": [2.0, 4.0]}


def test_objects_are_never_unpickled() -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(CaptureError, match="pickle"):
        find_reader("npy").read(buffer.getvalue())


def test_groups_of_other_rates_are_tables_of_their_own() -> None:
    found = {name: t.rows for t in find_reader("mdf4").read(mdf4()) for name in t.fields}
    assert (found["speed"], found["temp"]) == (T_S.size, T_S[::10].size)


def test_a_log_of_entries_tells_arrays_apart_and_leaves_texts() -> None:
    tables = {table.name: table for table in find_reader("wpilog").read(wpilog())}
    assert set(tables) == {"speed", "iq", "both"}
    assert tables["both"].fields["both.1"] == pytest.approx(CURRENT)


def test_a_tdms_that_lacks_its_end_is_refused_though_its_library_reads_on() -> None:
    """NpTDMS logs a warning and gives what there is; nothing is said on standard error."""
    data = tdms()
    with pytest.raises(CaptureError, match="less data than expected") as refused:
        find_reader("tdms").read(data[: len(data) - 40])
    whole = CURRENT.size - 5
    assert refused.value.code == "truncated"
    assert refused.value.rows == (whole, whole)
    assert f"{whole} samples of each channel are whole, {0.01 * whole:.9g} s" in str(refused.value)


def test_complex_numbers_are_no_column() -> None:
    """Their imaginary part was dropped in silence."""
    source = parse_source_file(b"fields: {t: t_s, i: iq_a}", "x")["x"]
    table = RawTable("npy", {"t": np.arange(3.0), "i": np.array([1j, 2j, 3j])})
    with pytest.raises(CaptureError, match="complex"):
        to_frame(table, source)


def test_a_log_of_sysid_is_read_by_its_map(tmp_path: Path) -> None:
    """Entries of any motor and routine, each on its clock; turns become radians."""
    names, units = ("velocity-wheel-shooter", "voltage-wheel-shooter"), ("Rotation per Second", "V")
    capture = _by_the_sysid_map(tmp_path, wpilog(*names, units))
    assert (capture.meta.test, capture.meta.voltage_kind) == ("drive", "commanded")
    rows = capture.arrays("omega_mech_rad_s", "vq_v")
    np.testing.assert_allclose(rows["omega_mech_rad_s"], SPEED * 2 * np.pi)
    np.testing.assert_allclose(rows["vq_v"], CURRENT)
    for unit, words in (("Meter per Second", "Meter per Second"), ("", "states no unit")):
        with pytest.raises(CaptureError, match=words):
            _by_the_sysid_map(tmp_path, wpilog(*names, (unit, "Volt")))


def _by_the_sysid_map(folder: Path, log: bytes) -> Capture:
    """Robots name their logs by the hour."""
    (folder / "FRC_20240301_181530.wpilog").write_bytes(log)
    (folder / "FRC_20240301_181530.meta.yaml").write_text("motor_id: m\n")
    found = survey(folder, load_source_maps(configuration_folder() / "source"))
    return read_capture(folder, found.entries[0])


def test_two_motors_in_a_log_are_refused_or_a_capture_each(tmp_path: Path) -> None:
    """What the map takes for one column may not be several motors; `fields` of a part name each."""
    log = wpilog("voltage-left-drive", "voltage-right-drive", ("Volt", "Volt"))
    with pytest.raises(CaptureError, match="2 tables of the file become vq_v"):
        _by_the_sysid_map(tmp_path, log)
    source = parse_source_file(
        b"""
recognise: {files: ['*.wpilog']}
reader: wpilog
fields: {timestamp: t_s}
metadata: {test: drive}
captures:
  - {motor_id: left, fields: {'voltage-left-*': {column: vq_v, unit: row}}}
  - {motor_id: right, fields: {'voltage-right-*': {column: vq_v, unit: row}}}
""",
        "robot",
    )["robot"]
    found = survey(tmp_path, {"robot": source})
    volts = {
        capture.meta.motor_id: capture.arrays("vq_v")["vq_v"]
        for capture in (read_capture(tmp_path, entry) for entry in found.entries)
    }
    np.testing.assert_allclose(volts["left"], SPEED)
    np.testing.assert_allclose(volts["right"], CURRENT)


def test_a_library_that_is_missing_is_named_with_its_extra(monkeypatch) -> None:
    def gone(name: str):
        raise ImportError(name)

    whole = hdf5()
    monkeypatch.setattr(foreign.importlib, "import_module", gone)
    with pytest.raises(CaptureError, match=r"takes h5py.*motor-datasheets\[hdf5\]"):
        readers()["hdf5"].read(whole)
