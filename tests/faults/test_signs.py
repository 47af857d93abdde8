"""Turned signs and wrapped angles: refused by name, never published as a negative constant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import wrapped_angle
from pipeline.contracts.protocol import Passed
from pipeline.contracts.validate import validate
from pipeline.estimation import registry
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.errors import CaptureError
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import record
from pipeline.simulator.design import Bench
from tests.simulated import capture_of, design


def simulated(test: str) -> Capture:
    return capture_of(record(test, design("gimbal-5208"), Bench(), np.random.default_rng(4)))


def with_columns(capture: Capture, changed: Mapping[str, pl.Expr]) -> Capture:
    tables = tuple(
        t.with_columns(**{n: e for n, e in changed.items() if n in t.columns})
        for t in capture.tables
    )
    return replace(capture, tables=tables)


@pytest.mark.parametrize("test", ["resistance", "current_step", "heat_run"])
def test_a_turned_current_is_refused(test: str) -> None:
    """Every current of the wrong sign: the winding would deliver power; refused, sign named."""
    healthy = simulated(test)
    validate(healthy, {})
    turned = {name: -pl.col(name) for name in ("ia_a", "ib_a", "ic_a", "id_a", "iq_a")}
    with pytest.raises(CaptureError) as refused:
        validate(with_columns(healthy, turned), {})
    assert refused.value.code == "power_sign"
    assert "sign" in refused.value.remedy


@pytest.mark.parametrize("test", ["open_circuit", "spin_down", "cogging"])
def test_a_wrapped_angle_is_refused_with_its_rows(test: str) -> None:
    """theta_mech_rad modulo a turn: refused, with the row of the first jump."""
    healthy = simulated(test)
    validate(healthy, {})
    wrapped = with_columns(healthy, {"theta_mech_rad": pl.col("theta_mech_rad") % (2.0 * np.pi)})
    angle = wrapped.arrays("theta_mech_rad")["theta_mech_rad"]
    first = int(np.flatnonzero(np.abs(np.diff(angle)) > 3.0)[0]) + 1
    with pytest.raises(CaptureError) as refused:
        validate(wrapped, {})
    assert refused.value.code == "wrapped_angle"
    assert refused.value.rows is not None
    assert refused.value.rows[0] == first


def test_a_turn_made_while_rows_are_missing_is_no_wrap() -> None:
    """A second of a spin cut out, the shaft some turns further: not a wrapped angle."""
    healthy = simulated("open_circuit")
    table = healthy.tables[0]
    speed = float(np.max(np.abs(table["omega_mech_rad_s"].to_numpy())))
    rows = max(int(2.0 * np.pi / speed / float(table["t_s"][1] - table["t_s"][0])), 5)
    cut = pl.concat([table.head(table.height - 2 * rows), table.tail(rows)])
    gate = wrapped_angle.GATE
    assert gate.check(replace(healthy, tables=(cut,)), gate.settings()) == Passed()


def test_a_constant_out_of_its_range_is_not_published(monkeypatch: pytest.MonkeyPatch) -> None:
    """A negative resistance becomes not_identifiable, with the value and the files in the note."""

    def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
        bad = Estimate("r_phase_ohm", -0.5, "ohm", "measured", "odd", captures=("a.csv",))
        return Fit((bad,))

    odd = Estimator("odd", ("r_phase_ohm",), ("resistance",), "record it", fit)
    monkeypatch.setattr(registry, "estimators", lambda: (odd,))
    capture = Capture("a.csv", "0", "verified", CaptureMeta("m", "resistance"), ())
    known, _, failures = registry.fit_all(Campaign("m", (capture,)), {})
    (found,) = known.estimates
    assert (found.status, found.value) == ("not_identifiable", None)
    assert "-0.5" in found.note
    assert "a.csv" in found.note
    assert failures == ()
