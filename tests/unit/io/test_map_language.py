"""What a source map says of a folder: counters that wrap, file names, parts, variants, places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.map_file import (
    find_maps,
    load_source_file,
    parse_source_file,
)
from pipeline.io.maps.places import source_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError, UsageError

FIELDS = """
fields:
  t: t_s
  w: {column: omega_mech_rad_s, unit: rad/s}
metadata: {motor_id: m, test: drive}
"""


def _captures(folder: Path, sources: dict[str, SourceMap]) -> list[Capture]:
    return [read_capture(folder, entry) for entry in survey(folder, sources).entries]


def _map(text: str) -> dict[str, SourceMap]:
    return parse_source_file(text.encode(), "bench")


def test_a_counter_and_an_angle_that_wrap_are_unwrapped(tmp_path: Path) -> None:
    """The clock goes on forwards by more than half its span; the angle turns back."""
    (tmp_path / "a.csv").write_text("n,deg\n0,350\n60,5\n4,355\n")
    source = """
recognise: {header: ^n}
fields:
  n: {column: t_s, unit: ms, wraps: 100}
  deg: {column: theta_mech_rad, unit: deg, wraps: 360}
metadata: {motor_id: m, test: drive}
"""
    (capture,) = _captures(tmp_path, _map(source))
    np.testing.assert_allclose(capture.tables[0]["t_s"], [0.0, 0.06, 0.104])
    np.testing.assert_allclose(
        np.degrees(capture.tables[0]["theta_mech_rad"]), [350.0, 365.0, 355.0]
    )


def test_file_names_give_metadata_and_words_are_translated(tmp_path: Path) -> None:
    """The folder names the motor, the file its test; a sidecar counts before both."""
    home = tmp_path / "M7"
    home.mkdir()
    (home / "Auslauf_UV_01.csv").write_text("t,w\n0,1\n1,2\n")
    (home / "Auslauf_UV_02.csv").write_text("t,w\n0,1\n1,3\n")
    (home / "Auslauf_UV_02.meta.yaml").write_text("pair: ca\n")
    source = r"""
recognise: {header: ^t}
fields: {t: t_s, w: omega_mech_rad_s}
metadata: {test: drive, station: s}
file_names:
  - '(?P<motor_id>M\d+)/'
  - '(?P<test>[A-Z]\w+?)_(?P<pair>[UVW]{2})'
values:
  test: {Auslauf: spin_down}
  pair: {UV: ab}
"""
    one, two = _captures(tmp_path, _map(source))
    assert (one.meta.motor_id, one.meta.test, one.meta.pair) == ("M7", "spin_down", "ab")
    assert (two.meta.test, two.meta.pair) == ("spin_down", "ca")
    assert one.meta.station == "s"


def test_ranges_of_rows_cut_a_log_into_captures(tmp_path: Path) -> None:
    """Both parts have names of their own; the second goes to the end; another file stays whole."""
    rows = "".join(f"{n},{10 * n}\n" for n in range(10))
    (tmp_path / "log.csv").write_text("t,w\n" + rows)
    (tmp_path / "whole.csv").write_text("t,w\n0,5\n1,6\n")
    source = (
        "recognise: {header: ^t}"
        + FIELDS
        + """
captures:
  - {files: 'log*', rows: 0-3, test: drive}
  - {files: 'log*', rows: 4-, test: spin_down, station: end}
"""
    )
    first, second, whole = _captures(tmp_path, _map(source))
    assert [c.path for c in (first, second, whole)] == [
        "log rows 0-3.csv",
        "log rows 4-.csv",
        "whole.csv",
    ]
    assert first.tables[0]["t_s"].to_list() == [0, 1, 2, 3]
    assert second.tables[0]["omega_mech_rad_s"].to_list() == [40, 50, 60, 70, 80, 90]
    assert (second.meta.test, second.meta.station) == ("spin_down", "end")
    assert first.sha256 == second.sha256


def test_a_part_that_is_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,w\n0,1\n1,2\n2,3\n")
    source = "recognise: {header: ^t}" + FIELDS + "captures: [{rows: 1-3}]"
    with pytest.raises(CaptureError, match="there are no rows 1-3 in 3 rows"):
        _captures(tmp_path, _map(source))


def test_variants_are_one_map_of_several_headers(tmp_path: Path) -> None:
    """What a variant says is laid over what all say, key by key."""
    (tmp_path / "a.csv").write_text("t;w\n0;1,5\n1;2,5\n")
    (tmp_path / "b.csv").write_text("t;rpm\n0;60\n1;120\n")
    source = """
layout: {separator: ;, decimal: ','}
fields: {t: t_s}
metadata: {motor_id: m, test: drive}
variants:
  - {recognise: {header: '^t;w'}, fields: {w: omega_mech_rad_s}}
  - {recognise: {header: '^t;rpm'}, fields: {rpm: {column: omega_mech_rad_s, unit: rpm}}}
"""
    maps = _map(source)
    assert list(maps) == ["bench/1", "bench/2"]
    one, two = _captures(tmp_path, maps)
    assert one.tables[0]["omega_mech_rad_s"].to_list() == [1.5, 2.5]
    np.testing.assert_allclose(two.tables[0]["omega_mech_rad_s"], [2 * np.pi, 4 * np.pi])
    assert find_maps(maps, "bench") == maps
    (tmp_path / "b.meta.yaml").write_text("source: bench\n")
    assert _captures(tmp_path, maps)[1].tables[0].columns == ["t_s", "omega_mech_rad_s"]
    with pytest.raises(UsageError, match="variants: is no list"):
        _map("variants: {a: b}")


def test_blank_separated_numbers_of_any_width_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text("  0.0   1.5\n  0.1\t 1.25  \n 12.0 -1\n")
    source = """
recognise: {files: ['*.dat']}
layout: {separator: space, names: [t, w]}
"""
    (capture,) = _captures(tmp_path, _map(source + FIELDS))
    assert capture.tables[0]["t_s"].to_list() == [0.0, 0.1, 12.0]
    assert capture.tables[0]["omega_mech_rad_s"].to_list() == [1.5, 1.25, -1.0]


def test_what_ends_every_row_is_no_part_of_its_last_field(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,w\n0,1;\n1,2;\n")
    source = "recognise: {header: ^t}\nlayout: {row_end: ;}" + FIELDS
    (capture,) = _captures(tmp_path, _map(source))
    assert capture.tables[0]["omega_mech_rad_s"].to_list() == [1.0, 2.0]


def test_maps_lie_anywhere_and_the_nearest_of_a_name_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The package's maps, then the user's, then those of the current folder."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    monkeypatch.chdir(tmp_path)
    for place, unit in (("user/motor-datasheets", "ms"), (".", "us")):
        home = tmp_path / place / ("source" if "user" in place else "conf/source")
        home.mkdir(parents=True)
        (home / "mine.yaml").write_text(f"fields: {{t: {{column: t_s, unit: {unit}}}}}\n")
    (tmp_path / "conf/source/moteus.yaml").write_text("fields: {time: t_s}\n")
    (tmp_path / "user/motor-datasheets/source/hers.yaml").write_text("fields: {t: t_s}\n")
    maps = source_maps()
    assert {"mine", "hers", "moteus", "vesc_tool"} <= set(maps)
    assert maps["mine"].fields[0].unit == "us"
    assert maps["moteus"].fields[0].unit is None
    assert list(source_maps("hers")) == ["hers"]
    elsewhere = tmp_path / "elsewhere.yaml"
    elsewhere.write_text("fields: {t: {column: t_s, unit: h}}\n")
    assert source_maps(str(elsewhere)) == load_source_file(elsewhere)
    with pytest.raises(UsageError, match="there is no source map 'nobody'"):
        source_maps("nobody")
    with pytest.raises(UsageError, match="cannot be read"):
        source_maps("nowhere/x.yaml")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("file_names: ['a(b)']", "no named group"),
        ("file_names: ['a(?P<b']", "no regular expression"),
        ("captures: [{rows: 5-3}]", "no range of rows"),
        ("captures: {rows: 1-3}", "captures: is no list"),
        ("fields: {t: {column: t_s, wraps: 0}}", "wraps: is not above zero"),
        ("values: {test: [a]}", "values.test: is no map of keys"),
    ],
)
def test_what_a_map_cannot_say_is_named(text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        parse_source_file(text.encode(), "bench")["bench"]
