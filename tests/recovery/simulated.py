"""Simulated captures handed to the estimators in memory, gains drawn per seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.records.capture import Campaign
from pipeline.simulator.bench import record
from pipeline.simulator.design import Bench, Instruments, Motor
from tests.simulated import campaign_of

MOTOR = Motor(
    motor_type="recovery-150",
    pole_pairs=7,
    slots=12,
    r_phase_ohm=0.12,
    ld_h=4.0e-5,
    lq_h=6.0e-5,
    psi_pm_wb=3.1e-3,
    j_rotor_kgm2=3.0e-5,
    b_visc_nm_s_rad=1.0e-5,
    torque_coulomb_nm=3.0e-3,
    current_rated_a=12.0,
    speed_rated_rad_s=500.0,
    vdc_v=24.0,
    rth_wa_k_w=1.5,
    rth_wm_k_w=1.0,
    rth_ma_k_w=2.0,
    cth_winding_j_k=20.0,
    cth_magnet_j_k=80.0,
)
BENCH = Bench()
Plan = Sequence[tuple[str, str, Mapping[str, Any]]]


def recorded(
    plan: Plan, seed: int, motor: Motor = MOTOR, bench: Bench = BENCH
) -> tuple[Campaign, Instruments]:
    """The captures of a plan on one station, and the gains that the station really had."""
    first, *rest = np.random.SeedSequence(seed).spawn(1 + len(plan))
    instruments = bench.drawn(np.random.default_rng(first))
    fixed = replace(bench, instruments=instruments)
    recordings = [
        replace(record(test, motor, fixed, np.random.default_rng(child), **protocol), stem=stem)
        for child, (stem, test, protocol) in zip(rest, plan, strict=True)
    ]
    return campaign_of(recordings), instruments
