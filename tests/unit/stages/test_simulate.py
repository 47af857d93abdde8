"""`simulate`: what is typed, what is written, and that the demo is what its file says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.records.errors import UsageError
from pipeline.settings import SimulateSettings, configuration_folder
from pipeline.simulator.catalogue import fleet_from, motor_from, with_effects
from pipeline.stages import simulate

ROOT = Path(__file__).resolve().parents[3]


def document(kind: str, name: str) -> dict:
    return load_plain((configuration_folder() / kind / f"{name}.yaml").read_bytes(), name)


def captures(folder: Path) -> dict:
    found = survey(folder, {})
    assert [f for f in found.findings if f.severity == "refused"] == []
    return {entry.path: read_capture(folder, entry) for entry in found.entries}


def test_one_motor_is_written_with_its_truth(tmp_path):
    settings = SimulateSettings(
        output=str(tmp_path), motor="joint-11p", effects="[cogging=0.03, dead_time]", seed=5
    )
    assert simulate.main(settings).exit_code == 0
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert truth["hidden"] == ["cogging", "dead_time"]
    assert truth["constants"]["cogging_order"] == 264
    assert truth["constants"]["cogging_amplitude_nm"] == pytest.approx(0.03, rel=1e-9)
    written = captures(tmp_path)
    assert len(written) == 26
    assert {c.integrity for c in written.values()} == {"verified"}
    assert {c.meta.motor_id for c in written.values()} == {"joint-11p-5"}
    again = tmp_path / "again"
    simulate.main(SimulateSettings(**{**vars(settings), "output": str(again)}))
    for path in sorted(tmp_path.glob("*.*")):
        assert path.read_bytes() == (again / path.name).read_bytes(), path.name


@pytest.mark.parametrize("encoding", ["csv", pytest.param("cdr_samples", marks=pytest.mark.slow)])
def test_an_encoding_for_all(encoding, tmp_path):
    settings = SimulateSettings(output=str(tmp_path), encoding=encoding, exact=True)
    simulate.main(settings)
    suffixes = {p.suffix for p in tmp_path.iterdir() if p.stem not in ("lcr", "flux_map", "truth")}
    assert suffixes == ({".csv"} if encoding == "csv" else {".mcap"})


def test_an_earlier_motor_leaves_no_captures_behind(tmp_path, monkeypatch):
    """The second is recorded in another encoding, so that other files would stay."""
    every = simulate.single
    monkeypatch.setattr(simulate, "single", lambda s: [(*m, p[:8]) for *m, p in every(s)])
    (tmp_path / "notes.txt").write_text("mine")
    for number, encoding in enumerate(("json", "csv")):
        simulate.main(SimulateSettings(output=str(tmp_path), encoding=encoding, seed=number))
    assert {c.meta.motor_id for c in captures(tmp_path).values()} == {"gimbal-5208-1"}
    assert (tmp_path / "notes.txt").is_file()


def test_a_seed_below_0_is_named(tmp_path):
    with pytest.raises(UsageError, match=r"seed=-1; it must be 0 or more"):
        simulate.main(SimulateSettings(output=str(tmp_path), seed=-1))
    assert list(tmp_path.iterdir()) == []


def test_captures_that_were_not_simulated_are_not_written_over(tmp_path):
    (tmp_path / "lcr.csv").write_text("mine")
    with pytest.raises(UsageError, match=r"holds lcr\.csv, and no truth\.json"):
        simulate.main(SimulateSettings(output=str(tmp_path)))
    assert [path.name for path in tmp_path.iterdir()] == ["lcr.csv"]


def test_effects_as_typed():
    base = motor_from(document("motor", "gimbal-5208"))
    assert with_effects(base, "").effects == base.effects
    motor = with_effects(
        base, "[saturation, saturation.size_d=0.02, dead_time = 0.3]".replace(" = ", "=")
    )
    assert motor.effects["saturation"] == {"size_d": 0.02}
    assert motor.effects["dead_time"] == {"size": 0.3}
    assert len(with_effects(base, "eddy_brake=2").extras) == 1
    assert with_effects(base, "current_offset=-0.1").effects["current_offset"] == {"size": -0.1}
    for wrong, said in (
        ("ghost", "no effect ghost"),
        ("dead_time=x", "dead_time=x"),
        ("cogging.depth=1", "no parameter depth"),
        ("cogging=-1", "cogging=-1 is below 0"),
        ("dead_time=1e999", "is no number"),
    ):
        with pytest.raises(ValueError, match=said):
            with_effects(base, wrong)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"output": ""}, "output=DIR"),
        ({"motor": "ghost"}, "no motor 'ghost'"),
        ({"fleet": "ghost"}, "no fleet 'ghost'"),
        ({"encoding": "xml"}, "no encoding"),
        ({"effects": "[ghost]"}, "no effect ghost"),
        ({"effects": "[saturation=0.95]"}, "no inverse"),
    ],
)
def test_mistakes_are_usage_errors(change, said, tmp_path):
    settings = SimulateSettings(**{"output": str(tmp_path), **change})
    with pytest.raises(UsageError, match=said):
        simulate.main(settings)


def test_motors_of_a_fleet_hang_on_the_seed_and_their_number_alone():
    words, design = document("fleet", "demo"), document("motor", "gimbal-5208")
    whole = {m.motor_id: m for m in fleet_from(words, design).motors}
    fewer = {**words, "lots": {"2026-W06": {**words["lots"]["2026-W06"], "motors": ["G52-0602"]}}}
    (alone,) = fleet_from({**fewer, "faults": {}}, design).motors
    assert alone == whole["G52-0602"]
    base = motor_from(design)
    ratios = [m.psi_pm_wb / base.psi_pm_wb for m in whole.values() if m.lot == "2026-W06"]
    assert len(set(ratios)) == 3
    assert all(abs(r - 1) < 4 * 0.004 for r in ratios)
    weaker = [m.psi_pm_wb / base.psi_pm_wb for m in whole.values() if m.lot == "2026-W14"]
    assert all(abs(r - 0.98) < 4 * 0.004 for r in weaker)
    with pytest.raises(ValueError, match="no lot holds"):
        fleet_from({**words, "faults": {"G52-9999": {"dead_time": 0.1}}}, design)
    with pytest.raises(ValueError, match="no spread in charm"):
        fleet_from({**words, "spread": {"charm": "0.1"}}, design)


FAULTY = {"G52-1402"}
EVERY = {f"G52-{lot}0{number}" for lot in ("06", "14") for number in (1, 2, 3)}


@pytest.mark.parametrize("motors", [FAULTY, pytest.param(EVERY, marks=pytest.mark.slow)])
def test_the_committed_demo_is_what_its_fleet_makes(tmp_path, monkeypatch, motors):
    """Sample for sample; another processor's rounding may move a value by a resolution step."""
    whole = simulate.fleet
    chosen = lambda settings: [job for job in whole(settings) if job[0] in motors]  # noqa: E731
    monkeypatch.setattr(simulate, "fleet", chosen)
    simulate.main(SimulateSettings(output=str(tmp_path), fleet="demo"))
    made, kept = captures(tmp_path), captures(ROOT / "data" / "demo")
    kept = {path: capture for path, capture in kept.items() if path.split("/")[0] in motors}
    assert set(made) == set(kept)
    assert len(kept) == len(motors) * 26
    for path, capture in kept.items():
        assert made[path].meta == capture.meta
        for ours, theirs in zip(made[path].tables, capture.tables, strict=True):
            assert ours.columns == theirs.columns
            for name in ours.columns:
                a, b = ours[name].to_numpy(), theirs[name].to_numpy()
                assert np.mean(a == b) > 0.99, (path, name)
                assert np.allclose(a, b, rtol=1e-3, atol=2e-3 * np.max(np.abs(b))), (path, name)
    for path in (ROOT / "data" / "demo" / motor / "truth.json" for motor in motors):
        true = json.loads(path.read_text())["constants"]
        again = json.loads((tmp_path / path.parent.name / "truth.json").read_text())["constants"]
        assert again == pytest.approx(true, rel=1e-9)
