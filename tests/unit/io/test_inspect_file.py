"""`inspect` on a stranger's files: what is in them, and a source map that works once finished."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import describe
from pipeline.io.maps.map_file import load_source_maps, parse_source_file
from pipeline.records.errors import CaptureError
from pipeline.settings import configuration_folder
from pipeline.stages.inspect_file import render
from tests.unit.io.recordings import META, json_messages, mcap_file, small_capture

STRANGER = (
    "Bench 7;recorded by K;;;\n"
    "Time (ms);Speed [RPM];i_q;phase_current_a;state\n"
    "0,0;100,5;1,5;2;ok\n"
    "1,0;101;1,5;2,5;ok\n"
    "2,0;102;1,5;2,5;ok\n"
)


def test_a_strange_table_is_understood_and_its_starter_map_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(STRANGER)
    report = describe(path, {}, {"unit.i_q": "mA"})
    assert report.form == "text"
    (stream,) = report.streams
    assert {seen.name: (seen.column, seen.unit) for seen in stream.fields} == {
        "Time (ms)": ("t_s", "ms"),
        "Speed [RPM]": ("omega_mech_rad_s", "rpm"),
        "i_q": ("iq_a", "mA"),
        "phase_current_a": ("ia_a", None),
    }
    assert stream.fields[-1].question is not None
    text = render(report)
    assert "spin_down: enough" in text
    assert "holding_current: needs theta_mech_rad" in text
    finished = report.starter.replace("# motor_id: the serial number", "motor_id: m1")
    finished = finished.replace("# test: one of the contract's", "test: spin_down")
    source = parse_source_file(finished.encode(), "bench")["bench"]
    found = survey(tmp_path, {"bench": source})
    (table,) = read_capture(tmp_path, found.entries[0]).tables
    np.testing.assert_allclose(table["t_s"], [0, 1e-3, 2e-3])
    np.testing.assert_allclose(table["omega_mech_rad_s"], np.array([100.5, 101, 102]) * np.pi / 30)
    np.testing.assert_allclose(table["iq_a"], 1.5e-3)
    assert "ia_a" not in table.columns  # its unit is asked for, not assumed


def test_a_table_without_header_gets_numbered_names(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text("0.0\t1.5\n0.1\t1.6\n")
    report = describe(path, {})
    assert [seen.name for seen in report.streams[0].fields] == ["column_1", "column_2"]
    parse_source_file(report.starter.encode(), "bench")["bench"]


def test_a_strange_mcap_gets_topics_fields_and_a_map_to_start_from(tmp_path: Path) -> None:
    rows = json_messages([{"motor": {"Iq": n, "RPM": 60.0 * n, "odd": 1}} for n in range(5)])
    path = tmp_path / "x.mcap"
    path.write_bytes(mcap_file(rows, metadata={"bench": "7"}))
    report = describe(path, {})
    assert report.streams[0].rate_hz == pytest.approx(1000)
    text = report.starter.replace("# motor_id: the serial number", "motor_id: m1")
    source = parse_source_file(
        text.replace("# test: one of the contract's", "test: drive").encode(), "b"
    )["b"]
    found = survey(tmp_path, {"b": source})
    (table,) = read_capture(tmp_path, found.entries[0]).tables
    np.testing.assert_allclose(table["omega_mech_rad_s"], 2 * np.pi * np.arange(5.0))
    np.testing.assert_allclose(table["t_s"], np.arange(5) * 1e-3)


def test_a_capture_of_the_contract_needs_no_map(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(small_capture())
    report = describe(path, {})
    assert dict(report.metadata) == META
    assert report.starter == ""
    assert "no source map is needed" in render(report)
    assert report.columns == {"t_s", "iq_a", "theta_mech_rad"}


SPIN = "# contract: 1\n# motor_id: 000123\n# test: spin_down\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SPIN + "t_s;omega_mech_rad_s\n0,0;100,5\n0,1;99,5\n", "separated by ';'"),
        (SPIN + "t_s,omega_mech_rad_s\ns,rad/s\n0.0,100.5\n0.1,99.5\n", "holds 's'"),
    ],
)
def test_a_capture_that_run_would_refuse_is_not_called_sound(
    tmp_path: Path, text: str, says: str
) -> None:
    """The fault is that of `run`, and the map to start from reads the file once it is named."""
    path = tmp_path / "x.csv"
    path.write_text(text)
    entry = survey(tmp_path, {}).entries[0]
    with pytest.raises(CaptureError) as refused:
        read_capture(tmp_path, entry)
    report = describe(path, {})
    assert str(refused.value) in report.faults
    assert says in render(report)
    assert "run` refuses it as it stands" in render(report)
    assert "# source: NAME" in report.starter
    path.write_text("# source: bench\n" + text)
    sources = {"bench": parse_source_file(report.starter.encode(), "bench")["bench"]}
    (table,) = read_capture(tmp_path, survey(tmp_path, sources).entries[0]).tables
    assert table["omega_mech_rad_s"].to_list() == [100.5, 99.5]
    assert table["t_s"].to_list() == [0.0, 0.1]


@pytest.mark.parametrize(
    ("header", "code", "field"),
    [
        ("t_s,omega_mech_rpm", "unknown_unit", "'omega_mech_rpm': {column: omega_mech_rad_s, unit"),
        ("t_ms,omega_mech_rad_s", "unknown_unit", "'t_ms': {column: t_s, unit: 'ms'}"),
        ("t,omega_mech", "missing_column", "'omega_mech': {column: omega_mech_rad_s"),
    ],
)
def test_a_column_that_run_does_not_take_is_a_fault_with_a_map_to_start_from(
    tmp_path: Path, header: str, code: str, field: str
) -> None:
    """It was called in the form of the contract, and `run` refused it."""
    path = tmp_path / "x.csv"
    path.write_text(f"{SPIN}{header}\n0,100\n1,99\n2,98\n")
    with pytest.raises(CaptureError) as refused:
        read_capture(tmp_path, survey(tmp_path, {}).entries[0])
    assert refused.value.code == code
    report = describe(path, {})
    (fault,) = report.faults
    assert fault.startswith(refused.value.message)
    assert field in report.starter
    text = render(report)
    assert "`run` refuses it as it stands" in text
    assert "tests, once a source map reads it:" in text


def test_a_field_of_a_message_that_run_does_not_take_is_a_fault_as_well(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    said = {"contract": "1", "motor_id": "m", "test": "spin_down"}
    messages = json_messages([{"t_s": n, "omega_mech_rpm": 1.0} for n in range(3)])
    path.write_bytes(mcap_file(messages, metadata=said))
    report = describe(path, {})
    assert any("'omega_mech_rpm' is not in the contract's unit" in one for one in report.faults)
    assert "`source: NAME` in its metadata or NAME.meta.yaml" in report.starter


def test_metadata_that_run_would_refuse_is_named(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(SPIN.replace("spin_down", "dance") + "t_s,omega_mech_rad_s\n0,1\n1,2\n")
    assert "the test 'dance' is unknown" in render(describe(path, {}))


def test_a_capture_that_lacks_the_contract_key_alone_is_told_so(tmp_path: Path) -> None:
    """It needs no source map, and `run` uses it as soon as the key is there."""
    path = tmp_path / "x.csv"
    rows = "t_s,omega_mech_rad_s\n0,1\n1,2\n"
    path.write_text(SPIN.replace("# contract: 1\n", "") + rows)
    assert survey(tmp_path, {}).others == ("x.csv",)
    report = describe(path, {})
    (fault,) = report.faults
    assert "`run` takes it for no capture" in fault and "`contract: 1`" in fault
    assert report.starter == ""
    (tmp_path / "x.meta.yaml").write_text("contract: 1\n")
    assert describe(path, {}).faults == ()
    assert len(survey(tmp_path, {}).entries) == 1


def test_a_strangers_table_is_told_both_ways_in(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(STRANGER)
    text = render(describe(path, {}))
    assert "or finish the source map below" in text and "a source map to start from" in text


def test_what_a_recognised_file_lacks_is_named(tmp_path: Path) -> None:
    """A shipped map knows a scope's columns and not whose motor it was."""
    path = tmp_path / "x.csv"
    path.write_text((Path(__file__).parent / "samples" / "rigol.csv").read_text())
    maps = load_source_maps(configuration_folder() / "source")
    assert "nothing states motor_id" in render(describe(path, maps))
    (tmp_path / "x.meta.yaml").write_text("motor_id: m\ntest: drive\n")
    assert describe(path, maps).faults == ()


def test_a_table_in_latin_1_is_read_and_its_map_says_so(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes("Zeit (s);temp_winding (\xb0C)\n0;20\n1;21,5\n".encode("latin-1"))
    report = describe(path, {})
    (fault,) = report.faults
    assert "nothing states `contract`" in fault
    assert "encoding: 'latin-1'" in report.starter
    assert [seen.first for seen in report.streams[0].fields] == [0.0, 20.0]
    finished = report.starter.replace("# 'Zeit (s)': {column: , unit: }", "'Zeit (s)': t_s")
    finished = finished.replace("# motor_id: the serial number", "motor_id: m1")
    finished = finished.replace("# test: one of the contract's", "test: drive")
    finished = finished.replace("time:\n  from: increment\n  increment_s: 1.0e-3", "#")
    sources = {"bench": parse_source_file(finished.encode(), "bench")["bench"]}
    (table,) = read_capture(tmp_path, survey(tmp_path, sources).entries[0]).tables
    assert table["t_s"].to_list() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("text", "values"),
    [("0.5\n1.5\n2.5\n", [0.5, 1.5, 2.5]), ("I\n0.5\n1.5\n2.5\n", [0.5, 1.5, 2.5])],
)
def test_one_column_of_numbers_is_a_table(tmp_path: Path, text: str, values: list[float]) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    (stream,) = describe(path, {}).streams
    assert (stream.rows, stream.fields[0].first) == (3, values[0])


def test_a_cut_recording_gets_no_empty_map(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(small_capture()[:700])
    assert describe(path, {}).starter == ""


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"\x89MCAP0\r\n1234", "fault:"),
        (small_capture()[:700], "fault:"),
        (bytes(range(256)) * 4, "binary"),
        (b"", "no table of numbers"),
        (b"just some words\nand more\n", "no table of numbers"),
        (b"{\n}", "no table of numbers"),
        (b'a,b\n1,"2\n', "x"),
    ],
)
def test_any_bytes_are_described_and_never_fail(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    assert says in render(describe(path, {}))
