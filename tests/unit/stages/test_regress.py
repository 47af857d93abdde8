"""`regress` and `export` as a person types them: exit codes, files, one line for each mistake."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from xml.etree import ElementTree as Xml

import jsonschema
import numpy as np
import pytest

from pipeline.__main__ import main
from pipeline.contracts.json_schema import build_schemas
from pipeline.export.registry import exporters
from pipeline.io.registry.store import Registry
from pipeline.records.datasheet import Datasheet
from pipeline.records.lot_regression import LotRegression
from pipeline.records.plain_form import record_of
from tests.registered import NOON
from tests.unit.lots import production as line

THREE = ("r_phase_ohm", "psi_pm_wb", "j_rotor_kgm2")
NEW_CODE = "0.2.0+bbbbbbbbbbbb"
DAY = timedelta(days=1)


def lots() -> dict[str, list[Datasheet]]:
    """Two healthy lots, one with weak magnets, one from another station; 12 motors each."""
    rng = np.random.default_rng(1)
    made = {name: line.lot(rng, name, names=THREE, motors=12) for name in ("A", "B")}
    made["weak"] = line.lot(rng, "weak", names=THREE, motors=12, shift=-5.0, shifted="psi_pm_wb")
    made["far"] = line.lot(rng, "far", names=THREE, motors=12, station="S2")
    return made


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An output folder whose registry holds the lots, published on days of their own, and lot A
    under a newer version of the code.
    """
    folder = tmp_path_factory.mktemp("out")
    registry = Registry(str(folder / "registry"))
    for day, sheets in enumerate(lots().values()):
        registry.publish([sheet.document() for sheet in sheets], NOON + day * DAY)
    renewed = [
        replace(sheet, code_version=NEW_CODE, version=sheet.version[::-1]) for sheet in lots()["A"]
    ]
    registry.publish([sheet.document() for sheet in renewed], NOON + 9 * DAY)
    return folder


def told(
    capsys: pytest.CaptureFixture[str], output: Path, *words: str, command: str = "regress"
) -> tuple[int, str, str]:
    code = main([command, *words, f"output={output}"])
    seen = capsys.readouterr()
    return code, seen.out, seen.err


def report(output: Path) -> dict:  # type: ignore[type-arg]
    return json.loads((output / "regression" / "report.json").read_bytes())


def test_an_unchanged_lot_passes(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = told(capsys, output, "baseline=lot:A", "candidate=lot:B")
    assert (code, err) == (0, "")
    assert out.startswith("pass: Lot B")
    assert out.splitlines()[-1].endswith(f"review lot=B output={output}")
    said = report(output)
    jsonschema.Draft202012Validator(build_schemas()["lot-regression"]).validate(said)
    found = record_of(LotRegression, said)
    assert found.verdict == "pass"
    assert found.history == "INSUFFICIENT_HISTORY"
    assert {one.name for one in found.constants if one.motors} == set(THREE)


def test_weak_magnets_fail_by_name(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = told(capsys, output, "baseline=lot:A,B", "candidate=lot:weak")
    assert code == 1
    assert "psi_pm_wb" in out.splitlines()[0]
    assert "r_phase_ohm" not in out.splitlines()[0]
    root = Xml.fromstring((output / "regression" / "report.xml").read_bytes())
    failed = [
        case.attrib["name"] for case in root.iter("testcase") if case.find("failure") is not None
    ]
    assert failed == ["verdict", "psi_pm_wb"]
    assert root.attrib["failures"] == "2"
    suites = {suite.attrib["name"]: suite.attrib for suite in root}
    assert suites["constants"]["tests"] == "12"
    assert suites["constants"]["skipped"] == "9"
    page = (output / "regression" / "report.html").read_text()
    assert "psi_pm_wb" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "<svg" in page


def test_an_unreferenced_station_is_undecided(
    output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = told(capsys, output, "baseline=A", "candidate=far")
    assert code == 4
    assert "CONFOUNDED" in out
    assert report(output)["verdict"] == "CONFOUNDED"
    root = Xml.fromstring((output / "regression" / "report.xml").read_bytes())
    errors = [c.attrib["name"] for c in root.iter("testcase") if c.find("error") is not None]
    assert errors == ["verdict", *sorted(THREE, key=lambda n: list(THREE).index(n))] or set(
        errors
    ) == {"verdict", *THREE}


def test_no_margin_and_no_history_is_undecided(
    output: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = tmp_path / "bare.yaml"
    limits.write_text("required: [r_phase_ohm, psi_pm_wb]\n")
    code, out, _ = told(capsys, output, "baseline=A", "candidate=B", f"limits={limits}")
    assert code == 4
    assert out.startswith("INSUFFICIENT_HISTORY")


def test_the_code_is_compared_with_itself(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = told(capsys, output, "baseline=lot:A,code:0.1.0", "candidate=lot:A,code:0.2.0")
    assert code == 0
    assert out.startswith(f"pass: Code {NEW_CODE} gives the same datasheets")
    assert report(output)["mode"] == "code"


@pytest.mark.parametrize("mode", ["auto", "lots"])
def test_a_lot_against_itself_is_refused(
    output: Path, mode: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A typing mistake must not pass a lot; asked for by name, versions may be the same."""
    words = ("baseline=lot:B", "candidate=lot:B")
    code, out, err = told(capsys, output, *words, f"mode={mode}")
    assert (code, out) == (2, "")
    assert "holds no motor that the candidate does not" in err
    code, out, _ = told(capsys, output, *words, "mode=code")
    assert code == 0
    assert "the very same versions" in out


def test_other_values_under_new_code_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A change of 0.2 u passes, of 0.6 u is a remark, of 3 u fails; a lost constant fails."""
    for change, code, verdict in ((0.2, 0, "pass"), (0.6, 0, "marginal"), (3.0, 1, "fail")):
        folder = tmp_path / verdict
        registry = Registry(str(folder / "registry"))
        before = lots()["A"]
        after = []
        for sheet in before:
            psi = sheet.constants["psi_pm_wb"]
            moved = replace(psi, value=psi.number + change * psi.u)
            after.append(
                replace(
                    sheet,
                    constants={**sheet.constants, "psi_pm_wb": moved},
                    code_version=NEW_CODE,
                    version=sheet.version[::-1],
                )
            )
        registry.publish([sheet.document() for sheet in (*before, *after)], NOON)
        words = ("baseline=code:0.1.0", "candidate=code:0.2.0")
        assert told(capsys, folder, *words)[0] == code
        said = {one["name"]: one["verdict"] for one in report(folder)["constants"]}
        assert said["psi_pm_wb"] == verdict
        assert said["r_phase_ohm"] == "pass"


def test_the_candidate_is_no_part_of_its_baseline(
    output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = told(capsys, output, "baseline=type:gimbal,station:S1", "candidate=lot:B")
    assert code in (0, 1, 4)
    assert "on both sides, counted as candidate: 12 motors" in out
    assert sorted(report(output)["baseline"]["lots"]) == ["A", "weak"]


def test_lots_of_one_type_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Motors of another design leave the baseline; a candidate of two designs is a mistake."""
    registry = Registry(str(tmp_path / "registry"))
    made = lots()
    other = [
        line.sheet(f"X-{k}", "A", "S1", {"psi_pm_wb": 2.0}, motor_type="drone") for k in range(3)
    ]
    sheets = (*made["A"], *made["B"], *other)
    registry.publish([sheet.document() for sheet in sheets], NOON)
    code, out, _ = told(capsys, tmp_path, "baseline=lot:A", "candidate=lot:B")
    assert code == 0
    assert "left out of the baseline, of another type: 3 motors" in out
    code, _, err = told(capsys, tmp_path, "baseline=lot:B", "candidate=lot:A")
    assert code == 2
    assert "several types: drone, gimbal; add type:NAME" in err
    code, _, err = told(capsys, tmp_path, "baseline=lot:B", "candidate=lot:A,type:drone")
    assert code == 2
    assert "of type drone, the baseline of gimbal" in err


def test_golden_motors_link_a_new_station(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Station S2 reads 3 sd high. Golden motors of the limits file, three times on each station,
    make its healthy lot pass; without them it is CONFOUNDED.
    """
    rng = np.random.default_rng(5)
    registry = Registry(str(tmp_path / "registry"))
    base = line.lot(rng, "A", names=THREE, motors=12, lot_sd=0.0)
    new = line.lot(rng, "B", names=THREE, motors=12, lot_sd=0.0, station="S2", bias=3.0)
    registry.publish([sheet.document() for sheet in (*base, *new)], NOON)
    for station, bias in (("S1", 0.0), ("S2", 0.03)):
        for run in range(3):
            golden = [
                line.sheet(
                    f"G{g}",
                    None,
                    station,
                    {n: 1.0 + 0.01 * g + bias + 2e-4 * rng.standard_normal() for n in THREE},
                    run=run,
                )
                for g in range(3)
            ]
            registry.publish([sheet.document() for sheet in golden], NOON + DAY)
    limits = tmp_path / "own.yaml"
    body = "".join(f"  {name}: {{equivalence_margin: 1.5 %}}\n" for name in THREE)
    limits.write_text(f"required: []\ngolden: [G0, G1, G2]\nconstants:\n{body}")
    words = ("baseline=lot:A", "candidate=lot:B")
    code, out, _ = told(capsys, tmp_path, *words, f"limits={limits}")
    assert code == 0, out
    said = report(tmp_path)
    assert said["golden"] == ["G0", "G1", "G2"]
    gauge = said["constants"][0]["gauge"]
    assert (gauge["motors"], gauge["stations"], gauge["repeats"]) == (3, 2, 3)
    assert gauge["reproducibility"] == pytest.approx(0.03 / np.sqrt(2.0), rel=0.1)
    assert "gauge R&amp;R" in (tmp_path / "regression" / "report.html").read_text()
    limits.write_text(f"required: []\nconstants:\n{body}")
    assert told(capsys, tmp_path, *words, f"limits={limits}")[0] == 4
    assert report(tmp_path)["verdict"] == "CONFOUNDED"


def test_dates_choose_lots(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Captures without a start are of the day they were published."""
    code, _, _ = told(capsys, output, "baseline=date:2026-03-02", "candidate=date:2026-03-03")
    assert code == 1
    assert report(output)["candidate"]["lots"] == ["weak"]


def test_tags(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = f"registry={output / 'registry'}"
    assert main(["registry", "tag", "select=lot:B", "tag=golden-batch", "by=QE", place]) == 0
    assert "12 versions now bear the tag golden-batch" in capsys.readouterr().out
    code, _, _ = told(capsys, output, "baseline=lot:A", "candidate=tag:golden-batch")
    assert code == 0
    assert report(output)["candidate"]["lots"] == ["B"]
    assert main(["registry", "verify", place]) == 0
    assert main(["registry", "show", "B-0", place]) == 0
    assert "tags: golden-batch" in capsys.readouterr().out
    assert main(["registry", "untag", "select=lot:B", "tag=golden-batch", "by=QE", place]) == 0
    capsys.readouterr()
    code, _, err = told(capsys, output, "baseline=lot:A", "candidate=tag:golden-batch")
    assert code == 2
    assert "selects nothing" in err


def test_the_linter(output: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(capsys, output, "lint=true")[:2] == (
        0,
        "limits default: 12 constants, no fault\nnext: python -m pipeline regress limits=default "
        "baseline=lot:A candidate=lot:B\n",
    )
    bad = tmp_path / "bad.yaml"
    bad.write_text(
        "required: []\nconstants: {psi_pm_wb: {nominal: 1, tolerance: 3 %, minimum: 0.99},"
        " ld_h: {minimum: 2, maximum: 1}}\n"
    )
    code, out, err = told(capsys, output, "baseline=A", "candidate=B", f"limits={bad}")
    assert (code, out) == (2, "")
    assert err.splitlines() == [
        "error: limits bad: psi_pm_wb: minimum 0.99 is tighter than its design, which allows 0.97",
        "error: limits bad: ld_h: minimum 2 is not below maximum 1",
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("candidate=B",), "baseline= is missing"),
        (("baseline=A",), "candidate= is missing"),
        (("baseline=A", "candidate=Z"), "nothing is called 'Z'; there are lots A, B, far, weak"),
        (("baseline=A", "candidate=lot:Z"), "candidate=lot:Z selects nothing; there are lots A"),
        (("baseline=A", "candidate=hue:B"), "no field 'hue'; known are lot, type"),
        (("baseline=A", "candidate=B", "limits=none"), "no limits file 'none'; known are"),
        (("baseline=A", "candidate=B", "mode=x"), "no mode 'x'"),
        (("baseline=A", "candidate=B", "mode=code"), "with the same captures"),
        (("baseline=A", "candidate=B", "diagnoses=/nowhere"), "is no folder"),
        (("baseline=A", "candidate=B", "registry=/nowhere"), "no registry at /nowhere"),
        (("baseline=A", "candidate=A,B", "mode=lots"), "holds no motor that the candidate"),
    ],
)
def test_one_line_for_a_mistake(
    output: Path, words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = told(capsys, output, *words)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_equal_bytes(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = []
    for _ in range(2):
        told(capsys, output, "baseline=lot:A", "candidate=lot:weak")
        folder = output / "regression"
        made.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert made[0] == made[1]


def test_diagnoses_are_compared(
    output: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Stribeck friction in every motor of B and none of A: named, and the lot fails."""
    for name in ("A", "B"):
        for k in range(12):
            missing = ["stribeck"] if name == "B" else []
            document = {
                "schema": "model-diagnosis/1", "motor_id": f"{name}-{k}", "model": "standard",
                "verdict": "missing" if missing else "adequate", "missing": missing,
                "ranking": [{"effect": e, "parameters": {"torque_nm": {"value": 2e-3, "u": 1e-5,
                             "unit": "N·m"}}} for e in missing],
                "ladder": [], "unknown": None,
            }  # fmt: skip
            (tmp_path / f"{name}-{k}.json").write_text(json.dumps(document))
    code, out, _ = told(
        capsys, output, "baseline=lot:A", "candidate=lot:B", f"diagnoses={tmp_path}"
    )
    assert code == 1
    assert "stribeck (new in this lot)" in out.splitlines()[0]
    (one,) = report(output)["effects"]
    assert (one["name"], one["source"], one["candidate_shown"]) == ("stribeck", "diagnosis", 12)
    assert one["candidate_amplitude"] == pytest.approx(2e-3)


def test_export_needs_a_release(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = told(capsys, output, "format=csv", "motor=A-0", command="export")
    assert (code, out) == (2, "")
    assert "A-0' revision 2 is provisional, not released" in err
    place = f"registry={output / 'registry'}"
    main(["registry", "approve", "A-0", "revision=1", "by=QE", "why=checked", place])
    capsys.readouterr()
    code, out, err = told(capsys, output, "csv", "A-0", command="export")
    assert code == 0
    assert "revision 2 is newer and provisional; it is not exported" in err
    assert (output / "export" / "A-0.csv").read_text() == out, "it can be piped"
    wrote, following = err.splitlines()[-2:]
    assert wrote == f"wrote {output / 'export' / 'A-0.csv'}"
    assert following.startswith("next: ") and f"output={output}" in following
    tag = shlex.split(following.replace("by=NAME", "by=A"))
    assert told(capsys, output, *tag[tag.index("registry") + 1 : -1], command="registry")[0] == 0
    main(["registry", "revoke", "A-0", "revision=1", "by=QE", "why=doubt", place])
    capsys.readouterr()
    assert told(capsys, output, "csv", "A-0", "revision=1", command="export")[0] == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), f"format= is missing; known are {', '.join(sorted(exporters()))}"),
        (("format=tmc", "motor=A-0"), "no format 'tmc'"),
        (("format=csv",), "motor= is missing"),
        (("format=csv", "motor=nobody"), "no motor 'nobody'"),
        (("format=csv", "motor=A-0", "options.x=1"), "csv has no such option"),
        (("format=csv", "motor=A-0", "revision=one"), "is no revision"),
    ],
)
def test_export_mistakes(
    output: Path, words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = told(capsys, output, *words, command="export")
    assert (code, out) == (2, "")
    assert said in err
