"""Operating points made up by hand, on which flux pairs and maps have a known answer."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.electrical.operating_points import (
    Point,
)
from tests.unit.estimation.signals import capture

P, PSI, LD, LQ, R, W = 4, 0.01, 2e-3, 3e-3, 0.5, 100.0
MAP = capture("torque_map", voltage_timing="instant", t_s=np.arange(3.0))


def point(iq, id_=0.0, *, w=W, group=0, source=MAP, period=1e-4, rows=100, u=0.0, **more):
    """A point of a motor with constant inductances; torque 1.5 p (psi + (Ld - Lq) id) iq."""
    omega = P * w
    psi_d, psi_q = PSI + LD * id_, LQ * iq
    values = {
        "group": group, "rows": rows, "omega_mech_rad_s": w, "id_a": id_, "iq_a": iq,
        "vd_v": R * id_ - omega * psi_q, "vq_v": R * iq + omega * psi_d,
        "torque_nm": 1.5 * P * (psi_d * iq - psi_q * id_), "u_vd_v": u,
        "u_vq_v": 2.0 * u, "temp_magnet_degc": 25.0, "cos_turn": 0.0, "sin_turn": 0.0,
        "period_s": period, "capture": source,
    }  # fmt: skip
    return Point(**{**values, **more})


def both(iq, id_=0.0, **more):
    return [point(iq, id_, **more), point(-iq, id_, **more)]


GRID = [*both(10.0), *both(10.0, -5.0), *both(5.0, -10.0), *both(5.0), point(0.0)]
