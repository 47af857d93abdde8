"""From captures to segments: the signals that one equation needs, on one even clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Array, Machine
from pipeline.criticism.noise import rounding_step, sensor_noise
from pipeline.criticism.traces import PAD, decimated, even_clock, smoothed, thinned, travel
from pipeline.numerics.projection import Projection, projection, window_starts
from pipeline.records.capture import Campaign, Capture

Kind = Literal["dq", "shaft", "open", "terminal", "lcr", "flux_map"]
_REFERENCE_DEGC = 25.0
_WINDOW_S = 0.02
_WINDOW_SAMPLES = 40
_SMOOTHING_S = 0.05
_STEP_WINDOW_S = 0.002
_FEW = 12
_WINDOWS = 48
_WINDOWS_LOG = 32
_SMOOTHED = ("temp_winding_degc", "temp_magnet_degc")


@dataclass(frozen=True, slots=True)
class Segment:
    """One capture's signals [n] for one kind of equation, with its weak form.

    `recorded` holds capture columns on an even clock of period `ts_s`; `noise` the standard
    deviation of each one's sensor. `channels` are the equations: the recorded signal that each
    predicts. `fixed` holds numbers of the capture (`theta_elec_rad`, `ambient_k`), `meter` the
    nuisance that is its voltmeter's gain; `angle_step_rad` is the resolution of an angle whose
    noise is its rounding.
    """

    capture: str
    test: str
    kind: Kind
    instrument: str
    timing: str
    ts_s: float
    recorded: Mapping[str, Array]
    noise: Mapping[str, float]
    channels: tuple[str, ...]
    weak: Projection | None
    fixed: Mapping[str, float] = field(default_factory=dict)
    meter: str = "gain_voltage"
    angle_step_rad: float = 0.0

    @property
    def size(self) -> int:
        """Samples."""
        return int(next(iter(self.recorded.values())).size)


def segments(campaign: Campaign, machine: Machine) -> tuple[Segment, ...]:
    """Every usable capture as a segment, in path order; a capture that lacks what its test's
    equation needs is left out.
    """
    makers = {
        "torque_map": _dq,
        "drive": _dq,
        "heat_run": _dq,
        "cogging": _shaft,
        "spin_down": _shaft,
        "open_circuit": _open,
        "resistance": _terminal,
        "current_step": _terminal,
        "lcr": _lcr,
        "flux_map": _flux_map,
    }
    made = []
    for capture in campaign.captures:
        maker = makers.get(capture.meta.test)
        if maker is not None:
            segment = maker(capture, machine)
            if segment is not None and (segment.weak is None or segment.weak.starts.size):
                made.append(segment)
    return tuple(made)


def sparse(segment: Segment) -> Segment:
    """The same segment with a few of its windows only, for a first, rough fit."""
    weak = segment.weak
    if weak is None or weak.starts.size <= _FEW:
        return segment
    chosen = np.linspace(0, weak.starts.size - 1, _FEW).round().astype(np.int64)
    starts = weak.starts[chosen]
    rows = starts[:, None] - PAD + np.arange(weak.length + 2 * PAD)[None, :]
    rows = np.clip(rows, 0, segment.size - 1).ravel()
    cut = {name: column[rows] for name, column in segment.recorded.items()}
    moved = PAD + (weak.length + 2 * PAD) * np.arange(_FEW)
    few = replace(weak, starts=moved, functions=weak.functions[chosen], valid=weak.valid[chosen])
    return replace(segment, recorded=cut, weak=few)


def electrical_orders(machine: Machine) -> tuple[int, ...]:
    """Orders a turn at which electrical effects show: 1ε, 2ε, 6ε, 12ε and once a turn."""
    p = machine.pole_pairs
    return tuple(sorted({1, 2, p, 2 * p, 6 * p, 12 * p}))


def _window(period: float, size: int) -> int:
    wanted = max(round(_WINDOW_S / period), _WINDOW_SAMPLES)
    return max(min(wanted, size // 4), 8)


def _with_angle(capture: Capture, names: list[str]) -> list[str]:
    for name in ("theta_mech_rad", "theta_elec_rad", "omega_mech_rad_s"):
        if capture.has(name):
            return [*names, name]
    return names


def _shaft_angle(found: dict[str, Array], period: float, machine: Machine) -> None:
    """Puts `theta_mech_rad` [n] into the columns, from whatever tells of the angle."""
    if "theta_mech_rad" in found:
        return
    if "theta_elec_rad" in found:
        found["theta_mech_rad"] = found.pop("theta_elec_rad") / machine.pole_pairs
    elif "omega_mech_rad_s" in found:
        speed = found.pop("omega_mech_rad_s")
        found["theta_mech_rad"] = np.concatenate(
            [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * period]
        )
    else:
        found["theta_mech_rad"] = np.zeros(next(iter(found.values())).size)


def _temperatures(capture: Capture) -> list[str]:
    return [name for name in _SMOOTHED if capture.has(name)]


def _dq(capture: Capture, machine: Machine) -> Segment | None:
    if not capture.has("vd_v", "vq_v", "id_a", "iq_a"):
        return None
    names = _with_angle(capture, ["vd_v", "vq_v", "id_a", "iq_a", *_temperatures(capture)])
    turning = len(names) > 4 and any("theta" in n or "omega" in n for n in names)
    torque = capture.has("torque_shaft_nm") and turning
    names += ["torque_shaft_nm"] if torque else []
    period, found, keep = even_clock(capture, tuple(names))
    _shaft_angle(found, period, machine)
    turned = float(np.ptp(found["theta_mech_rad"]))
    channels: tuple[str, ...] = ("vd_v", "vq_v")
    if torque and turned > 0.1:
        channels += ("torque_shaft_nm",)
    size = found["vd_v"].size
    window = _window(period, size)
    orders = electrical_orders(machine) if turned > 0.1 else ()
    noise = _prepared(found, period)
    found["t_s"] = period * np.arange(size, dtype=np.float64)
    most = _WINDOWS if capture.meta.test == "torque_map" else _WINDOWS_LOG
    found["t_s"] = period * np.arange(size, dtype=np.float64)
    found, starts = thinned(found, keep, window, most)
    weak = projection(found["theta_mech_rad"], starts, window, orders)
    return _segment(capture, "dq", "drive", period, found, noise, channels, weak)


def _segment(
    capture: Capture,
    kind: Kind,
    instrument: str,
    period: float,
    found: Mapping[str, Array],
    noise: Mapping[str, float],
    channels: tuple[str, ...],
    weak: Projection | None,
    **fixed: float,
) -> Segment:
    stated = capture.meta.ambient_degc
    ambient = 0.0 if stated is None else stated - _REFERENCE_DEGC
    timing = capture.meta.voltage_timing
    return Segment(
        capture.path,
        capture.meta.test,
        kind,
        instrument,
        timing,
        period,
        found,
        noise,
        channels,
        weak,
        {"ambient_k": ambient, **fixed},
        "gain_commanded" if capture.meta.voltage_kind == "commanded" else "gain_voltage",
        rounding_step(found["theta_mech_rad"]) if "theta_mech_rad" in found else 0.0,
    )


def _prepared(found: dict[str, Array], period: float) -> dict[str, float]:
    """Noise of every column; smooths the temperatures and adds the travel since a reversal."""
    noise = {n: sensor_noise(column, n.startswith("theta")) for n, column in found.items()}
    width = max(2 * round(_SMOOTHING_S / period) + 1, 51)
    for name in _SMOOTHED:
        if name in found:
            found[name] = smoothed(found[name], width)
            noise[name] /= math.sqrt(width)
    if "theta_mech_rad" in found:
        found["travel_rad"] = travel(found["theta_mech_rad"], period)
    return noise


def _shaft(capture: Capture, machine: Machine) -> Segment | None:
    names = _with_angle(capture, [])
    if not names:
        return None
    if capture.meta.test == "cogging":
        if not capture.has("torque_shaft_nm"):
            return None
        names = [*names, "torque_shaft_nm"]
    period, found, keep = even_clock(capture, tuple(names))
    _shaft_angle(found, period, machine)
    channel = "torque_shaft_nm" if "torque_shaft_nm" in found else "omega_mech_rad_s"
    if capture.meta.test == "cogging":
        return _slow_turn(capture, machine, period, found, keep, channel)
    window = _window(period, keep.size)
    noise = _prepared(found, period)
    weak = projection(found["theta_mech_rad"], window_starts(keep, window), window, ())
    return _segment(capture, "shaft", "bench", period, found, noise, (channel,), weak)


def slow_orders(machine: Machine) -> tuple[int, ...]:
    """Orders a turn looked at in a slow turn."""
    seen = set(electrical_orders(machine)) | set(machine.torque_orders)
    if machine.slots:
        cogging = math.lcm(machine.slots, 2 * machine.pole_pairs)
        seen |= {machine.slots, cogging, 2 * cogging}
    return tuple(sorted(seen))


def _slow_turn(
    capture: Capture,
    machine: Machine,
    period: float,
    found: dict[str, Array],
    keep: NDArray[np.bool_],
    channel: str,
) -> Segment | None:
    orders = slow_orders(machine)
    theta = found["theta_mech_rad"]
    turns = float(np.ptp(theta)) / (2 * math.pi)
    if turns <= 0.0:
        return None
    factor = max(int(theta.size / turns / (24 * max(orders))), 1)
    noise = {n: sensor_noise(c, n.startswith("theta")) for n, c in found.items()}
    noise = {n: sigma / math.sqrt(factor) for n, sigma in noise.items()}
    found = {name: decimated(column, factor) for name, column in found.items()}
    found["travel_rad"] = travel(found["theta_mech_rad"], period * factor)
    keep = decimated(keep.astype(float), factor) > 0.999
    keep[:1] = keep[-1:] = False
    size = keep.size
    window = max(int(size / round(turns)), 8) if turns > 1.2 else size - 2
    window = min(window, size - 2)
    # the first and the last sample have no neighbours
    starts = 1 + window_starts(keep[1:-1], window)
    weak = projection(found["theta_mech_rad"], starts, window, orders, cycles=0.9, margin=12.0)
    return _segment(capture, "shaft", "bench", period * factor, found, noise, (channel,), weak)


def _open(capture: Capture, machine: Machine) -> Segment | None:
    lines = [n for n in ("vab_v", "vbc_v", "vca_v") if capture.has(n)]
    if len(lines) < 2:
        return None
    extra = ["temp_magnet_degc"] if capture.has("temp_magnet_degc") else []
    names = _with_angle(capture, [*lines, *extra])
    if len(names) == len(lines) + len(extra):
        return None
    period, found, keep = even_clock(capture, tuple(names))
    _shaft_angle(found, period, machine)
    window = _window(period, keep.size)
    noise = _prepared(found, period)
    found, starts = thinned(found, keep, window, _WINDOWS)
    weak = projection(found["theta_mech_rad"], starts, window, electrical_orders(machine))
    weak = weak.only(_steady(weak, found["theta_mech_rad"]))
    return _segment(capture, "open", "bench", period, found, noise, ("vd_v", "vq_v"), weak)


def _terminal(capture: Capture, _: Machine) -> Segment | None:
    pair = capture.meta.pair
    if pair is None or not capture.has(f"v{pair}_v"):
        return None
    current = next((n for n in (f"i{pair[0]}_a", f"i{pair[1]}_a") if capture.has(n)), None)
    if current is None:
        return None
    sign = 1.0 if current[1] == pair[0] else -1.0
    extra = ["temp_winding_degc"] if capture.has("temp_winding_degc") else []
    period, found, keep = even_clock(capture, (f"v{pair}_v", current, *extra))
    volts, amps = found.pop(f"v{pair}_v"), sign * found.pop(current)
    found = {"v_pair_v": volts, "i_pair_a": amps, **found}
    noise = _prepared(found, period)
    fixed = {"pair_rad": _PAIR_RAD[pair], "phase": float("abc".index(current[1]))}
    if capture.meta.test == "current_step":
        if capture.meta.theta_elec_deg is None:
            return None
        fixed["theta_elec_rad"] = math.radians(capture.meta.theta_elec_deg)
        edges = np.abs(np.diff(volts)) > 8 * noise["v_pair_v"]
        keep[:-1] &= ~edges
        keep[1:] &= ~edges
        window = max(min(round(_STEP_WINDOW_S / period), keep.size // 4), 8)
    else:
        window = _window(period, keep.size)
    weak = projection(np.zeros(keep.size), window_starts(keep, window), window, ())
    if capture.meta.test == "resistance":
        weak = _settled(weak, amps, noise["i_pair_a"])
    return _segment(
        capture, "terminal", "bench", period, found, noise, ("v_pair_v",), weak, **fixed
    )


def _steady(weak: Projection, theta: Array) -> NDArray[np.bool_]:
    """The windows [W] of constant speed, which an open-circuit test is made of; all if too few.

    An instantaneous voltage sample at a kink of the speed belongs to neither side of it.
    """
    half = weak.length // 2
    first = theta[weak.starts + half] - theta[weak.starts]
    second = theta[weak.starts + 2 * half - 1] - theta[weak.starts + half - 1]
    calm = np.abs(second - first) < 2e-3 * np.abs(first + second)
    return calm if calm.sum() >= 8 else np.ones(calm.size, dtype=bool)


_PAIR_RAD = {"ab": 0.0, "bc": 2 * math.pi / 3, "ca": 4 * math.pi / 3}


def _settled(weak: Projection, amps: Array, noise: float) -> Projection:
    """The windows in which the current does not move: there the inductance does not matter."""
    spread = np.array([np.ptp(amps[s : s + weak.length]) for s in weak.starts])
    calm = spread < 8.0 * max(noise, 1e-12)
    return weak.only(calm)


def _lcr(capture: Capture, _: Machine) -> Segment | None:
    if not capture.has("theta_elec_deg", "lab_h"):
        return None
    names = ["theta_elec_deg", "lab_h"] + [n for n in ("rab_ohm", "freq_hz") if capture.has(n)]
    found = capture.arrays(*names)
    angle = 2 * np.radians(found["theta_elec_deg"])
    basis = np.stack([np.ones(angle.size), np.cos(angle), np.sin(angle)], axis=1)
    if angle.size < 6:
        return None
    noise = {}
    for name in names[1:]:
        fitted = basis @ np.linalg.lstsq(basis, found[name], rcond=None)[0]
        noise[name] = float(np.sqrt(((found[name] - fitted) ** 2).sum() / (angle.size - 3)))
    channels = tuple(n for n in ("lab_h", "rab_ohm") if n in found)
    return _segment(capture, "lcr", "lcr", 1.0, found, noise, channels, None)


def _flux_map(capture: Capture, _: Machine) -> Segment | None:
    names = ("id_a", "iq_a", "psi_d_wb", "psi_q_wb")
    if not capture.has(*names):
        return None
    found = capture.arrays(*names)
    noise = {name: 1e-3 * float(np.ptp(found[name])) for name in names}
    return _segment(capture, "flux_map", "drive", 1.0, found, noise, ("psi_d_wb", "psi_q_wb"), None)
