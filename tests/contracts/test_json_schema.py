"""The published schemas are those the code builds, and documents of the records pass them."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

from pipeline.contracts.json_schema import build_schemas
from pipeline.io.storage.publish import canonical_json
from pipeline.records.comparison import Comparison, Dependence, Move, SignalError
from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.errors import CaptureError
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.finding import Finding
from pipeline.records.model_verdict import Excess, ModelVerdict
from pipeline.records.uncertainty import type_a, type_b
from pipeline.stages.schemas import build
from tests.unit.ladders import make_diagnosis, make_map

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"


def validator(stem: str) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(build_schemas()[stem])


def complaints(stem: str, document: object) -> list[str]:
    return [e.json_path for e in validator(stem).iter_errors(document)]


def needs_every_key(stem: str, document: dict) -> None:
    """Without any one key of the contract's example it complains; names in maps are free."""
    places = [document]
    while places:
        place = places.pop()
        for key in list(place):
            value = place.pop(key)
            assert complaints(stem, document), key
            place[key] = value
            if key not in ("parameters", "signals"):
                values = value if isinstance(value, list) else [value]
                places += [one for one in values if isinstance(one, dict)]


@pytest.fixture
def datasheet() -> Datasheet:
    """A datasheet with one constant of every status, and checks of two."""
    budget = type_a("scatter:resistance:fit", 1e-4, 40.0) + type_b("voltage@rig-1", 3e-4)
    constants = {
        "r_phase_ohm": Estimate(
            "r_phase_ohm",
            0.31,
            "ohm",
            "measured",
            "resistance",
            budget,
            {"temp_degc": 25.0},
            ("a",),
        ),
        "pole_pairs": Estimate("pole_pairs", 7, "1", "measured", "open_circuit"),
        "tau_elec_s": Estimate("tau_elec_s", 9e-4, "s", "derived", "derived", bounds=(0.0, 1.0)),
        "j_rotor_kgm2": not_identifiable(
            "j_rotor_kgm2", "kg·m²", "spin_down", "record a spin-down"
        ),
        "my_own_nm": Estimate("my_own_nm", -0.1, "N·m", "measured", "plug_in"),
    }
    checks = (
        Check("kt_vs_ke", "fail", "Kt over 1.5 p psi", 1.1547, 0.01, "1", "1.1547: 2/sqrt(3)"),
        Check("power_balance", "not_evaluated", "needs a torque_map"),
    )
    return Datasheet(
        motor_id="0001",
        motor_type=None,
        lot="A",
        version="a" * 64,
        status="refused",
        why=("check kt_vs_ke failed",),
        captures=(CaptureReference("a/b.csv", "0" * 64, "resistance", "verified"),),
        config_sha256="b" * 64,
        code_version="0.1.0+123",
        constants=constants,
        alternatives=(constants["r_phase_ohm"],),
        checks=checks,
    )


def test_committed_is_built() -> None:
    """After a change of the glossary or the records: `python -m pipeline schemas`."""
    for name, content in build().items():
        assert (ROOT / name).read_bytes() == content, f"{name} is stale"
    stems = {path.name for path in (ROOT / "pipeline/contracts/json").iterdir()}
    assert stems == {f"{stem}.schema.json" for stem in build_schemas()}


def test_schemas_are_schemas() -> None:
    for stem, schema in build_schemas().items():
        jsonschema.Draft202012Validator.check_schema(schema)
        number = schema["properties"]["schema"]["const"]
        assert number == f"{stem}/1", stem


@pytest.mark.parametrize("worst", [None, Excess("a.mcap", "vd_v", 84, 76.0, 0.1, "V")])
def test_a_datasheet_with_its_model_passes(datasheet: Datasheet, worst: Excess | None) -> None:
    """One of before the residual test has none, and passes as well."""
    found = ModelVerdict("missing", held_out=31.0, residual=76.0, worst=worst, over=1)
    document = json.loads(canonical_json(replace(datasheet, model=found).document()))
    assert complaints("motor-datasheet", document) == []
    document["model"]["verdict"] = "fine"
    assert "$.model.verdict" in complaints("motor-datasheet", document)
    del document["model"]
    assert complaints("motor-datasheet", document) == []


def test_datasheet_passes(datasheet: Datasheet) -> None:
    document = json.loads(canonical_json(datasheet.document()))
    assert complaints("motor-datasheet", document) == []


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        (("constants", "r_phase_ohm", "unit"), "mohm", "$.constants.r_phase_ohm.unit"),
        (("constants", "r_phase_ohm", "value"), None, "$.constants.r_phase_ohm.value"),
        (("constants", "r_phase_ohm", "value"), -0.3, "$.constants.r_phase_ohm.value"),
        (("constants", "pole_pairs", "value"), 7.5, "$.constants.pole_pairs.value"),
        (("constants", "j_rotor_kgm2", "value"), 1e-5, "$.constants.j_rotor_kgm2.value"),
        (("constants", "my_own_nm", "u"), -1.0, "$.constants.my_own_nm.u"),
        (("status",), "approved", "$.status"),
        (("checks", 0, "status"), "ok", "$.checks[0].status"),
        (("provenance", "captures", 0, "sha256"), "00", "$.provenance.captures[0].sha256"),
        (("provenance", "captures", 0, "test"), "burn_in", "$.provenance.captures[0].test"),
        (("motor_id",), 1, "$.motor_id"),
        (("version",), None, "$.version"),
    ],
)
def test_a_wrong_datasheet_does_not(
    datasheet: Datasheet, path: tuple[str | int, ...], value: object, where: str
) -> None:
    document = copy.deepcopy(json.loads(canonical_json(datasheet.document())))
    place = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    assert where in complaints("motor-datasheet", document)


@pytest.mark.parametrize(
    "key", ["schema", "motor_id", "version", "provenance", "constants", "checks"]
)
def test_a_key_of_the_contract_is_required(datasheet: Datasheet, key: str) -> None:
    document = datasheet.document()
    del document[key]
    assert complaints("motor-datasheet", document)


def test_findings_pass() -> None:
    refusal = CaptureError("missing_column", "spin_down needs omega_mech_rad_s", "record it")
    warning = Finding("b.csv", "warning", "dropped_samples", "3 are missing", "again", (1, 9))
    findings = [Finding.refusal("a.csv", refusal), warning]
    document = {"schema": "findings/1", "findings": [f.document() for f in findings]}
    assert complaints("findings", document) == []
    document["findings"][1]["rows"] = [1]
    assert complaints("findings", document) == ["$.findings[1].rows"]


def test_comparison_of_the_contract_passes() -> None:
    """The example of the contract, filled in by hand."""
    document = {
        "schema": "model-comparison/1",
        "motor_id": "m",
        "model": {
            "name": "standard",
            "effects": ["coulomb_friction"],
            "parameters": {
                "r_phase_ohm": {"value": 0.3, "u": 1e-3, "unit": "ohm", "at_bound": False}
            },
        },
        "errors": [
            {
                "signal": "vq_v",
                "capture": "drive_0.mcap",
                "split": "held_out",
                "rmse": 0.02,
                "noise_floor": 0.01,
                "n": 1000,
                "n_eff": 200.5,
            }
        ],
        "total": {"held_out": 2.0},
        "where": [{"signal": "vq_v", "variable": "iq_a", "explained": 0.4, "p_value": 1e-9}],
    }
    assert complaints("model-comparison", document) == []
    needs_every_key("model-comparison", document)
    document["errors"][0]["split"] = "test"
    document["where"][0]["explained"] = 1.2
    assert complaints("model-comparison", document) == ["$.errors[0].split", "$.where[0].explained"]


def test_diagnosis_of_the_contract_passes() -> None:
    """The example of the contract, filled in by hand."""
    document = {
        "schema": "model-diagnosis/1",
        "motor_id": "m",
        "model": "standard",
        "verdict": "unknown",
        "missing": ["saturation"],
        "ranking": [
            {
                "effect": "saturation",
                "score": 0.9,
                "held_out_drop": 0.7,
                "p_value": 1e-9,
                "confused_with": [],
                "explanation": "flux bends with current",
                "experiment": "torque map to rated current",
            }
        ],
        "ladder": [{"effects": [], "held_out": 5.0, "signals": {"vq_v": 0.3}}],
        "unknown": {
            "signal": "torque_shaft_nm",
            "variables": ["omega_mech_rad_s"],
            "shape": "a hump",
            "sketch": [{"term": "omega", "coefficient": -1e-3, "unit": "N·m·s/rad"}],
        },
    }
    assert complaints("model-diagnosis", document) == []
    needs_every_key("model-diagnosis", document)
    assert complaints("model-diagnosis", document | {"unknown": None}) == []
    assert complaints("model-diagnosis", document | {"verdict": "fine"}) == ["$.verdict"]


@pytest.mark.parametrize("campaign", ["P0", "P1", "P4"])
def test_truth_of_the_rig_passes(campaign: str) -> None:
    """The rig's truth, which this project did not write; it has no `schema` key of its own."""
    path = DATA / "rig" / campaign / "truth.json"
    if not path.is_file():
        pytest.skip(f"needs {path.name} of the shared rig data")
    document = json.loads(path.read_text()) | {"schema": "motor-truth/1"}
    assert complaints("motor-truth", document) == []


def test_a_diagnosis_and_a_comparison_as_written_pass() -> None:
    """Records with maps, parameters and free runs, and what is wrong with a spoilt map."""
    diagnosis = json.loads(json.dumps(make_diagnosis(unknown=True).document(), allow_nan=False))
    assert complaints("model-diagnosis", diagnosis) == []
    diagnosis["ladder"][0]["maps"][0]["explained"] = 2.0
    assert complaints("model-diagnosis", diagnosis) == ["$.ladder[0].maps[0].explained"]
    errors = (
        SignalError("iq_a", "a.mcap", "held_out", 0.02, 0.01, 10, 9.0, "A", "free_run"),
        SignalError("id_a", "a.mcap", "held_out", 0.02, 0.01, 10, 9.0, "A", "free_run"),
    )
    where = (Dependence("vq_v", "iq_a", 0.8, None), Dependence("v_pair_v", "t_s", 0.1, 0.5))
    moved = (Move("r_ohm", "ohm", 0.32, 0.001, 0.31, 0.001),)
    result = Comparison(
        "m", "standard", (), {}, errors, 2.0, where, (), (make_map(1.0),), moved, 20.0
    )
    document = json.loads(json.dumps(result.document(), allow_nan=False))
    assert complaints("model-comparison", document) == []
    # signals that the contract does not name stand aside
    assert [e["signal"] for e in document["errors"]] == ["iq_a"]
    assert [e["signal"] for e in document["errors_other"]] == ["id_a"]
    assert document["moved"][0]["change_in_u"] == pytest.approx(-10.0)
