"""Window means of the q voltage equation, of everyday drives and of torque maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pipeline.estimation.electrical.sample_hold import hold_s
from pipeline.estimation.electrical.voltage_turn import (
    Q_FLUX,
    SPEED2,
    SPEED2_CURRENT,
    TURNED,
    V_D,
)
from pipeline.estimation.policy import policy
from pipeline.numerics.shaft_log import shaft_log
from pipeline.numerics.weak_rows import LEAST_SAMPLES, WeakRows, smooth_speed, weak_rows
from pipeline.records.capture import Array, Capture, Indices

D_FLUX = "d flux"
LATE = "acceleration"
Q_TURNED = "speed times q voltage"
D_BEHIND, Q_BEHIND = "acceleration times d voltage", "acceleration times q voltage"
"""What a frame that is behind by acceleration has of each voltage."""
Q_FLUX_BENT = "q flux of high current"
D_FLUX_BENT = "d flux of high current"
CROSS_FLUX = "q flux of d current"
D_DROP = "d drop"
NEAR_ZERO = "drop near zero current"
"""What a compensation of dead time leaves: it takes the sense of a current from a sample."""


@dataclass(frozen=True, slots=True)
class VoltageRows:
    """Window means of the q voltage equation; every array is [w].

    `speed_rad_s` and `current_a` come with their products with temperature above 25 degC;
    `columns` holds the nuisances; `period_s` is that of the samples; `hold_doubt` is what
    it may matter that an inverter holds its voltage still over a centred period while the rotor
    turns (relative, of the back-EMF); `has_drop` is whether its drop is to be fitted.
    """

    captures: tuple[Capture, ...]
    capture: Indices
    cluster: Indices
    time_s: Array
    voltage_v: Array
    current_a: Array
    speed_rad_s: Array
    warm_current_k_a: Array
    warm_speed_k_rad_s: Array
    columns: Mapping[str, Array]
    period_s: float
    hold_doubt: float
    has_drop: bool = True


def voltage_rows(captures: Sequence[Capture], pole_pairs: int | None) -> VoltageRows | None:
    """The window means of all captures that have enough of them; None where none has.

    Parameters
    ----------
    captures
        Of a turning motor, with its q voltage and current.
    pole_pairs
        For period means of voltages, which are turned back to their instant; None where not known.

    """
    pieces: list[dict[str, Array]] = []
    used: list[Capture] = []
    for capture in captures:
        piece = _of_capture(capture, len(used), pole_pairs)
        if piece is not None:
            pieces.append(piece)
            used.append(capture)
    if not pieces:
        return None
    shared = set.intersection(*(set(piece) for piece in pieces))
    joined = {k: np.concatenate([p[k] for p in pieces]) for k in pieces[0] if k in shared}
    own: dict[str, Any] = {
        field.name: joined.pop(field.name) for field in fields(VoltageRows) if field.name in joined
    }
    return VoltageRows(
        captures=tuple(used),
        period_s=float(np.median(joined.pop("period"))),
        hold_doubt=float(np.sqrt(np.mean(joined.pop("hold") ** 2))),
        columns=joined,
        **own,
    )


def _of_capture(capture: Capture, index: int, pole_pairs: int | None) -> dict[str, Array] | None:
    optional = ("id_a", "vd_v", "temp_winding_degc", "temp_magnet_degc")
    log = shaft_log(capture, "vq_v", "iq_a", optional=optional)
    if log is None or log.t_s.size < 10 * LEAST_SAMPLES:
        return None
    data, t, theta, period = log.data, log.t_s, log.theta_rad, log.period_s
    window, usual = policy().inverter, 3 * LEAST_SAMPLES * period
    width = min(max(window.shortest_window_s, usual), window.longest_window_s)
    try:
        weak = weak_rows(t, max(width, (LEAST_SAMPLES + 1) * period))
        speed = smooth_speed(t, theta, max(0.005, 10.0 * period))
    except ValueError:
        return None
    v_d, v_q = _instant(capture, data, speed, pole_pairs, period)
    columns = {
        "capture": np.full(weak.count, index),
        "cluster": weak.clusters(policy().evidence.cluster_s, index),
        "time_s": weak.centres_s,
        "voltage_v": weak.integral(v_q),
        **_integrals(weak, data, theta, speed),
        "zero": np.ones(weak.count),
        "period": np.full(weak.count, period),
        "hold": np.full(weak.count, _hold_doubt(capture, speed, pole_pairs, period)),
    }
    if v_d is not None:
        columns[TURNED] = weak.integral(speed * v_d)
        columns[V_D] = weak.integral(v_d)
        columns[Q_TURNED] = weak.integral(speed * v_q)
        gathers = np.gradient(speed, t)
        columns[D_BEHIND] = weak.integral(gathers * v_d)
        columns[Q_BEHIND] = weak.integral(gathers * v_q)
    return columns


def _integrals(
    weak: WeakRows, data: Mapping[str, Array], theta: Array, speed: Array
) -> dict[str, Array]:
    """Columns of the q-axis voltage equation, each as its integral over a window."""
    t, i_q = data["t_s"], data["iq_a"]
    i_d = data.get("id_a", np.zeros(t.size))
    winding = data.get("temp_winding_degc", np.full(t.size, 25.0)) - 25.0
    rotor = data.get("temp_magnet_degc", np.full(t.size, 25.0)) - 25.0
    modulus = np.hypot(i_d, i_q)
    noise = 0.02 * float(np.max(modulus)) if modulus.size else 0.0
    integrals = {
        "current_a": weak.integral(i_q),
        "speed_rad_s": weak.integral(theta, 1),
        "warm_current_k_a": weak.integral(i_q * winding),
        "warm_speed_k_rad_s": weak.integral(speed * rotor),
        "inductive": weak.integral(i_q, 1),
        "drop": weak.integral(i_q / np.sqrt(modulus**2 + noise**2 + 1e-300)),
        NEAR_ZERO: weak.integral(noise * i_q / (modulus**2 + noise**2 + 1e-300)),
        "cross flux": weak.integral(speed * i_q**2),
        Q_FLUX: weak.integral(speed * i_q),
        SPEED2: weak.integral(speed**2),
        SPEED2_CURRENT: weak.integral(speed**2 * i_q),
        LATE: weak.integral(theta, 2),
    }
    if "id_a" in data:
        integrals[D_FLUX] = weak.integral(speed * i_d)
        integrals["d current"] = weak.integral(i_d)
        integrals["d inductive"] = weak.integral(i_d, 1)
        integrals[D_DROP] = weak.integral(i_d / np.sqrt(modulus**2 + noise**2 + 1e-300))
        integrals[Q_FLUX_BENT] = weak.integral(speed * i_q * modulus**2)
        integrals[D_FLUX_BENT] = weak.integral(speed * i_d**2)
        integrals[CROSS_FLUX] = weak.integral(speed * i_d * i_q)
    return integrals


def _instant(
    capture: Capture,
    data: Mapping[str, Array],
    speed: Array,
    pole_pairs: int | None,
    period_s: float,
) -> tuple[Array | None, Array]:
    """Voltages at the sampling instant: period means turned back and undamped (needs p)."""
    timing = capture.meta.voltage_timing
    v_d, v_q = data.get("vd_v"), data["vq_v"]
    if timing == "instant" or pole_pairs is None:
        return v_d, v_q
    fastest = pole_pairs * float(np.max(np.abs(speed)))
    half = 0.5 * pole_pairs * speed * hold_s(capture.meta, period_s, fastest)
    damping = np.sinc(half / np.pi)
    if timing == "centred" or v_d is None:
        return (None if v_d is None else v_d / damping), v_q / damping
    turned = (v_d + 1j * v_q) * np.exp(-1j * half) / damping
    return np.real(turned), np.imag(turned)


def _hold_doubt(capture: Capture, speed: Array, pole_pairs: int | None, period_s: float) -> float:
    """(1/cos(w T / 2) - 1)/sqrt(3) at the rms speed: polygon or circle, rectangular (GUM 4.3.7)."""
    if capture.meta.voltage_timing != "centred":
        return 0.0
    omega = (pole_pairs or 1) * np.abs(speed)
    held = hold_s(capture.meta, period_s, float(np.max(omega)))
    half = 0.5 * float(np.sqrt(np.mean(omega**2))) * held
    return float((1.0 / np.cos(min(half, 1.0)) - 1.0) / np.sqrt(3.0))
