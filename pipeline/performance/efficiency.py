"""Torque, losses by kind and efficiency of operating points."""

from __future__ import annotations

import numpy as np

from pipeline.performance.envelope import current_for
from pipeline.performance.machine import Machine, copper_w, drag_nm, inverter_w, torque_nm
from pipeline.records.capture import Array
from pipeline.records.performance import MapCell, Operation

MAP_SPEEDS, MAP_TORQUES = 16, 12


def efficiency_map(
    machine: Machine, operation: Operation, limit_v: float, fastest: float, most_nm: float
) -> tuple[MapCell, ...]:
    """Operating points at equal steps of speed and shaft torque, those within the limits.

    Each is at the currents of least copper loss of the published constants, which all draws share:
    the interval is that of torque and losses at these currents.

    Parameters
    ----------
    machine : Machine
        Fields [n].
    operation : Operation
        The current limit, and what the inverter drops.
    limit_v : float, V
        Phase voltage, peak, at most.
    fastest, most_nm : float
        Speed [rad/s] and shaft torque [N·m] at the ends of the map.

    Returns
    -------
    tuple of MapCell

    """
    one = machine.one(0)
    omegas = np.linspace(0.0, fastest, MAP_SPEEDS + 1)[1:]
    torques = np.linspace(0.0, most_nm, MAP_TORQUES + 1)[1:]
    omega, torque = (grid.ravel() for grid in np.meshgrid(omegas, torques))
    drag = drag_nm(one, omega)[0]
    id_a, iq_a = current_for(one, torque + drag, operation.current_a, limit_v, omega)
    there = np.isfinite(iq_a)
    return point_cells(machine, operation, omega[there], id_a[there], iq_a[there])


def point_cells(
    machine: Machine, operation: Operation, omega: Array, id_a: Array, iq_a: Array
) -> tuple[MapCell, ...]:
    """Torque, losses and efficiency of operating points given by speed and currents.

    Parameters
    ----------
    machine : Machine
        Fields [n].
    operation : Operation
        For what the inverter drops.
    omega : array [m], rad/s
        Mechanical speeds, above 0.
    id_a, iq_a : array [m], A
        Currents, phase peak.

    Returns
    -------
    tuple of MapCell [m]

    Notes
    -----
    η = P_2/(P_2 + P_copper + P_drag), shaft over terminal power (IEC 60034-2-1): the inverter is
    not in it.

    """
    wide_d, wide_q = (np.broadcast_to(i, (machine.r_ohm.size, i.size)) for i in (id_a, iq_a))
    drag = drag_nm(machine, omega)
    shaft = torque_nm(machine, wide_d, wide_q) - drag
    copper, rotation = copper_w(machine, wide_d, wide_q), drag * omega
    power_w = shaft * omega
    efficiency = np.where(
        power_w > 0.0, power_w / np.maximum(power_w + copper + rotation, 1e-300), 0.0
    )
    low, high = np.percentile(efficiency[1:], [2.5, 97.5], axis=0)
    drop, ohm = operation.drop_v, operation.on_ohm
    known = drop is not None or ohm is not None
    bridge = inverter_w(drop or 0.0, ohm or 0.0, np.hypot(id_a, iq_a))
    return tuple(
        MapCell(
            float(omega[m]), float(shaft[0, m]), float(id_a[m]), float(iq_a[m]),
            float(copper[0, m]), float(rotation[0, m]), float(bridge[m]) if known else None,
            float(efficiency[0, m]), float(low[m]), float(high[m]),
        )
        for m in range(omega.size)
    )  # fmt: skip
