"""Whether electrical power less copper loss arrives at the shaft."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.crosscheck.judge import Ratio, judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.numerics.weak_rows import smooth_speed
from pipeline.physics.copper import copper_resistance_ohm
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "power_balance"
COLUMNS = ("t_s", "vd_v", "vq_v", "id_a", "iq_a", "torque_shaft_nm")
SPEEDS = ("theta_mech_rad", "omega_mech_rad_s")
SPEED_S = 0.005
BINS, LEAST_ROWS = 100, 40


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Electrical power after losses over mechanical power, over the dynamometer's test.

    Notes
    -----
    Block means of 1.5 (v_d i_d + v_q i_q) are regressed on shaft power P, dP/dt (a transducer that
    lags by τ reads P - τ dP/dt), i² (copper), |i| (inverter drop), |ω| and ω² (friction, iron), and
    on what is stored: dω²/dt (the rotor's inertia, before a transducer in the shaft), di_d²/dt and
    di_q²/dt (the field). The coefficient of shaft power is 1 in any machine, whatever it loses or
    stores, and lands on a convention's number where one is wrong. i_q ω is the instrument for shaft
    power, so that a shaft that rings does not pull it to zero, and its rate the one for dP/dt. Its
    uncertainty is that of the regression and of the gains of current, voltage and torque; the
    option `allowance` [1] is added.

    A block mean of the rate of ω² is a difference of two, whose noise pulls the inertia to zero in
    short blocks: a block is a hundredth of a capture.

    References
    ----------
    J. Durbin, Rev. Int. Stat. Inst. 22, 1954, 23 (instrumental variables), doi:10.2307/1401917.
    Newey and West, Econometrica 55(3), 1987, 703 (correlated blocks), doi:10.2307/1913610.

    """
    r_phase = constants.best("r_phase_ohm")
    captures = [c for c in campaign.of("torque_map") if c.has(*COLUMNS) and any(map(c.has, SPEEDS))]
    if not captures:
        return not_evaluated(NAME, "needs a torque_map with dq voltages, speed and shaft torque")
    blocks = np.vstack([_blocks(c, None if r_phase is None else r_phase.number) for c in captures])
    if blocks.shape[0] < LEAST_ROWS:
        return not_evaluated(NAME, "needs longer plateaus in the torque_map")
    ratio, u_fit = _slope(blocks)
    u = float(np.hypot(u_fit, abs(ratio) * np.linalg.norm(_gains(captures))))
    pairs = constants.best("pole_pairs")
    return judge_ratio(
        NAME,
        Ratio(ratio, u),
        options["allowance"],
        "electrical power after losses over mechanical power",
        "power",
        None if pairs is None else round(pairs.number),
        "gain of the torque, current, voltage or speed signal",
    )


def _gains(captures: Sequence[Capture]) -> list[float]:
    """Relative standard uncertainty of current, voltage and torque: the largest of the captures."""
    metas = [capture.meta for capture in captures]
    keys = ("u_rel_current", "u_rel_voltage", "u_rel_torque")
    return [max(meta.instrument_u(key) for meta in metas) for key in keys]


def _speed(data: Mapping[str, Array]) -> Array:
    """Shaft speed [n, rad/s]: the angle's own rate where there, else the bench's."""
    if "theta_mech_rad" not in data:
        return data["omega_mech_rad_s"]
    t_s = data["t_s"]
    width_s = max(SPEED_S, 10.0 * float(np.median(np.diff(t_s))))
    return smooth_speed(t_s, data["theta_mech_rad"], width_s)


def _blocks(capture: Capture, r_phase_ohm: float | None) -> Array:
    """Block means [n, 13]: net power; i_q omega, shaft power, a rate behind each; then i², |i|,
    |omega|, omega², rates of omega², i_d² and i_q², 1; SI.

    Copper loss at the winding's temperature is taken off where R and the temperature are known,
    so that its slow growth is not read as anything else.
    """
    speed = next(name for name in SPEEDS if capture.has(name))
    wanted = (*COLUMNS, speed, *(n for n in ("temp_winding_degc",) if capture.has(n)))
    data = capture.finite(*wanted)
    if data["t_s"].size < LEAST_ROWS:
        return np.empty((0, 13))
    i_squared = data["id_a"] ** 2 + data["iq_a"] ** 2
    power = 1.5 * (data["vd_v"] * data["id_a"] + data["vq_v"] * data["iq_a"])
    if r_phase_ohm is not None and "temp_winding_degc" in data:
        r_ohm = copper_resistance_ohm(r_phase_ohm, data["temp_winding_degc"], 25.0)
        power = power - 1.5 * r_ohm * i_squared
    omega = _speed(data)
    driving, shaft = data["iq_a"] * omega, data["torque_shaft_nm"] * omega
    columns = (
        power,
        driving,
        np.gradient(driving, data["t_s"]),
        shaft,
        np.gradient(shaft, data["t_s"]),
        i_squared,
        np.sqrt(i_squared),
        np.abs(omega),
        omega**2,
        np.gradient(omega**2, data["t_s"]),
        np.gradient(data["id_a"] ** 2, data["t_s"]),
        np.gradient(data["iq_a"] ** 2, data["t_s"]),
    )
    rows = np.column_stack([*columns, np.ones(omega.size)])
    size = max(1, rows.shape[0] // BINS)
    usable = rows[: rows.shape[0] // size * size]
    return usable.reshape(-1, size, rows.shape[1]).mean(axis=1)


def _slope(blocks: Array) -> tuple[float, float]:
    """Coefficient of shaft power, and its standard uncertainty, by the instruments in columns 1, 2.

    Sandwich with five lags (Newey and West, Econometrica 55, 1987): blocks neither scatter alike
    nor independently.
    """
    scale = np.maximum(np.abs(blocks).max(axis=0), 1e-300)
    scaled = blocks / scale
    y, x = scaled[:, 0], scaled[:, 3:]
    instruments = np.column_stack([scaled[:, 1:3], scaled[:, 5:]])
    bread = np.linalg.pinv(instruments.T @ x, rcond=1e-10)
    beta = bread @ (instruments.T @ y)
    meat = instruments * (y - x @ beta)[:, None]
    spread = meat.T @ meat
    for lag in range(1, 6):
        shifted = (1.0 - lag / 6.0) * (meat[lag:].T @ meat[:-lag])
        spread = spread + shifted + shifted.T
    unit = scale[0] / scale[3]
    u = np.sqrt(max(float((bread @ spread @ bread.T)[0, 0]), 0.0))
    return float(beta[0]) * unit, float(u) * unit


RULE = Rule(NAME, check, {"allowance": 0.02}, tests=("torque_map",))
