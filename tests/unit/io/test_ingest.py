"""A folder in, captures out: what counts, what wins, what is left alone, what is refused."""

from __future__ import annotations

import errno
import gzip
import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import Survey, read_capture, survey
from pipeline.io.maps.map_file import parse_source_file
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError, UsageError
from tests.unit.io.recordings import META, START_NS, json_messages, mcap_file, small_capture

ROWS = "t_s,omega_mech_rad_s\n0,1\n1,2\n"
CSV = "# contract: 1\n# motor_id: 000123\n# test: spin_down\n" + ROWS


def fill(folder: Path, **files: str | bytes) -> Survey:
    """A folder of files (`__` is a dot in the name), looked at."""
    for name, content in files.items():
        path = folder / name.replace("__", ".").replace("_SLASH_", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return survey(folder, {})


def captures(folder: Path, found: Survey) -> list[Capture]:
    return [read_capture(folder, entry) for entry in found.entries]


def only_refusal(folder: Path, **files: str | bytes) -> tuple[str, str]:
    """Code and message of the one refusal, whether it came early or while reading."""
    found = fill(folder, **files)
    if found.findings:
        (finding,) = found.findings
        assert finding.severity == "refused" and finding.remedy
        return finding.code, finding.message
    (entry,) = found.entries
    with pytest.raises(CaptureError) as refused:
        read_capture(folder, entry)
    assert refused.value.remedy
    return refused.value.code, refused.value.message


def test_an_empty_folder_is_an_empty_survey_and_an_absent_one_a_usage_error(tmp_path: Path) -> None:
    assert survey(tmp_path, {}) == Survey((), (), ())
    with pytest.raises(UsageError):
        survey(tmp_path / "nowhere", {})


def test_serial_numbers_keep_their_zeros_wherever_they_are_written(tmp_path: Path) -> None:
    bare = "# contract: 1\n# test: spin_down\n"
    found = fill(
        tmp_path,
        a__csv=CSV,
        b__csv=bare + ROWS,
        b__meta__yaml="motor_id: 000123\n",
        c__csv=bare + ROWS + "2,3\n",
        manifest__csv="file,motor_id\nc.csv,000123\n",
        d__mcap=small_capture(),
    )
    assert found.findings == ()
    assert [c.meta.motor_id for c in captures(tmp_path, found)] == ["000123"] * 4


def test_the_file_wins_over_sidecar_and_manifest_and_contradictions_are_warned(
    tmp_path: Path,
) -> None:
    found = fill(
        tmp_path,
        a__csv=CSV.replace("# test", "# lot: A\n# vdc_v: 24.0\n# test"),
        a__meta__yaml="lot: B\nstation: s1\nvdc_v: 24\n",
        manifest__csv="file,lot,station,operator\na.csv,A,s2,Kim\n",
    )
    (capture,) = captures(tmp_path, found)
    assert (capture.meta.lot, capture.meta.station, capture.meta.operator) == ("A", "s1", "Kim")
    assert [(f.file, f.severity, f.code) for f in found.findings] == [
        ("a.csv", "warning", "metadata_contradiction")
    ] * 2


def test_a_manifest_alone_can_make_a_capture(tmp_path: Path) -> None:
    found = fill(
        tmp_path,
        x__csv=ROWS,
        manifest__csv="file,contract,motor_id,test\nx.csv,1,m,spin_down\ngone.csv,1,m,drive\n",
    )
    (capture,) = captures(tmp_path, found)
    assert capture.meta.test == "spin_down"
    assert [(f.file, f.code) for f in found.findings] == [("gone.csv", "manifest_missing_file")]


@pytest.mark.parametrize(
    "text",
    [
        "motor_id\nx\n",
        "file,lot\na.csv\n",
        "file,lot\na.csv,1\na.csv,2\n",
        'file\n"a',
        "file,a,a\n",
    ],
)
def test_a_broken_manifest_is_one_finding_and_the_captures_go_on(tmp_path: Path, text: str) -> None:
    found = fill(tmp_path, a__csv=CSV, manifest__csv=text)
    assert [(f.file, f.code) for f in found.findings] == [("manifest.csv", "bad_manifest")]
    assert len(captures(tmp_path, found)) == 1


def test_other_files_are_counted_and_named_once(tmp_path: Path) -> None:
    plain = mcap_file(json_messages([{"a": 1}]), metadata={"note": "no capture"})
    found = fill(
        tmp_path,
        truth__json="{}",
        notes__txt="hello\n",
        table__csv="a,b\n1,2\n",
        picture__png=bytes(100),
        utf16__csv="a,b\n".encode("utf-16"),
        other__mcap=plain,
        __hidden="x",
    )
    assert found.entries == () and found.findings == ()
    names = ("notes.txt", "other.mcap", "picture.png", "table.csv", "truth.json", "utf16.csv")
    assert found.others == names
    assert found.note == f"6 files are no captures and were left alone: {', '.join(names)}"
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "truth.json").write_text("{}")
    assert survey(tmp_path / "alone", {}).note == (
        "1 file is no capture and was left alone: truth.json"
    )


def test_what_nothing_can_be_seen_of_is_refused_and_not_left_alone(tmp_path: Path) -> None:
    """Expected: a lost recording costs an exit code 3; a log or an archive of others does not."""
    packed = gzip.compress(CSV.encode())
    found = fill(
        tmp_path,
        bare__csv=packed,
        named__csv__gz=packed,
        empty__csv="",
        empty__log="",
        pictures__tar__gz=packed,
    )
    told = {finding.file: (finding.code, finding.severity) for finding in found.findings}
    assert told == {
        "bare.csv": ("encoding", "refused"),
        "named.csv.gz": ("encoding", "refused"),
        "empty.csv": ("truncated", "refused"),
    }
    assert found.others == ("empty.log", "pictures.tar.gz")


@pytest.mark.parametrize("name", ["noext", "run.7", "a.weird"])
def test_the_key_contract_makes_a_capture_whatever_its_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(CSV)
    (tmp_path / "notes.md").write_text("# Notes\n\n# contract: see there\n")
    found = survey(tmp_path, {})
    assert [entry.path for entry in found.entries] == [name]
    assert found.others == ("notes.md",)
    assert len(captures(tmp_path, found)) == 1


def test_of_a_file_and_a_link_to_it_the_file_is_used(tmp_path: Path) -> None:
    (tmp_path / "lcr.csv").write_text(CSV)
    (tmp_path / "inside.csv").symlink_to("lcr.csv")
    found = survey(tmp_path, {})
    assert [entry.path for entry in found.entries] == ["lcr.csv"]
    assert [(f.file, f.code) for f in found.findings] == [("inside.csv", "duplicate_content")]
    assert "lcr.csv" in found.findings[0].message


def test_a_file_that_may_not_be_read_has_to_do_with_permissions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root may read everything, so the refusal is the system's own words."""

    def closed(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    (tmp_path / "x.csv").write_text(CSV)
    monkeypatch.setattr("pipeline.io.ingest.files.os.open", closed)
    (finding,) = survey(tmp_path, {}).findings
    assert (finding.code, finding.remedy) == ("unreadable", "check its permissions")


def test_folders_are_read_in_one_order_whatever_the_disk_says(tmp_path: Path) -> None:
    found = fill(
        tmp_path,
        b_SLASH_x__csv=CSV + "2,2\n",
        a__csv=CSV,
        b_SLASH_a__csv=CSV + "2,3\n",
        b_SLASH_manifest__csv="file,lot\nx.csv,L\n",
    )
    assert [entry.path for entry in found.entries] == ["a.csv", "b/a.csv", "b/x.csv"]
    assert [c.meta.lot for c in captures(tmp_path, found)] == [None, None, "L"]


def test_the_same_bytes_count_once(tmp_path: Path) -> None:
    found = fill(tmp_path, a__csv=CSV, copy__csv=CSV)
    assert [entry.path for entry in found.entries] == ["a.csv"]
    assert [(f.file, f.severity, f.code) for f in found.findings] == [
        ("copy.csv", "warning", "duplicate_content")
    ]


@pytest.mark.parametrize(
    ("old", "new", "code", "says"),
    [
        ("test: spin_down", "test: dance", "unknown_test", "'dance'"),
        ("# test: spin_down\n", "", "missing_metadata", "test"),
        ("# motor_id: 000123\n", "# motor_id:\n", "missing_metadata", "motor_id"),
        ("# motor_id: 000123\n", "", "missing_metadata", "motor_id"),
        ("contract: 1", "contract: 2", "contract_version", "'2'"),
        ("# test", "# pole_pairs: seven\n# test", "bad_metadata", "pole_pairs"),
        ("# test", "# pole_pairs: 3.5\n# test", "bad_metadata", "pole_pairs"),
        ("# test", "# vdc_v: nan\n# test", "bad_metadata", "vdc_v"),
        ("# test", "# winding: star\n# test", "bad_metadata", "winding"),
        ("# test", "# voltage_timing: later\n# test", "bad_metadata", "voltage_timing"),
        ("omega_mech_rad_s", "omega_mech_rpm", "unknown_unit", "omega_mech_rpm"),
        ("omega_mech_rad_s", "iq_ma", "unknown_unit", "iq_ma"),
        ("omega_mech_rad_s", "torque_shaft [Nmm]", "unknown_unit", "Nmm"),
        ("omega_mech_rad_s", "colour", "missing_column", "no column"),
        ("# test", "# source: nowhere\n# test", "unknown_source", "nowhere"),
    ],
)
def test_what_cannot_be_used_is_refused_and_says_why(
    tmp_path: Path, old: str, new: str, code: str, says: str
) -> None:
    assert old in CSV
    got, message = only_refusal(tmp_path, a__csv=CSV.replace(old, new))
    assert got == code
    assert says in message


def test_a_capture_without_a_motor_is_refused_before_motors_are_told_apart(tmp_path: Path) -> None:
    """Every entry of a survey names its motor, so nothing after it has to ask."""
    bare = CSV.replace("# motor_id: 000123\n", "")
    found = fill(tmp_path, a__csv=CSV, b__csv=bare, c__csv=bare.replace("# test: spin_down\n", ""))
    assert [entry.stated["motor_id"] for entry in found.entries] == ["000123"]
    assert [(f.file, f.code) for f in found.findings] == [
        ("b.csv", "missing_metadata"),
        ("c.csv", "missing_metadata"),
    ]
    assert "nothing states test" in found.findings[1].message


def test_files_that_only_look_like_captures_are_refused(tmp_path: Path) -> None:
    assert only_refusal(tmp_path, a__mcap="t_s,iq_a\n0,1\n")[0] == "not_mcap"


def test_utf16_that_means_to_be_a_capture_is_refused(tmp_path: Path) -> None:
    assert only_refusal(tmp_path, a__csv=CSV.encode("utf-16"))[0] == "encoding"


def test_a_broken_sidecar_refuses_its_capture(tmp_path: Path) -> None:
    assert only_refusal(tmp_path, a__csv=CSV, a__meta__yaml="a: [1\n")[0] == "bad_yaml"


def test_times_that_are_no_numbers_are_read_and_left_to_the_validator(tmp_path: Path) -> None:
    found = fill(tmp_path, a__csv=CSV + "nan,3\n")
    assert np.isnan(captures(tmp_path, found)[0].tables[0]["t_s"].to_numpy()[-1])


def test_links_pipes_and_devices_are_never_opened(tmp_path: Path) -> None:
    """Expected: one refusal each, at once (a pipe would block a careless reader for ever)."""
    outside = tmp_path / "outside.csv"
    outside.write_text(CSV)
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "a.csv").symlink_to(outside)
    (folder / "b.csv").symlink_to("nowhere")
    (folder / "loop.csv").symlink_to("loop.csv")
    (folder / "up").symlink_to("..")
    os.mkfifo(folder / "pipe.csv")
    (folder / "real.csv").write_text(CSV)
    (folder / "inside.csv").symlink_to("real.csv")
    found = survey(folder, {})
    codes = {finding.file: finding.code for finding in found.findings}
    refused = ("a.csv", "b.csv", "loop.csv", "pipe.csv", "up")
    assert codes == dict.fromkeys(refused, "not_a_file") | {"inside.csv": "duplicate_content"}


def test_names_that_cannot_be_printed_are_refused_in_print(tmp_path: Path) -> None:
    (tmp_path / "a\nb.csv").write_text(CSV)
    (finding,) = survey(tmp_path, {}).findings
    assert (finding.code, finding.file) == ("file_name", "a\\nb.csv")


def test_a_file_that_changes_between_survey_and_reading_is_refused(tmp_path: Path) -> None:
    found = fill(tmp_path, a__csv=CSV)
    (tmp_path / "a.csv").write_text(CSV + "2,3\n")
    with pytest.raises(CaptureError) as refused:
        read_capture(tmp_path, found.entries[0])
    assert refused.value.code == "changed"


def test_entries_cross_a_process_border(tmp_path: Path) -> None:
    found = fill(tmp_path, a__csv=CSV, b__mcap=small_capture())
    assert pickle.loads(pickle.dumps(found)) == found


def test_streams_of_different_rates_are_tables_of_their_own(tmp_path: Path) -> None:
    fast = json_messages([{"t_s": n / 1000, "ia_a": n} for n in range(50)], "/x")
    slow = json_messages([{"t_s": n / 10, "temp_winding_degc": 25 + n} for n in range(5)], "/y")
    state = json_messages([{"mode": "run"}] * 3, "/state")
    found = fill(tmp_path, a__mcap=mcap_file(fast + slow + state))
    (capture,) = captures(tmp_path, found)
    heights = sorted((table.height, tuple(table.columns)) for table in capture.tables)
    assert heights == [(5, ("t_s", "temp_winding_degc")), (50, ("t_s", "ia_a"))]


def test_without_t_s_the_log_clock_counts_from_the_captures_first_message(tmp_path: Path) -> None:
    first = [("/early", START_NS - 500_000_000, b'{"note": 1}')]
    rows = json_messages([{"omega_mech_rad_s": n} for n in range(3)])
    found = fill(tmp_path, a__mcap=mcap_file(first + rows[::-1]))
    (table,) = captures(tmp_path, found)[0].tables
    assert table["t_s"].to_list() == [0.5, 0.501, 0.502]
    assert table["omega_mech_rad_s"].to_list() == [0.0, 1.0, 2.0]


def test_blocks_without_t_s_are_refused_unless_a_map_states_the_increment(tmp_path: Path) -> None:
    rows = [
        ("/s", START_NS + 3_000_000 * n, json.dumps({"w": [3 * n, 3 * n + 1, 3 * n + 2]}).encode())
        for n in range(2)
    ]
    contract = [(t, at, p.replace(b'"w"', b'"omega_mech_rad_s"')) for t, at, p in rows]
    code, _ = only_refusal(tmp_path, a__mcap=mcap_file(contract))
    assert code == "missing_time"
    text = "recognise: {topics: ['/s']}\nfields: {w: omega_mech_rad_s}\nmessages: block\n"
    text += "time: {from: log, increment_s: 1e-3}\nmetadata: {motor_id: m, test: spin_down}\n"
    (tmp_path / "a.mcap").write_bytes(mcap_file(rows, metadata={}))
    found = survey(tmp_path, {"bench": parse_source_file(text.encode(), "bench")["bench"]})
    (table,) = captures(tmp_path, found)[0].tables
    np.testing.assert_allclose(table["t_s"], np.arange(6) * 1e-3, atol=1e-15)
    assert table["omega_mech_rad_s"].to_list() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("test", ["lcr", "torque_map"])
def test_blocks_of_a_test_without_a_clock_need_no_t_s(tmp_path: Path, test: str) -> None:
    """A torque map may be a table of settled points."""
    rows = [
        ("/s", START_NS + n, json.dumps({"theta_elec_deg": [30 * n, 15], "lab_h": [2, 3]}).encode())
        for n in range(2)
    ]
    found = fill(tmp_path, a__mcap=mcap_file(rows, metadata=META | {"test": test}))
    (table,) = captures(tmp_path, found)[0].tables
    assert table["theta_elec_deg"].to_list() == [0.0, 15.0, 30.0, 15.0]
    assert "t_s" not in table.columns


def test_a_block_whose_arrays_differ_in_length_is_refused_with_its_row(tmp_path: Path) -> None:
    rows = [{"t_s": [0, 1], "ia_a": [1, 2]}, {"t_s": [2, 3], "ia_a": [3]}]
    found = fill(tmp_path, a__mcap=mcap_file(json_messages(rows)))
    with pytest.raises(CaptureError) as refused:
        read_capture(tmp_path, found.entries[0])
    assert (refused.value.code, refused.value.rows) == ("ragged_block", (2, 2))


@pytest.mark.parametrize(
    ("options", "integrity"),
    [
        ({}, "verified"),
        ({"enable_data_crcs": False}, "unverified"),
        ({"enable_crcs": False}, "verified"),
        ({"enable_crcs": False, "enable_data_crcs": False}, "unverified"),
    ],
)
def test_verified_means_that_a_checksum_covers_samples_and_metadata(
    tmp_path: Path, options: dict[str, bool], integrity: str
) -> None:
    """The metadata record lies outside the chunks, so chunk checksums alone do not cover it."""
    found = fill(tmp_path, a__mcap=small_capture(**options))
    assert captures(tmp_path, found)[0].integrity == integrity


def test_extra_keys_are_kept(tmp_path: Path) -> None:
    data = small_capture(metadata=META | {"speed_rad_s": "60.0"})
    (capture,) = captures(tmp_path, fill(tmp_path, a__mcap=data))
    assert dict(capture.meta.extra) == {"speed_rad_s": "60.0"}


def test_nested_fields_count_by_their_last_part_unless_two_claim_a_column(tmp_path: Path) -> None:
    rows = json_messages([{"t_s": n, "m": {"ia_a": n}} for n in range(3)])
    (capture,) = captures(tmp_path, fill(tmp_path, a__mcap=mcap_file(rows)))
    assert capture.tables[0]["ia_a"].to_list() == [0, 1, 2]
    both = json_messages([{"t_s": n, "l": {"ia_a": n}, "r": {"ia_a": n}} for n in range(3)])
    code, _ = only_refusal(tmp_path, a__mcap=mcap_file(both))
    assert code == "duplicate_column"


def test_a_map_recognises_and_another_claim_is_ambiguous(tmp_path: Path) -> None:
    text = (
        b"recognise: {files: ['*.csv']}\nfields: {I: ia_a}\nmetadata: {motor_id: m, test: drive}\n"
    )
    maps = {name: parse_source_file(text, name)[name] for name in ("one", "two")}
    (tmp_path / "x.csv").write_text("I\n1\n")
    assert survey(tmp_path, {"one": maps["one"]}).entries[0].source == maps["one"]
    (finding,) = survey(tmp_path, maps).findings
    assert finding.code == "ambiguous_source"
    (tmp_path / "x.meta.yaml").write_text("source: two\n")
    assert survey(tmp_path, maps).entries[0].source == maps["two"]
