"""A German bench: ten CSVs, four headers, metadata in file names; two commands to a datasheet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.__main__ import main
from pipeline.io.maps.map_file import load_source_file
from pipeline.records.capture import Capture

DEMO = Path(pipeline.__file__).parents[1] / "data" / "demo"
MOTOR = "G52-0601"
DEGREE = np.pi / 180.0
RPM = 2.0 * np.pi / 60.0
FIELDS = {
    "t_s": ("Zeit [ms]", 1e-3),
    "vab_v": ("U_UV [V]", 1.0),
    "vbc_v": ("U_VW [V]", 1.0),
    "vca_v": ("U_WU [V]", 1.0),
    "ia_a": ("I_U [A]", 1.0),
    "id_a": ("I_d [mA]", 1e-3),
    "iq_a": ("I_q [mA]", 1e-3),
    "vd_v": ("U_d [V]", 1.0),
    "vq_v": ("U_q [V]", 1.0),
    "theta_mech_rad": ("Winkel [°]", DEGREE),
    "omega_mech_rad_s": ("Drehzahl [U/min]", RPM),
    "torque_shaft_nm": ("Moment [mNm]", 1e-3),
    "temp_winding_degc": ("T_Wicklung [C]", 1.0),
    "temp_magnet_degc": ("T_Magnet [C]", 1.0),
}
TESTS = {
    "Widerstand": "resistance",
    "Leerlauf": "open_circuit",
    "Auslauf": "spin_down",
    "Kennfeld": "torque_map",
    "Fahrt": "drive",
}
FILES = {
    "resistance_ab": "0601_Widerstand_UV_1",
    "resistance_ab_warm": "0601_Widerstand_UV_2",
    "open_circuit_forward": "0601_Leerlauf_vor",
    "open_circuit_backward_warm": "0601_Leerlauf_zurueck",
    "spin_down_forward": "0601_Auslauf_vor",
    "spin_down_backward": "0601_Auslauf_zurueck",
    "torque_map_slow": "0601_Kennfeld_1",
    "torque_map_fast": "0601_Kennfeld_2",
    "torque_map_backward": "0601_Kennfeld_3",
    "drive_0": "0601_Fahrt_1",
}


def _german(capture: Capture) -> str:
    """The capture as that bench writes it: angles start again after a turn, a comma in numbers."""
    columns = [name for name in FIELDS if name in capture.columns]
    arrays = capture.arrays(*columns, masked=False)
    lines = ["Prüfstand 3;Bediener: K", ";".join(FIELDS[name][0] for name in columns)]
    table = []
    for name in columns:
        values = arrays[name] / FIELDS[name][1]
        values = values % 360.0 if name == "theta_mech_rad" else values
        numbers = (f"{value:.9g}".replace(".", ",") for value in values)
        table.append(["" if number == "nan" else number for number in numbers])
    return "\r\n".join([*lines, *(";".join(row) for row in zip(*table, strict=True)), ""])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder, in Latin-1 as that software writes it."""
    folder = tmp_path_factory.mktemp("bench") / "Messungen"
    folder.mkdir()
    captures = pipeline.read(DEMO, motor=MOTOR)[MOTOR].captures
    for capture in captures:
        name = FILES.get(Path(capture.path).stem)
        if name:
            (folder / f"{name}.csv").write_bytes(_german(capture).encode("latin-1"))
    return folder


def test_from_the_first_look_to_a_datasheet_in_two_commands(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the data cannot give (the nameplate) is answered on the command line, once."""
    place, output = tmp_path / "bench3.yaml", tmp_path / "out"
    answers = ["pole_pairs=7", "slots=12", "winding=wye"]
    assert main(["inspect", str(bench), f"map={place}", "check=true", *answers]) == 0
    told = capsys.readouterr().out
    assert "asked" not in told
    assert "Widerstand_UV_1.csv: resistance" in told
    assert "0601_Auslauf_vor.csv: spin_down" in told and "torque_coulomb_nm" in told
    maps = load_source_file(place)
    assert len(maps) == 4
    assert {part.column for one in maps.values() for part in one.fields} == set(FIELDS)
    main(
        [
            "run",
            f"input={bench}",
            f"source={place}",
            f"output={output}",
            "recordings=false",
            "residual_test=false",
        ]
    )
    assert not [f for f in _findings(output) if f["severity"] == "refused"]
    sheet = json.loads((output / "datasheets" / "0601.json").read_text())
    assert {one["test"] for one in sheet["provenance"]["captures"]} == set(TESTS.values())
    _agree(sheet)


def _findings(output: Path) -> list[dict[str, str]]:
    found = json.loads((output / "findings.json").read_text())
    return list(found["findings"] if isinstance(found, dict) else found)


def _agree(sheet: dict[str, object]) -> None:
    """The constants are those of the same captures in the contract's own form."""
    captures = pipeline.read(DEMO, motor=MOTOR)
    own = captures.campaigns[MOTOR]
    kept = tuple(c for c in own.captures if Path(c.path).stem in FILES)
    whole = pipeline.fit(type(captures)({MOTOR: type(own)(MOTOR, kept)}))
    wanted = {row["constant"]: row for row in whole.constants.iter_rows(named=True)}
    constants = sheet["constants"]
    assert isinstance(constants, dict)
    for name in ("r_phase_ohm", "psi_pm_wb", "kt_peak_nm_a", "torque_coulomb_nm", "pole_pairs"):
        found = constants[name]["value"]
        assert found == pytest.approx(wanted[name]["value"], rel=2e-3), name


def test_a_question_that_nothing_answers_is_asked(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the unit of the torque the map waits for it, and takes the answer."""
    folder = tmp_path / "one"
    folder.mkdir()
    text = (bench / "0601_Kennfeld_1.csv").read_bytes().replace(b"Moment [mNm]", b"Moment")
    (folder / "0601_Kennfeld_1.csv").write_bytes(text)
    assert main(["inspect", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "unit.Moment=  the unit of 'Moment' (torque_shaft_nm): N·m, mN·m" in told
    assert "torque_shaft_nm," not in told.split("through the map")[1].split("\n")[1]
    place = tmp_path / "x.yaml"
    assert main(["inspect", str(folder), f"map={place}", "unit.Moment=mNm"]) == 0
    assert "unit.Moment" not in capsys.readouterr().out
    (only,) = load_source_file(place).values()
    assert next(f.unit for f in only.fields if f.field == "Moment") == "mN·m"
