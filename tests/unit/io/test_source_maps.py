"""The shipped source maps on files in the dialects as they really look, and what a map may say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pipeline
from pipeline.api.recordings import Recordings
from pipeline.contracts.validate import validate
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.columns import _converted
from pipeline.io.maps.map_file import load_source_maps, parse_source_file
from pipeline.io.maps.source_map import FieldMap
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import CaptureError, UsageError
from tests.unit.io.recordings import SHARED

CONF = Path(pipeline.__file__).parents[1] / "conf" / "source"
SAID = "motor_id: 000123\ntest: drive\npole_pairs: 7\n"
RPM = 2 * np.pi / 60

SAMPLES = Path(__file__).parent / "samples"


def sample(name: str) -> str:
    """The text of a small file in the dialect of one instrument."""
    return (SAMPLES / f"{name}.csv").read_bytes().decode()


RIGOL = sample("rigol")
RIGOL_SHORT = sample("rigol_short")
RIGOL_TIME = sample("rigol_time")
SIGLENT = sample("siglent")
SIGLENT_SHORT = sample("siglent_short")
MDO = sample("tektronix_mdo")
TDS = sample("tektronix_tds")
PICO = sample("picoscope")
VESC = sample("vesc_tool")
MOTEUS = sample("moteus")
KEYSIGHT = "".join(sample("keysight").splitlines(keepends=True)[:2])


def one(folder: Path, text: str, name: str = "scope.csv", said: str = SAID) -> Capture:
    """The capture that the shipped maps make of one file with its sidecar."""
    (folder / name).write_bytes(text.encode())
    (folder / f"{Path(name).stem}.meta.yaml").write_text(said)
    found = survey(folder, load_source_maps(CONF))
    assert found.findings == ()
    (entry,) = found.entries
    return read_capture(folder, entry)


MILLISECONDS = [-1e-3, 0.0, 1e-3]
VOLTS, AMPERES = [1.2, 1.4, 1.6], [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            RIGOL,
            {"t_s": [-2e-3, -1.995e-3, -1.99e-3], "vab_v": VOLTS, "ia_a": AMPERES},
        ),
        (RIGOL_SHORT, {"t_s": [-1e-3, -0.999e-3, -0.998e-3], "vab_v": VOLTS}),
        (RIGOL_TIME, {"t_s": [-2e-3, -1e-3], "vab_v": VOLTS[:2], "ia_a": AMPERES[:2]}),
        (SIGLENT, {"t_s": MILLISECONDS, "vab_v": VOLTS, "ia_a": AMPERES}),
        (SIGLENT_SHORT, {"t_s": MILLISECONDS, "vab_v": VOLTS}),
        (MDO, {"t_s": MILLISECONDS, "vab_v": VOLTS, "ia_a": AMPERES}),
        (MDO.replace("\n", "\r\n"), {"t_s": MILLISECONDS, "vab_v": VOLTS, "ia_a": AMPERES}),
        (TDS, {"t_s": MILLISECONDS, "vab_v": VOLTS}),
        (PICO, {"t_s": MILLISECONDS, "vab_v": VOLTS, "ia_a": AMPERES}),
        (
            VESC,
            {
                "t_s": [86399.98, 86400.0, 86400.02],
                "vdc_v": [48.5, 48.4, 48.3],
                "temp_winding_degc": [31.5, 31.6, 31.7],
                "idc_a": [1.5, 1.6, 1.7],
                "id_a": [-0.25, 0.0, 0.25],
                "iq_a": [10.0, 11.0, 12.0],
                "omega_mech_rad_s": [1000 * RPM, 1010 * RPM, 1020 * RPM],
            },
        ),
        (
            MOTEUS,
            {
                "t_s": [0.01, 0.03, 0.04],
                "theta_mech_rad": [np.pi / 2, np.pi, 1.5 * np.pi],
                "omega_mech_rad_s": [-4 * np.pi, 4 * np.pi, 4 * np.pi],
                "iq_a": [1.5, 1.25, 1.0],
                "id_a": [0.0, 0.5, 0.5],
                "vdc_v": [24.5, 24.0, 24.0],
            },
        ),
    ],
    ids=[
        "rigol",
        "rigol-short",
        "rigol-time",
        "siglent",
        "siglent-short",
        "mdo",
        "mdo-crlf",
        "tds",
        "pico",
        "vesc",
        "moteus",
    ],
)
def test_real_dialects_become_the_contracts_columns(
    tmp_path: Path, text: str, expected: dict[str, list[float]]
) -> None:
    capture = one(tmp_path, text)
    assert capture.meta.motor_id == "000123"
    assert capture.integrity == "unverified"
    (table,) = capture.tables
    assert set(table.columns) == set(expected)
    assert table.columns[0] == "t_s"
    for name, values in expected.items():
        np.testing.assert_allclose(table[name].to_numpy(), values, rtol=1e-12, err_msg=name)


def test_keysight_times_of_three_digits_are_put_back_on_their_line(tmp_path: Path) -> None:
    """1,000 samples of 0.4 us from -2 ms print as repeating times; the grid comes back."""
    true = -2e-3 + 4e-7 * np.arange(8000)
    rows = "".join(f"{t:.2E},{n % 7},0.5\n" for n, t in enumerate(true))
    printed = np.array([float(f"{t:.2E}") for t in true])
    assert np.count_nonzero(np.diff(printed) == 0) > 1000
    time = one(tmp_path, KEYSIGHT + rows).tables[0]["t_s"].to_numpy()
    assert np.diff(time).min() > 0
    np.testing.assert_allclose(np.diff(time), 4e-7, rtol=2e-3)
    assert np.abs(time - true).max() < 4e-6


def test_keysight_as_it_comes(tmp_path: Path) -> None:
    """Twelve samples 4 us apart whose printed times are 10 us apart or equal."""
    (table,) = one(tmp_path, sample("keysight")).tables
    assert table.columns == ["t_s", "vab_v", "ia_a"]
    np.testing.assert_allclose(np.diff(table["t_s"]), 4e-6, rtol=0.1)
    assert table["vab_v"].to_list() == [float(n % 7) for n in range(12)]


def test_every_map_of_an_instrument_has_a_sample_that_it_alone_recognises(tmp_path: Path) -> None:
    """Each sample is claimed by one map; each text table's map, but that of LAAS, by a sample."""
    maps = load_source_maps(CONF)
    claimed = set()
    for path in sorted(SAMPLES.glob("*.csv")):
        head = path.read_bytes().decode("latin-1")
        (own,) = [m.name for m in maps.values() if m.recognises(path.name, head, [])]
        claimed.add(own)
    tables = {name for name, found in maps.items() if found.reader is None}
    assert claimed == tables - {"laas_solo"}


def test_a_run_without_current_is_read_and_its_counter_counted_on(tmp_path: Path) -> None:
    """The row that holds no number is none; 4 counts come after 55,960."""
    text = sample("odrive_characterization")
    (table,) = one(tmp_path, text, said="motor_id: m\n").tables
    assert table.columns == ["t_s", "vq_v", "theta_mech_rad", "omega_mech_rad_s"]
    np.testing.assert_allclose(table["t_s"], np.array([55_960, 56_004, 56_048]) / 8000)
    np.testing.assert_allclose(table["omega_mech_rad_s"], 9 * np.pi)


def test_monitor_lines_of_simplefoc_need_the_interval(tmp_path: Path) -> None:
    """They have no clock: the shipped map says so, and a copy with `increment_s` reads them."""
    (tmp_path / "simplefoc.csv").write_text(sample("simplefoc"))
    (tmp_path / "simplefoc.meta.yaml").write_text("motor_id: m\n")
    maps = load_source_maps(CONF)
    (entry,) = survey(tmp_path, maps).entries
    with pytest.raises(CaptureError, match="no sampling increment"):
        read_capture(tmp_path, entry)
    text = (CONF / "simplefoc.yaml").read_text().replace("from: increment", "{}", 1)
    text = text.replace("  {}", "  from: increment\n  increment_s: 0.01")
    found = survey(tmp_path, {"mine": parse_source_file(text.encode(), "mine")["mine"]})
    (table,) = read_capture(tmp_path, found.entries[0]).tables
    np.testing.assert_allclose(table["t_s"], [0.0, 0.01, 0.02])
    np.testing.assert_allclose(table["iq_a"], [0.35, 0.36, 0.37])
    np.testing.assert_allclose(table["vd_v"], -0.25)


LAST_ROWS = {
    "chirp1": 1164,
    "chirp2": 1139,
    "impulse1": 1217,
    "impulse2": 1261,
    "noise1": 1280,
    "noise2": 1255,
    "step1": 1289,
    "step2": 1258,
}


def test_runs_of_voltage_and_speed_alone_say_what_they_do_not_determine() -> None:
    """Published runs of an ODrive: all eight are read, no constant of the winding is printed."""
    folder = SHARED / "real" / "labmrd"
    if not folder.is_dir():
        pytest.skip(f"the recording is not there: {folder}")
    parts = "".join(f"  - {{files: '{n}*', rows: 0-{last}}}\n" for n, last in LAST_ROWS.items())
    text = (
        CONF / "odrive_characterization.yaml"
    ).read_text() + f"  motor_id: m\ncaptures:\n{parts}"
    found = survey(folder, {"labmrd": parse_source_file(text.encode(), "labmrd")["labmrd"]})
    read = [read_capture(folder, entry) for entry in found.entries]
    assert len(read) == len(LAST_ROWS)
    for capture in read:
        (table,) = capture.tables
        steps = np.diff(table["t_s"].to_numpy())
        assert steps.min() > 0.004 and steps.max() < 0.023
    driven = [one for one in read if one.tables[0]["vq_v"].to_numpy().any()]
    captures = [validate(one, {})[0] for one in driven]
    fits = pipeline.fit(Recordings({"m": Campaign("m", tuple(captures))}))
    printed = fits.constants.filter(pl.col("value").is_not_null())["constant"].to_list()
    assert not set(printed) & {"psi_pm_wb", "r_phase_ohm", "kt_peak_nm_a", "j_rotor_kgm2"}


def test_keysight_times_with_a_gap_are_refused(tmp_path: Path) -> None:
    true = np.concatenate([np.arange(500) * 1e-6, 2e-3 + np.arange(500) * 1e-6])
    rows = "".join(f"{t:.2E},1,0.5\n" for t in true)
    with pytest.raises(CaptureError) as refused:
        one(tmp_path, KEYSIGHT + rows)
    assert refused.value.code == "uneven_time"


def test_a_current_shown_in_volts_is_refused_with_what_to_write(tmp_path: Path) -> None:
    with pytest.raises(CaptureError) as refused:
        one(tmp_path, RIGOL.replace(",Amp,", ",Volt,"))
    assert refused.value.code == "unknown_unit"


@pytest.mark.parametrize("text", [RIGOL, MDO])
def test_a_scope_file_that_nobody_described_asks_for_motor_and_test(
    tmp_path: Path, text: str
) -> None:
    """Fault: a scope's CSV as it comes. Refused by name before motors are told apart."""
    (tmp_path / "scope.csv").write_bytes(text.encode())
    found = survey(tmp_path, load_source_maps(CONF))
    assert found.entries == ()
    (finding,) = found.findings
    assert (finding.file, finding.code) == ("scope.csv", "missing_metadata")
    assert "motor_id" in finding.message and "test" in finding.message


def test_electrical_speed_without_pole_pairs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CaptureError) as refused:
        one(tmp_path, VESC, said="motor_id: m\n")
    assert (refused.value.code, "pole_pairs" in refused.value.message) == ("missing_metadata", True)


def test_both_laas_recordings_are_read() -> None:
    folder = SHARED / "real" / "laas_solo"
    if not folder.is_dir():
        pytest.skip(f"the recording is not there: {folder}")
    found = survey(folder, load_source_maps(CONF))
    assert found.others == ("LICENSE",)
    drive, hold = (read_capture(folder, entry) for entry in found.entries)
    assert (drive.meta.test, hold.meta.test) == ("drive", "holding_current")
    assert (drive.meta.pole_pairs, drive.meta.slots) == (12, 18)
    assert drive.meta.voltage_kind == "commanded"
    assert drive.tables[0].columns == ["t_s", "theta_mech_rad", "omega_mech_rad_s", "iq_a", "vq_v"]
    truth = np.loadtxt(folder / "acc_current.txt", delimiter=",", skiprows=1)
    for n, name in enumerate(drive.tables[0].columns):
        np.testing.assert_array_equal(drive.tables[0][name].to_numpy(), truth[:, n])
    assert hold.tables[0].height == 31_666
    # positive current drives positive rotation: acceleration follows iq
    arrays = drive.arrays("t_s", "omega_mech_rad_s", "iq_a")
    slope = np.gradient(arrays["omega_mech_rad_s"], arrays["t_s"])
    assert np.corrcoef(slope, arrays["iq_a"])[0, 1] > 0.9


def test_every_shipped_map_maps_something_and_says_how_to_know_its_files() -> None:
    maps = load_source_maps(CONF)
    assert len(maps) >= 11
    for source in maps.values():
        assert source.fields and (source.header or source.files or source.topics)


MINIMAL = "recognise: {files: ['*.csv']}\nfields: {I: ia_a}\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("recognice: {}\n", "did you mean 'recognise'"),
        ("fields: {I: {colunm: ia_a}}\n", "is no column of the contract"),
        ("fields: {I: {column: ia_a, sing: -1}}\n", "did you mean 'sign'"),
        ("fields: {I: iaa}\n", "did you mean ia_a"),
        ("fields: {I: {column: ia_a, sign: 2}}\n", "neither 1 nor -1"),
        ("fields: {I: {column: ia_a, scale: x}}\n", "is no number"),
        ("fields: {I: {column: ia_a, scale: 0}}\n", "is zero"),
        ("fields: [ia_a]\n", "is no map of keys"),
        ("recognise: {header: '('}\n", "is no regular expression"),
        ("layout: {separator: ',,'}\n", "is not one character"),
        ("layout: {decimal: ','}\n", "is the separator too"),
        ("layout: {skip_lines: -1}\n", "is no whole number"),
        ("layout: {units_row: maybe}\n", "neither true nor false"),
        ("time: {from: clock}\n", "is unknown"),
        ("time: {increment_s: 0}\n", "is not above zero"),
        ("a: &x 1\nb: *x\n", "uses an alias"),
        ("a: !!python/object/apply:os.system [ls]\n", "uses the tag"),
        ("a: " + "[" * 5000 + "\n", "nests deeper"),
        ("a: 1\na: 2\n", "has the key 'a' twice"),
        ("a: 'x\n", "is no YAML"),
        ("---\na: 1\n---\nb: 2\n", "more than one document"),
        ("# " + "x" * 200_000, "is larger than"),
        ("\xff", "is not UTF-8"),
        ("? [a]\n: 1\n", "key that is no text"),
        ("<<: {a: 1}\n", "uses the tag"),
    ],
)
def test_a_wrong_or_hostile_map_is_a_usage_error_that_names_the_place(text: str, says: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse_source_file(text.encode("latin-1"), "bench")["bench"]
    assert says in str(refused.value)
    assert "bench" in str(refused.value)


def test_signs_scales_and_offsets_apply_in_the_documented_order(tmp_path: Path) -> None:
    """Column = sign * scale * (value in its unit, converted) + offset."""
    text = (
        "recognise: {files: ['*.csv']}\n"
        "fields:\n"
        "  t: {column: t_s, unit: ms}\n"
        "  T: {column: temp_winding_degc, unit: K, offset: 1.5}\n"
        "  M: {column: torque_shaft_nm, unit: Nmm, sign: -1, scale: 2}\n"
        "metadata: {motor_id: 000123, test: spin_down}\n"
    )
    (tmp_path / "x.csv").write_text("t,T,M\n0,300,1000\n1,273.15,-500\n")
    source = parse_source_file(text.encode(), "bench")["bench"]
    found = survey(tmp_path, {"bench": source})
    capture = read_capture(tmp_path, found.entries[0])
    assert capture.meta.motor_id == "000123"
    (table,) = capture.tables
    np.testing.assert_allclose(table["t_s"], [0, 1e-3], rtol=1e-15)
    np.testing.assert_allclose(table["temp_winding_degc"], [28.35, 1.5], atol=1e-12)
    np.testing.assert_allclose(table["torque_shaft_nm"], [-2.0, 1.0], rtol=1e-15)


def test_an_unknown_unit_refuses_the_capture_and_not_the_run(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("I\n1\n")
    text = "recognise: {files: [x.csv]}\nfields: {I: {column: ia_a, unit: furlong}}\n"
    text += "metadata: {motor_id: m, test: drive}\n"
    found = survey(tmp_path, {"bench": parse_source_file(text.encode(), "bench")["bench"]})
    with pytest.raises(CaptureError) as refused:
        read_capture(tmp_path, found.entries[0])
    assert refused.value.code == "unknown_unit"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("scale", "offset"), [(100.0, 0.0), (1.5, 1e308)])
def test_a_number_that_no_double_holds_once_converted_is_infinite(scale, offset):
    """What gates take for a reading that is missing; a warning of numpy names no file."""
    part = FieldMap("i", "iq_a", unit="A", scale=scale, offset=offset)
    first, second = _converted(np.array([1e308, 2.0]), part, {})
    assert (first, second) == (np.inf, 2.0 * scale + offset)
