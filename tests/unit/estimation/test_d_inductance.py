"""d inductance of a drive log whose d current moves, where no test at standstill gives it."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.estimate import Estimate

PAIRS, R_OHM, LD_H, LQ_H, PSI_WB = 4, 0.3, 8e-4, 1.3e-3, 0.03
T_S = np.arange(24000) * 5e-4


def log(weakening_a: float, warming: float = 0.0) -> Estimate:
    """What a drive gives whose d current goes down to -`weakening_a` as the speed rises.

    The magnet loses a share `warming` of its flux over the log, which no column shows.
    """
    rng = np.random.default_rng(6)
    speed = 120.0 * np.sin(1.3 * T_S) + 40.0 * np.sin(0.31 * T_S)
    angle = np.cumsum(speed) * 5e-4
    fast = np.abs(speed) / np.max(np.abs(speed))
    # a controller takes more of it as the link sags over the log
    i_d = -weakening_a * np.maximum(fast - 0.4, 0.0) * (1.0 + T_S / T_S[-1])
    i_q = 8.0 * np.sin(2.1 * T_S) + 2.0 * np.sign(speed)
    omega = PAIRS * speed
    flux = PSI_WB * (1.0 - warming * T_S / T_S[-1])
    v_d = R_OHM * i_d + LD_H * np.gradient(i_d, T_S) - omega * LQ_H * i_q
    v_q = R_OHM * i_q + LQ_H * np.gradient(i_q, T_S) + omega * (LD_H * i_d + flux)
    columns = {"t_s": T_S, "theta_mech_rad": angle, "id_a": i_d, "iq_a": i_q}
    columns |= {"vd_v": v_d, "vq_v": v_q}
    noise = {"id_a": 0.02, "iq_a": 0.02, "vd_v": 0.05, "vq_v": 0.05}
    table = pl.DataFrame(
        {
            n: x + rng.normal(0.0, noise[n], T_S.size) if n in noise else x
            for n, x in columns.items()
        }
    )
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS, u_rel_current=1e-3, u_rel_voltage=1e-3)
    capture = Capture("log.csv", "0" * 64, "verified", meta, (table,))
    known, _, _ = fit_all(Campaign("m", (capture,)), {}, only=frozenset({"ld_h"}))
    return next(e for e in known.all_of("ld_h") if e.method == "d_inductance")


@pytest.mark.parametrize("warming", [0.0, 0.04])
def test_field_weakening_gives_the_d_inductance_within_its_interval(warming: float) -> None:
    """So it does while the magnet warms and nobody logs it: its flux may drift."""
    found = log(12.0, warming)
    assert found.status == "measured"
    assert found.number == pytest.approx(LD_H, rel=0.02)
    assert abs(found.number - LD_H) < 2.0 * found.u < 0.2 * LD_H
    assert f"rests on the {PAIRS} pole pairs that the captures state" in found.note


def test_the_less_it_explains_the_more_other_effects_count() -> None:
    """By the share of the voltage that it alone explains; where they may be all, it is withheld."""
    parts = [
        {p.source: p.u / e.number for p in e.budget}["assumed:unmodelled_voltage:d"]
        for e in (log(12.0), log(6.0))
    ]
    assert parts[1] == pytest.approx(2.0 * parts[0], rel=0.05)
    found = log(3.0)
    assert found.status == "not_identifiable"
    assert "let it change more, at speed" in found.note


def test_a_d_current_that_stands_still_is_none() -> None:
    assert log(0.0).status == "not_identifiable"
