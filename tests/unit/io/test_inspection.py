"""What `inspect` reads from names and numbers; what it asks for; the map it makes of a folder."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pipeline.__main__ import main
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import describe
from pipeline.io.inspection.evidence import gather, span_of
from pipeline.io.inspection.file_names import name_patterns
from pipeline.io.inspection.labels import read_label
from pipeline.io.inspection.proposals import propose
from pipeline.io.inspection.starter_map import header_pattern
from pipeline.io.maps.map_file import parse_source_file
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import UsageError


@pytest.mark.parametrize(
    ("name", "column", "unit"),
    [
        ("T_Wicklung [C]", "temp_winding_degc", "degC"),
        ("Zeit [ms]", "t_s", "ms"),
        ("Drehzahl [U/min]", "omega_mech_rad_s", "rpm"),
        ("Drehzahl / min^-1", "omega_mech_rad_s", "rpm"),
        ("Moment [mNm]", "torque_shaft_nm", "mN·m"),
        ("Torque (ft-lb)", "torque_shaft_nm", "lbf·ft"),
        ("Couple [N.m]", "torque_shaft_nm", "N·m"),
        ("Par [Nm]", "torque_shaft_nm", "N·m"),
        ("Vitesse / tr/min", "omega_mech_rad_s", "rpm"),
        ("Tension bus [V]", "vdc_v", "V"),
        ("Corriente q [A]", "iq_a", "A"),
        ("Gehäusetemperatur in degC", "temp_case_degc", "degC"),
        ("Wicklungstemp. [°C]", "temp_winding_degc", "degC"),
        ("Zwischenkreisspannung [V]", "vdc_v", "V"),
        ("转速(转/分)", "omega_mech_rad_s", "rpm"),
        ("绕组温度 [℃]", "temp_winding_degc", "degC"),
        ("电流 A相 [A]", "ia_a", "A"),
        ("トルク [N·m]", "torque_shaft_nm", "N·m"),
        ("回転数 [rpm]", "omega_mech_rad_s", "rpm"),
        ("U_UV [V]", "vab_v", "V"),
        ("Phase_U (V)", "va_v", "V"),
        ("Winkel el [deg]", "theta_elec_rad", "deg"),
        ("knee[0]:q_current", "iq_a", None),
        ("a1 velocity", "omega_mech_rad_s", None),
        ("motor.Iq", "iq_a", None),
        ("M [Nm]", "torque_shaft_nm", "N·m"),
        ("n [1/min]", "omega_mech_rad_s", "rpm"),
        ("X [Nm]", "torque_shaft_nm", "N·m"),
        ("time_ms", "t_s", "ms"),
        ("phase_current_a", "ia_a", None),
        ("Iq rms (A)", "iq_a", "A_rms"),
        ("vd_eff [V]", "vd_v", "V_rms"),
        ("Iq_rms [mA]", "iq_a", None),
    ],
)
def test_names_of_six_languages_and_their_units(name: str, column: str, unit: str | None) -> None:
    """The unit may stand in brackets, behind a stroke or at the end; a phase is no ampere."""
    label = read_label(name)
    assert (label.columns, label.unit) == ((column,), unit)


@pytest.mark.parametrize(
    "name", ["iq_ref", "i_q_soll [A]", "Leistung [W]", "state", "P [W]", "目标转速"]
)
def test_what_is_no_measurement_of_a_column_is_none(name: str) -> None:
    assert read_label(name).columns == ()


def test_one_letter_is_what_its_unit_makes_it() -> None:
    assert read_label("T [Nm]").columns == ("torque_shaft_nm",)
    assert read_label("T [s]").columns == ("t_s",)
    assert read_label("T [°C]").columns[0] == "temp_winding_degc"
    assert len(read_label("T [°C]").columns) == 4
    assert read_label("u", "V").columns == read_label("u [V]").columns


def _swing(rows: int = 3000) -> dict[str, np.ndarray]:
    """A shaft that swings around 100 rad/s, a noisy speed and its angle."""
    rng = np.random.default_rng(5)
    time = np.arange(rows) * 1e-3
    speed = 100.0 + 50.0 * np.sin(3.0 * time) + rng.normal(0.0, 0.3, rows)
    return {"t": time, "w": speed, "angle": np.cumsum(speed) * 1e-3}


def test_numbers_show_integrals_multiples_clocks_and_wraps() -> None:
    signals = _swing()
    rng = np.random.default_rng(6)
    fields = {
        "x": signals["t"] * 1e3,
        "y": signals["w"] * 30.0 / np.pi,
        "z": np.degrees(signals["angle"]) % 360.0,
        "s": signals["w"],
        "noise": rng.normal(0.0, 1.0, signals["t"].size),
        "n": np.cumsum(rng.integers(43, 47, signals["t"].size)) % 56_000,
    }
    found = gather(fields)
    assert dict(found.wraps) == {"z": 360.0, "n": 56_000.0}
    clocks = {clock.field: clock for clock in found.clocks}
    assert clocks["x"].jitter < 1e-9 < clocks["n"].jitter
    relations = {(r.field, r.other, r.integral): r.factor for r in found.relations}
    assert relations["z", "y", True] == pytest.approx(0.006, rel=1e-3)
    assert relations["s", "y", False] == pytest.approx(np.pi / 30.0)
    assert not [key for key in relations if "noise" in key]


def test_a_straight_line_is_no_evidence() -> None:
    """At constant speed everything that grows is the integral of everything that stands."""
    time = np.arange(500) * 1e-3
    rng = np.random.default_rng(7)
    fields = {"t": time, "angle": 3.0 * time, "u": 5.0 + rng.normal(0.0, 0.1, 500)}
    assert [r for r in gather(fields).relations if r.integral] == []


@pytest.mark.parametrize(
    ("values", "span"),
    [
        (np.arange(3000) * 50 % 65_536, 65_536.0),
        (np.cumsum(np.sin(np.arange(4000) / 300)) * 0.05 % (2 * np.pi), 2 * np.pi),
        (np.round(np.linspace(0, 60, 60_000) % (2 * np.pi) - np.pi, 3), 2 * np.pi),
        (np.repeat([0.0, 5.0, 0.0], 100), None),
        (np.random.default_rng(1).normal(0, 1, 1000), None),
        (np.arange(100.0), None),
        (np.ones(100), None),
    ],
)
def test_spans_of_counters_and_angles(values: np.ndarray, span: float | None) -> None:
    """A step of a current, noise and a line wrap nowhere; what goes to and fro wraps at a turn."""
    found = span_of(values.astype(float))
    assert found == (None if span is None else pytest.approx(span))


def _proposed(fields: dict[str, np.ndarray], **answers: str) -> dict[str, tuple[object, ...]]:
    given = {key.replace("__", "."): value for key, value in answers.items()}
    seen = propose(RawTable("t", fields), given)
    return {one.name: (one.column, one.unit, one.question and one.question[0]) for one in seen}


def test_a_unit_follows_from_the_numbers_or_is_asked_for() -> None:
    """The speed's unit is what its integral makes it; a current has nothing to go by."""
    signals = _swing()
    fields = {
        "Zeit [s]": signals["t"],
        "Drehzahl": signals["w"] * 30.0 / np.pi,
        "Winkel [deg]": np.degrees(signals["angle"]),
        "Iq": np.cos(signals["t"]),
    }
    assert _proposed(fields) == {
        "Zeit [s]": ("t_s", "s", None),
        "Drehzahl": ("omega_mech_rad_s", "rpm", None),
        "Winkel [deg]": ("theta_mech_rad", "deg", None),
        "Iq": ("iq_a", None, "unit.Iq"),
    }
    assert _proposed(fields, unit__Iq="mA")["Iq"] == ("iq_a", "mA", None)
    with pytest.raises(UsageError, match="no unit of iq_a"):
        _proposed(fields, unit__Iq="rpm")


def test_columns_without_a_name_are_known_by_what_they_are_to_others() -> None:
    signals = _swing()
    fields = {
        "column_1": signals["t"],
        "column_2": signals["w"],
        "Winkel [rad]": signals["angle"],
        "column_4": np.cos(signals["t"]),
    }
    found = _proposed(fields)
    assert found["column_1"] == ("t_s", None, "unit.column_1")
    assert found["column_2"][0] == "omega_mech_rad_s"
    assert found["column_4"] == (None, None, None)
    found = _proposed(fields, unit__column_1="s", column__column_4="iq_a", unit__column_4="A")
    assert found["column_2"] == ("omega_mech_rad_s", "rad/s", None)
    assert found["column_4"] == ("iq_a", "A", None)
    assert _proposed(fields, column__column_2="none")["column_2"] == (None, None, None)
    with pytest.raises(UsageError, match="is no column"):
        _proposed(fields, column__column_2="speed")


def test_several_columns_that_it_may_be_are_a_question() -> None:
    fields = {"t_s": np.arange(50.0), "Strom [A]": np.cos(np.arange(50.0))}
    seen = {one.name: one for one in propose(RawTable("t", fields), {})}
    question = seen["Strom [A]"].question
    assert question is not None and question[0] == "column.Strom_A"
    assert "iq_a, ia_a, idc_a" in question[1]
    assert seen["t_s"].certain and seen["t_s"].unit is None


def test_counts_take_a_scale() -> None:
    fields = {"t_s": np.arange(50.0), "Winkel [counts]": np.arange(50.0) ** 1.5}
    (_, seen) = propose(RawTable("t", fields), {"scale.Winkel_counts": "3.8e-4"})
    assert (seen.unit, seen.scale, seen.question) == ("counts", 3.8e-4, None)
    (_, seen) = propose(RawTable("t", fields), {})
    assert seen.question is not None


def test_electrical_speed_is_divided_by_the_pole_pairs() -> None:
    fields = {"t_s": np.arange(50.0), "erpm": np.cos(np.arange(50.0))}
    (_, seen) = propose(RawTable("t", fields), {})
    assert (seen.column, seen.unit, seen.per_pole_pair) == ("omega_mech_rad_s", "rpm", True)


def test_names_of_files_give_motor_test_pair_and_direction() -> None:
    names = [
        "M07_Auslauf_1.csv",
        "M08_Erwärmung_20240311.csv",
        "M08_Widerstand_UV.csv",
        "M07_heat_run_cw.csv",
    ]
    found = name_patterns(names)
    source = SourceMap(
        "x",
        file_names=found.patterns,
        values=tuple((key, tuple(words.items())) for key, words in found.values.items()),
    )
    assert found.keys == {"motor_id", "test"}
    told = [source.metadata_for(name) for name in names]
    assert [one["motor_id"] for one in told] == ["M07", "M08", "M08", "M07"]
    assert [one["test"] for one in told] == ["spin_down", "heat_run", "resistance", "heat_run"]
    assert told[2]["pair"] == "ab" and "pair" not in told[0]
    assert told[3]["direction"] == "cw"
    assert "test" not in name_patterns(names, frozenset({"test"})).keys
    assert name_patterns(["G52-0601/lcr 3.csv", "G52-0602/lcr.csv"]).keys == {"motor_id", "test"}
    assert name_patterns(["a.csv", "run_2024-03-01.csv"]).keys == frozenset()


def test_a_header_is_recognised_whatever_its_encoding(tmp_path: Path) -> None:
    """Heads are searched byte by byte; a longer header of the same beginning is another one."""
    pattern = header_pattern("Zeit [µs];Drehzahl [°/s]")
    source = SourceMap("x", header=pattern)
    for encoding in ("utf-8", "latin-1"):
        head = "Zeit [µs];Drehzahl [°/s]\r\n0;1\r\n".encode(encoding).decode("latin-1")
        assert source.recognises("a.csv", head.replace("\r\n", "\n"), [])
    assert not source.recognises("a.csv", "Zeit [µs];Drehzahl [°/s];I\n", [])


def test_a_file_without_header_parted_by_blanks_gets_a_map_that_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "x.dat"
    path.write_text("".join(f"  {n * 1e-3:.3f}   {n * 0.5:8.3f}\n" for n in range(60)))
    answers = {
        "unit.column_1": "s",
        "column.column_2": "omega_mech_rad_s",
        "unit.column_2": "rpm",
        "motor_id": "0012",
        "test": "spin_down",
    }
    report = describe(path, {}, answers)
    found = survey(tmp_path, parse_source_file(report.starter.encode(), "b"))
    (table,) = read_capture(tmp_path, found.entries[0]).tables
    assert found.entries[0].stated["motor_id"] == "0012"
    np.testing.assert_allclose(table["t_s"], np.arange(60) * 1e-3)
    np.testing.assert_allclose(table["omega_mech_rad_s"], np.arange(60) * 0.5 * np.pi / 30)


def test_gaps_and_jitter_of_a_clock_are_told(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    steps = np.full(100, 1e-3)
    steps[40], steps[60] = 0.5, 0.25
    text = "".join(f"{t:.4f},1\n" for t in np.cumsum(steps))
    path.write_text("time [s],speed [rpm]\n" + text)
    (stream,) = describe(path, {}).streams
    assert stream.clock == "2 gaps, the longest 0.5 s"
    assert stream.rate_hz == pytest.approx(1000.0)


def test_forms_of_recorders_are_looked_into(tmp_path: Path) -> None:
    """The map names the reader and recognises by suffix."""
    path = tmp_path / "x.npz"
    np.savez(path, time_ms=np.arange(50.0), iq_a=np.ones(50))
    report = describe(path, {}, {"motor_id": "m", "test": "drive"})
    assert report.form == "npz"
    found = survey(tmp_path, parse_source_file(report.starter.encode(), "b"))
    (table,) = read_capture(tmp_path, found.entries[0]).tables
    np.testing.assert_allclose(table["t_s"], np.arange(50) * 1e-3)


def test_what_nothing_asks_for_and_a_map_that_is_there_are_usage_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x.csv").write_text("t,w\n0,1\n1,2\n2,3\n")
    assert main(["inspect", str(tmp_path), "units.t=s"]) == 2
    assert "no key or metadata 'units.t'" in capsys.readouterr().err
    (tmp_path / "m.yaml").write_text("")
    assert main(["inspect", str(tmp_path), f"map={tmp_path / 'm.yaml'}"]) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("unit.Moment=mNm", "no file has a field 'Moment'"),
        ("column.speed=omega_mech_rad_s", "fields are t, w, xyz"),
        ("unit.xyz=rpm", "'xyz' is no column yet"),
    ],
)
def test_an_answer_that_changes_nothing_is_a_usage_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer: str, words: str
) -> None:
    """`unit.` of a name that was not quite the field's left q currents √2 too small, unsaid."""
    (tmp_path / "x.csv").write_text("t,w,xyz\n0,1,5\n1,2,5\n2,3,5\n")
    for where in (tmp_path, tmp_path / "x.csv"):
        assert main(["inspect", str(where), answer]) == 2
        assert words in capsys.readouterr().err


SAMPLES = Path(__file__).parent / "samples"


def test_files_that_a_map_reads_get_it_with_the_answers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of ODrive and SimpleFOC: serial number and interval are answered, nothing is edited."""
    logs, made = tmp_path / "logs", tmp_path / "mine.yaml"
    logs.mkdir()
    (logs / "run.csv").write_bytes((SAMPLES / "odrive_characterization.csv").read_bytes())
    (logs / "simplefoc.txt").write_bytes((SAMPLES / "simplefoc.csv").read_bytes())
    given = [f"map={made}", "motor_id=M1", "increment_s=0.002"]
    assert main(["inspect", str(logs), *given]) == 0
    assert f"source={made}" in capsys.readouterr().out
    maps = parse_source_file(made.read_bytes(), "mine")
    assert len(maps) == 2
    found = survey(logs, maps)
    assert [e.stated["motor_id"] for e in found.entries] == ["M1", "M1"]
    clock, even = (read_capture(logs, entry).tables[0]["t_s"].to_numpy() for entry in found.entries)
    assert np.ptp(clock) > 0.0
    np.testing.assert_allclose(np.diff(even), 0.002)


def test_an_answered_test_is_that_of_the_files_whose_names_give_none(tmp_path: Path) -> None:
    """It was put over all files: the spin-down and the LCR meter's table were refused as it."""
    logs, made = tmp_path / "logs", tmp_path / "mine.yaml"
    logs.mkdir()
    (logs / "M1_Auslauf.csv").write_text("Zeit_ms;n_rpm\n0;100\n5;99\n10;98\n15;97\n")
    meter = "Winkel el. [°];Lab [µH];f [kHz]\n0;300;1\n30;310;1\n60;320;1\n"
    (logs / "M1_LCR.csv").write_text(meter, encoding="utf-8")
    (logs / "M1_Kennlinie.csv").write_text("Iq [A];M [mNm]\n-1;-90\n0;0\n1;90\n")
    assert main(["inspect", str(logs), f"map={made}", "test=torque_table", "increment_s=1"]) == 0
    found = survey(logs, parse_source_file(made.read_bytes(), "mine"))
    tests = {entry.path: entry.stated["test"] for entry in found.entries}
    assert tests == {
        "M1_Auslauf.csv": "spin_down",
        "M1_LCR.csv": "lcr",
        "M1_Kennlinie.csv": "torque_table",
    }
    (locked,) = (e for e in found.entries if e.path == "M1_LCR.csv")
    assert read_capture(logs, locked).tables[0]["theta_elec_deg"].to_list() == [0.0, 30.0, 60.0]


def test_a_folder_that_needs_no_map_is_checked_without_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "logs" / "w.csv"
    path.parent.mkdir()
    head = "# contract: 1\n# motor_id: m\n# test: spin_down\nt_s,omega_mech_rad_s\n"
    rows = "".join(f"{0.01 * k:.2f},{100.0 - k}\n" for k in range(100))
    path.write_text(head + rows)
    assert main(["inspect", str(path.parent), f"map={tmp_path / 'm.yaml'}", "check=true"]) in (0, 3)
    assert "cannot be read" not in capsys.readouterr().err
    assert not (tmp_path / "m.yaml").exists()


def test_a_form_without_a_suffix_of_its_own_is_known_by_its_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sweep of moteus is JSON; any other JSON is no table of numbers."""
    rows = ", ".join(f'"{level}": [{{"omega": 100.0, "y": 0.5}}]' for level in (0.0, 1.0))
    (tmp_path / "ld_x.json").write_text(f'{{"raw": {{{rows}}}}}')
    (tmp_path / "other.json").write_text("{}")
    main(["inspect", str(tmp_path)])
    told = capsys.readouterr().out
    assert "1 file read by the source map moteus_ld" in told
    assert "no table of numbers: other.json" in told


def test_a_speed_in_every_name_is_a_column_of_one_number() -> None:
    """Where the files hold no motion, and no word beside the figures says which sense it is."""
    names = ["E7_wot_-2000rpm.csv", "E7_wot_1000rpm.csv", "E7_wot_12000 rpm.csv"]
    found = name_patterns(names, columns=frozenset({"iq_a"}))
    source = SourceMap("x", file_names=found.patterns)
    speeds = [source.columns_from_name(name)["omega_mech_rad_s"] for name in names]
    assert speeds == pytest.approx([n * math.pi / 30.0 for n in (-2000.0, 1000.0, 12000.0)])
    assert "omega_mech_rad_s__rpm" not in source.metadata_for(names[0])
    held = [
        (names, frozenset({"theta_mech_rad"})),
        ([*names, "E7_wot.csv"], frozenset({"iq_a"})),
        ([*names, "E7_rev_900rpm.csv"], frozenset({"iq_a"})),
    ]
    for paths, columns in held:
        patterns = name_patterns(paths, columns=columns).patterns
        assert not any("omega_mech_rad_s" in pattern for pattern in patterns)


@pytest.mark.parametrize(
    ("pattern", "value"),
    [
        (r"(?P<omega_mech_rad_s__minus_rpm>\d+)rpm", -30.0 * math.pi),
        (r"at(?P<temp_winding_degc__degC>\d+)", 85.0),
    ],
)
def test_other_columns_and_a_minus_that_the_name_leaves_out(pattern: str, value: float) -> None:
    found = SourceMap("x", file_names=(pattern,)).columns_from_name("rev_900rpm_at85.csv")
    assert list(found.values()) == pytest.approx([value])


def test_a_unit_that_the_column_cannot_have_is_refused() -> None:
    with pytest.raises(UsageError, match="'kg' is no unit of omega_mech_rad_s"):
        parse_source_file(
            b"file_names: ['(?P<omega_mech_rad_s__kg>.)']\nrecognise: {files: ['*']}", "m"
        )["m"]


def test_a_channel_number_says_nothing_of_what_it_recorded() -> None:
    assert read_label("CH3 Uab [V]").columns == ("vab_v",)
    assert read_label("Channel 2: ia (A)").columns == ("ia_a",)
    assert read_label("CH1").columns == read_label("CH2").columns == ()
    assert name_patterns(["BL42_sixstep_1.csv"]).values["test"] == {"sixstep": "drive"}
