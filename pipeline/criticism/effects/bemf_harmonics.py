"""Magnet flux that is not a pure sine along the air gap."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values, choice


def _coenergy(x: Operating, q: Values) -> Any:
    total = 0.0
    for order in (6, 12):
        for wave, shape in zip(("cos", "sin"), x.waves(order), strict=True):
            d, quadrature = q[f"d{order}_{wave}"], q[f"q{order}_{wave}"]
            if d or quadrature:
                total = total + (d * x.id_a + quadrature * x.iq_a) * shape
    return x.base["psi_wb"] * total


def _torque(x: Operating, q: Values) -> Array:
    slope = np.zeros(x.omega_rad_s.shape)
    if q["ripple_share"] == 1.0:
        return slope
    for order in (6, 12):
        cosine, sine = x.waves(order)
        for current, axis in ((x.id_a, "d"), (x.iq_a, "q")):
            wave = q[f"{axis}{order}_sin"] * cosine - q[f"{axis}{order}_cos"] * sine
            slope = slope + order * current * wave
    ripple: Array = 1.5 * x.machine.pole_pairs * x.base["psi_wb"] * slope
    return (1.0 - q["ripple_share"]) * ripple


EFFECT = Effect(
    name="bemf_harmonics",
    words="ψ_d and ψ_q gain waves of nε, n = 6, 12; symmetric: d cos and q sin alone; ripple_share "
    "of the torque from their slope reaches the shaft's sensor",
    signature="orders 6ε and 12ε: proportional to speed in voltage, to current in torque",
    tests=("open_circuit", "torque_map"),
    of_phases=True,
    experiment="an open-circuit spin",
    headline=tuple(
        f"back-EMF that is no pure sine, {{{axis}{order}_cos & {axis}{order}_sin %}} of the flux "
        f"in wave {order} of its {axis} axis"
        for order in (6, 12)
        for axis in "qd"
    ),
    reference="Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed. (2006), ch. 4",
    parameters=(
        *(
            Parameter(f"{axis}{order}_{wave}", "1", 0.06 / order, 0.0003, low=-0.3, high=0.3)
            for order in (6, 12)
            for axis in "dq"
            for wave in ("cos", "sin")
        ),
        choice("ripple_share", (1.0, 0.0)),
    ),
    alternatives={"cogging": "a slow turn without current"},
    coenergy=_coenergy,
    torque=_torque,
)
