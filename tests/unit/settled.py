"""Tables of settled points of a shaft that turns, by the steady equations of a motor."""

from __future__ import annotations

import numpy as np
import polars as pl

from pipeline.records.capture import Capture, CaptureMeta

R_OHM, LD_H, LQ_H, PSI_WB, PAIRS = 0.4, 2.1e-3, 4.3e-3, 0.05, 4
COULOMB_NM, VISCOUS = 0.08, 4e-4
KT = 1.5 * PAIRS * PSI_WB


def settled(
    test: str = "torque_table",
    *,
    speeds=(40.0, 110.0, 230.0, -40.0, -110.0, -230.0),
    clock: bool = False,
    load_share: float = 0.0,
    windage: float = 0.0,
    knee_a: float = 0.0,
    volts: float = 5e-3,
    seed: int = 1,
    **meta,
) -> Capture:
    """One row a point, in random order."""
    rng = np.random.default_rng(seed)
    grid = np.meshgrid(speeds, np.linspace(-9.0, 9.0, 7), (0.0, -3.0, -6.0))
    w, i_q, i_d = rng.permutation(np.column_stack([one.ravel() for one in grid])).T
    i_d, i_q, w = (one + 2e-3 * scale * rng.normal(size=one.size)
                   for one, scale in ((i_d, 9.0), (i_q, 9.0), (w, 40.0)))  # fmt: skip
    bent = knee_a * np.arctan(i_q / knee_a) if knee_a else i_q
    psi_d, psi_q = PSI_WB + LD_H * i_d, LQ_H * bent
    air_gap = 1.5 * PAIRS * (psi_d * i_q - psi_q * i_d)
    dry = (COULOMB_NM + load_share * np.abs(air_gap)) * np.sign(w)
    torque = air_gap - dry - VISCOUS * w - windage * w * np.abs(w)
    noise = rng.normal(size=(3, w.size))
    columns = {
        **({"t_s": np.arange(w.size) * 1.0} if clock else {}),
        "omega_mech_rad_s": w,
        "id_a": i_d,
        "iq_a": i_q,
        "vd_v": R_OHM * i_d - PAIRS * w * psi_q + volts * noise[0],
        "vq_v": R_OHM * i_q + PAIRS * w * psi_d + volts * noise[1],
        "torque_shaft_nm": torque + 1e-3 * noise[2],
        "temp_winding_degc": np.full(w.size, 25.0),
        "temp_magnet_degc": np.full(w.size, 25.0),
    }
    known = {"voltage_kind": "measured", "u_rel_current": 1e-3, "u_rel_voltage": 1e-3,
             "u_rel_torque": 1e-3, "u_temp_degc": 0.5, "pole_pairs": PAIRS}  # fmt: skip
    plate = CaptureMeta("m", test, **{**known, **meta})
    return Capture("table.csv", "0" * 64, "verified", plate, (pl.DataFrame(columns),))
