"""Stated constants: priors where nothing is measured, checked where something is."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from pipeline.__main__ import main
from pipeline.contracts.motor import agree
from pipeline.criticism.data.machine_scale import stated_parameters
from pipeline.crosscheck.registry import check_all
from pipeline.estimation.registry import fit_all
from pipeline.io.ingest.metadata import capture_meta
from pipeline.records.capture import Campaign
from pipeline.records.errors import CaptureError
from pipeline.records.stated import EXACT_SHARE, UNSTATED_SHARE, stated_constants
from pipeline.simulator.design import EXACT
from tests.recovery.simulated import BENCH, MOTOR, recorded

KT_NM_A = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
EXACT_BENCH = replace(BENCH, instruments=EXACT)


def drive_without_voltage() -> Campaign:
    """Current and motion alone: the inertia is known in units of Kt."""
    campaign, _ = recorded((("drive_0", "drive", {"load": 0.0}),), 5, bench=EXACT_BENCH)
    (capture,) = campaign.captures
    gone = {"vd_v", "vq_v", "torque_shaft_nm", "vdc_v", "idc_a"}
    tables = tuple(t.drop(gone & set(t.columns)) for t in capture.tables)
    return replace(campaign, captures=(replace(capture, tables=tables),))


def stating(campaign: Campaign, **texts: str) -> Campaign:
    captures = tuple(
        replace(c, meta=replace(c.meta, extra={**c.meta.extra, **texts})) for c in campaign.captures
    )
    return replace(campaign, captures=captures)


def test_a_stated_torque_constant_gives_an_inertia_that_says_so():
    alone = drive_without_voltage()
    assert not fit_all(alone, {})[0].chosen()["j_rotor_kgm2"].known
    known = fit_all(stating(alone, kt_peak_nm_a=repr(KT_NM_A), u_kt_peak_nm_a="0.0003"), {})[0]
    j, kt = known.chosen()["j_rotor_kgm2"], known.chosen()["kt_peak_nm_a"]
    assert (kt.status, kt.number, kt.u) == ("stated", KT_NM_A, 0.0003)
    low, high = j.interval()
    assert low < MOTOR.j_rotor_kgm2 < high
    # J inherits the relative error of Kt, and its source: it cancels where both are used
    share = [part.u for part in j.budget if part.source == "stated:kt_peak_nm_a"]
    assert share == pytest.approx([j.number * 0.0003 / KT_NM_A], rel=0.05)


def test_a_measured_constant_goes_before_a_stated_one():
    plan = (("open_circuit", "open_circuit", {}),)
    campaign = stating(recorded(plan, 1, bench=EXACT_BENCH)[0], psi_pm_wb="0.004")
    psi = fit_all(campaign, {})[0].chosen()["psi_pm_wb"]
    assert psi.status == "measured"
    assert psi.number == pytest.approx(MOTOR.psi_pm_wb, rel=0.01)


@pytest.mark.parametrize(
    ("factor", "status", "suspect"),
    [(1.0, "pass", None), (2.0**-0.5, "fail", "peak against rms"), (1.13, "fail", "another motor")],
)
def test_a_statement_is_held_against_the_data(factor, status, suspect):
    plan = (("open_circuit", "open_circuit", {}),)
    said = {"psi_pm_wb": repr(MOTOR.psi_pm_wb * factor), "u_psi_pm_wb": "1e-6"}
    campaign = stating(recorded(plan, 1, bench=EXACT_BENCH)[0], **said)
    constants = fit_all(campaign, {})[0]
    (found,) = [c for c in check_all(constants, campaign, {}) if c.name == "stated_constants"]
    assert found.status == status
    assert (suspect or "") in (found.suspect or "")


def test_the_configuration_goes_before_the_captures_and_the_most_frequent_before_others():
    plan = tuple((f"coast_{n}", "spin_down", {}) for n in range(3))
    campaign = recorded(plan, 1)[0]
    one, *others = campaign.captures
    odd = replace(one, meta=replace(one.meta, extra={"lq_h": "2e-3"}))
    usual = tuple(replace(c, meta=replace(c.meta, extra={"lq_h": "1e-3"})) for c in others)
    campaign = replace(campaign, captures=(odd, *usual))
    (lq,) = stated_constants(campaign)
    assert (lq.number, lq.u) == (1e-3, UNSTATED_SHARE * 1e-3)
    assert "u_lq_h is not stated" in lq.note
    (finding,) = [f for f in agree(campaign) if f.code == "statement_contradiction"]
    assert finding.file == odd.path
    (lq,) = stated_constants(replace(campaign, stated={"lq_h": 3e-3, "u_lq_h": 1e-5}))
    assert (lq.number, lq.u) == (3e-3, 1e-5)


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("kt_peak_nm_a", "0,118"),
        ("kt_peak_nm_a", "0"),
        ("psi_pm_wb", "-0.0058"),
        ("u_psi_pm_wb", "-1e-4"),
    ],
)
def test_a_statement_that_no_motor_has_is_refused(key, text):
    """A diagnosis of captures that state a negative flux linkage divided by zero."""
    texts = {"contract": "1", "motor_id": "M", "test": "drive", key: text}
    with pytest.raises(CaptureError, match=f"{key} is '{text}'; for {key} write a number from"):
        capture_meta(texts)


def test_what_is_stated_as_exact_is_a_prior_as_well():
    """A diagnosis ignored it, and asked for the torque constant that was stated."""
    stated = {"kt_peak_nm_a": 0.12, "u_kt_peak_nm_a": 0.0}
    (kt,) = stated_constants(Campaign("m", (), stated))
    prior = stated_parameters([kt], pole_pairs=4)["psi_wb"]
    assert prior == pytest.approx((0.02, EXACT_SHARE * 0.02))


def test_the_range_of_a_statement_is_the_glossary_s():
    texts = {"psi_pm_wb": "0.0058", "u_psi_pm_wb": "0", "b_visc_nm_s_rad": "-1e-6"}
    extra = capture_meta({"contract": "1", "motor_id": "M", "test": "drive", **texts}).extra
    assert extra == texts


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("constants={kt_peek_nm_a: 1}", "did you mean kt_peak_nm_a"),
        ("constants={kt_peak_nm_a: high}", "is no number"),
        ("constants={psi_pm_wb: -0.0058}", "psi_pm_wb=-0.0058 is no number from 1e-12 to 100 [Wb]"),
        ("constants={u_kt_peak_nm_a: 0.1}", "state kt_peak_nm_a as well"),
        ("constants={pole_pairs: 7}", "can be stated"),
    ],
)
def test_what_cannot_be_stated_is_said(word, said, tmp_path, capsys):
    (tmp_path / "in").mkdir()
    assert main(["run", f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}", word]) == 2
    assert said in capsys.readouterr().err


def test_a_run_publishes_it_as_stated_and_releases_nothing_on_it(tmp_path):
    import numpy as np

    from pipeline.io.storage.write_capture import Format, write_capture
    from pipeline.simulator.bench import record

    recording = record("drive", MOTOR, EXACT_BENCH, np.random.default_rng(5), load=0.0)
    (table,) = recording.tables
    kept = {n: v for n, v in table.items() if n not in ("vd_v", "vq_v", "torque_shaft_nm")}
    write_capture(tmp_path / "in", "drive", recording.meta, [kept], Format("csv"))
    words = [f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}", "release=auto"]
    stated = f"constants={{kt_peak_nm_a: {KT_NM_A}, u_kt_peak_nm_a: 0.0003}}"
    words += ["recordings=false", "report=false", "residual_test=false"]
    assert main(["run", *words, stated]) in (0, 1)
    (path,) = (tmp_path / "out" / "datasheets").glob("*.json")
    sheet = json.loads(path.read_text())
    assert sheet["constants"]["kt_peak_nm_a"]["status"] == "stated"
    assert sheet["constants"]["j_rotor_kgm2"]["value"] == pytest.approx(
        MOTOR.j_rotor_kgm2, rel=0.05
    )
    assert "stated, not measured: kt_peak_nm_a" in sheet["why"]
    assert sheet["status"] == "provisional"
