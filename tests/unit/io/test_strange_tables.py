"""Text tables of benches abroad, and clocks that are written as date and time of day."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import InspectReport, describe
from pipeline.io.inspection.file_names import name_patterns
from pipeline.io.inspection.labels import read_label
from pipeline.io.inspection.proposals import propose
from pipeline.io.maps.map_file import parse_source_file
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.capture import Capture
from pipeline.records.errors import UsageError


def looked(folder: Path, name: str, data: bytes, **answers: str) -> tuple[InspectReport, Capture]:
    """What `inspect` says of a file, and the capture that its map makes of it."""
    (folder / name).write_bytes(data)
    report = describe(folder / name, {}, {"motor_id": "M1", "test": "drive", **answers})
    maps = parse_source_file(report.starter.encode(), "found")
    return report, read_capture(folder, survey(folder, maps).entries[0])


def test_a_table_in_shift_jis(tmp_path: Path) -> None:
    """Its letters have bytes that are ASCII, and its unit a dot that only Japanese text has."""
    data = "電流[A],トルク[mN・m]\r\n-2.0,-187.1\r\n0.0,0.4\r\n2.0,187.5\r\n".encode("cp932")
    report, capture = looked(tmp_path, "static.csv", data, test="torque_table", **{
        "column.電流_A": "iq_a"})  # fmt: skip
    assert report.columns == {"iq_a", "torque_shaft_nm"}
    torque = capture.arrays("torque_shaft_nm", masked=False)["torque_shaft_nm"]
    np.testing.assert_allclose(torque, [-0.1871, 0.0004, 0.1875])


def test_a_table_in_gb18030(tmp_path: Path) -> None:
    head = "时间(s),转速(rpm),转矩(N·m),q轴电流(A)\n"
    rows = "".join(f"{0.01 * k:.2f},600,0.{k},{k}\n" for k in range(9))
    report, capture = looked(tmp_path, "map.csv", (head + rows).encode("gb18030"))
    assert report.columns == {"t_s", "omega_mech_rad_s", "torque_shaft_nm", "iq_a"}
    speed = capture.arrays("omega_mech_rad_s", masked=False)["omega_mech_rad_s"]
    np.testing.assert_allclose(speed, 20.0 * np.pi)


@pytest.mark.parametrize(
    ("separator", "clock"),
    [
        (",", "2024-03-01 23:59:{:06.3f}"),
        (",", "2024-03-01T23:59:{:06.3f}"),
        (",", "01.03.2024 23:59:{:06.3f}"),
        (",", "3/1/2024 11:59:{:06.3f} PM"),
        (";", "01.03.2024 23:59:{:06.3f}"),
        (",", "23:59:{:06.3f}"),
    ],
)
def test_a_clock_of_date_and_time(tmp_path: Path, separator: str, clock: str) -> None:
    """Seconds from the first row, with the decimal comma that the other numbers have."""
    lines = [f"Timestamp{separator}iq [A]"]
    for k in range(40):
        row = f"{clock.format(0.25 * k + 1)}{separator}{0.5 * k}"
        lines.append(row.replace(".", ",") if separator == ";" and "." in row else row)
    if separator == ";":
        lines = [line.replace("01,03,2024", "01.03.2024") for line in lines]
    report, capture = looked(tmp_path, "log.csv", "\n".join([*lines, ""]).encode())
    assert report.columns == {"t_s", "iq_a"}
    time = capture.arrays("t_s", masked=False)["t_s"]
    np.testing.assert_allclose(time, 0.25 * np.arange(40), atol=1e-9)


def test_a_time_of_day_goes_on_past_midnight(tmp_path: Path) -> None:
    seconds = 86395.0 + 0.5 * np.arange(40)
    clocks = [f"{s // 3600 % 24:02.0f}:{s // 60 % 60:02.0f}:{s % 60:04.1f}" for s in seconds]
    lines = ["Uhrzeit,iq [A]", *(f"{c},{k}" for k, c in enumerate(clocks)), ""]
    _, capture = looked(tmp_path, "log.csv", "\n".join(lines).encode(), **{"column.Uhrzeit": "t_s"})
    time = capture.arrays("t_s", masked=False)["t_s"]
    np.testing.assert_allclose(time, seconds - seconds[0], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "column", "unit"),
    [
        ("battery_V", "vdc_v", "V"),
        ("iq_actual_mA", "iq_a", "mA"),
        ("tick_us", "t_s", "us"),
    ],
)
def test_a_unit_at_the_end_of_a_name_says_what_it_is_of(name: str, column: str, unit: str) -> None:
    found = read_label(name)
    assert (found.columns[:1], found.unit) == ((column,), unit)


@pytest.mark.parametrize("name", ["phase_A", "cob_id", "sensor_V", "gain_s"])
def test_a_letter_at_the_end_of_a_name_may_be_no_unit(name: str) -> None:
    assert read_label(name).columns == ()


@pytest.mark.parametrize(
    ("name", "beside", "columns", "unit"),
    [
        ("current_in_a", (), ("idc_a",), "A"),
        ("input_voltage_v", (), ("vdc_v",), "V"),
        ("current_motor_a", (), ("iq_a", "ia_a", "idc_a"), "A"),
        ("current_a", ("current_b",), ("ia_a",), None),
        ("phase_current_a", (), ("ia_a",), None),
    ],
)
def test_a_letter_is_the_unit_where_no_other_phase_is_beside_it(
    name: str, beside: tuple[str, ...], columns: tuple[str, ...], unit: str | None
) -> None:
    """The log of a speed controller had its motor's current as that of a lone phase."""
    found = read_label(name, beside=(name, *beside))
    assert (found.columns, found.unit) == (columns, unit)


def test_a_number_of_the_row_is_no_clock() -> None:
    fields = {"Punkt": np.arange(1.0, 31.0), "Iq [A]": np.arange(30.0) % 5 - 2.0}
    assert [one.column for one in propose(RawTable("csv", fields), {})] == [None, "iq_a"]


@pytest.mark.parametrize(("clock", "test"), [((), "torque_table"), (("t_s",), "torque_map")])
def test_a_map_without_a_clock_is_a_table(clock: tuple[str, ...], test: str) -> None:
    columns = frozenset({"iq_a", "torque_shaft_nm", *clock})
    names = name_patterns(["Kennfeld_M17.csv"], columns=columns)
    assert names.values["test"] == {"Kennfeld": test}


def test_a_duty_cycle_is_no_angle_and_joints_are_known_in_their_group() -> None:
    k = np.arange(60.0)
    waves = {"j1/duty_cycle": np.cos(0.7 * k), "j1/current_A": np.sin(k)}
    fields = {"time_ms": k, **waves, "j1/rpm": k}
    columns = [one.column for one in propose(RawTable("csv", fields), {})]
    assert columns == ["t_s", None, None, "omega_mech_rad_s"]


def test_fields_of_one_group_are_known_by_their_own_names() -> None:
    """And what a form states of a channel's unit is taken."""
    fields = {"run/t_s": np.arange(30.0), "run/n": 0.1 * np.arange(30.0) ** 2}
    seen = propose(RawTable("run", fields, units=(("run/n", "1/min"),)), {})
    assert [(one.column, one.unit) for one in seen] == [("t_s", None), ("omega_mech_rad_s", "rpm")]


def test_a_clock_from_1970_has_its_unit_from_its_size() -> None:
    rng = np.random.default_rng(3)
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        clock = np.round((1.7096e9 + 0.01 * np.arange(60.0)) / size, 6)
        seen = propose(RawTable("csv", {"timestamp": clock, "x": rng.normal(size=60)}), {})
        assert (seen[0].column, seen[0].unit, seen[0].question) == ("t_s", unit, None)


def test_stamps_of_joint_states_are_not_taken_for_the_clock_of_the_log() -> None:
    """The nanoseconds of a stamp start again each second; the file's log clock does not."""
    nanoseconds = (np.arange(300) * 10_000_000) % 1_000_000_000
    fields = {"header.stamp.nanosec": nanoseconds, "position": np.sin(np.arange(300) / 20.0)}
    log = (np.arange(300) * 10_000_000).astype(np.uint64)
    seen = propose(RawTable("/joint_states", fields, log, joint_state=True), {})
    assert [one.column for one in seen] == [None, "theta_mech_rad"]


def test_a_name_that_ends_in_rpm_is_in_rpm() -> None:
    """The telemetry of an ESC: the word is the quantity and its unit."""
    label = read_label("esc_rpm")
    assert (label.columns, label.unit) == (("omega_mech_rad_s",), "rpm")
    assert read_label("rpm_limit_source").unit is None


@pytest.mark.parametrize(
    ("text", "unit"), [("Iq (A pk)", "A"), ("Moment [cNm]", "N·cm"), ("M [cN·m]", "N·cm")]
)
def test_units_that_benches_write(text: str, unit: str) -> None:
    assert read_label(text).unit == unit


def test_per_unit_columns_are_asked_for_their_base(tmp_path: Path) -> None:
    data = b"time_s,iq_pu,vq_pu\n" + b"".join(b"%d,0.5,0.25\n" % k for k in range(9))
    report, capture = looked(tmp_path, "dsp.csv", data, **{
        "unit.iq_pu": "pu", "scale.iq_pu": "20"})  # fmt: skip
    assert report.columns == {"t_s", "iq_a", "vq_v"}
    assert "the unit of 'vq_pu' (vq_v)" in report.starter
    np.testing.assert_allclose(capture.arrays("iq_a")["iq_a"], 10.0)


def test_a_preamble_of_names_and_numbers_is_no_table(tmp_path: Path) -> None:
    """A line of an oscilloscope's preamble is a name and a number, a row begins with a number."""
    head = b"Model,DSO-X 2024A\nRecord Length,9\nSample Interval,1.0E-05\nUnits,s\n\nTIME,CH1\n"
    data = head + b"".join(b"%.1e,%d\n" % (1e-5 * k, k) for k in range(9))
    report, capture = looked(tmp_path, "scope.csv", data, **{
        "column.CH1": "vab_v", "unit.CH1": "V", "unit.TIME": "s"})  # fmt: skip
    assert report.columns == {"t_s", "vab_v"}
    np.testing.assert_allclose(capture.arrays("vab_v")["vab_v"], np.arange(9.0))


def test_a_duty_cycle_times_the_bus_voltage_is_a_voltage(tmp_path: Path) -> None:
    rows = b"".join(b"%d,%d,%.1f\n" % (k, 10 * k, 48.0 - k) for k in range(9))
    answers = {
        "column.duty_pct": "vq_v",
        "times.duty_pct": "bus_V",
        "scale.duty_pct": "0.5",
    }
    _, capture = looked(tmp_path, "cart.csv", b"time_ms,duty_pct,bus_V\n" + rows, **answers)
    k = np.arange(9.0)
    np.testing.assert_allclose(capture.arrays("vq_v")["vq_v"], 0.5 * 0.1 * k * (48.0 - k))


@pytest.mark.parametrize("other", ["speed", "t"])
def test_a_share_of_what_the_map_does_not_have_is_a_usage_error(other: str) -> None:
    text = f"fields: {{t: t_s, duty: {{column: vq_v, unit: '%', times: {other}}}}}\n"
    with pytest.raises(UsageError, match="is no field of the map"):
        parse_source_file(b"recognise: {files: ['*.csv']}\n" + text.encode(), "found")
