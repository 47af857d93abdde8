"""From captures to segments: the signals that one equation needs, on one even clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.drive_segments import q_log
from pipeline.criticism.data.holding_segments import standing
from pipeline.criticism.data.instruments import gains_of
from pipeline.criticism.data.segment import (
    PAIR_RAD,
    Segment,
    Sensors,
    electrical_orders,
    segment_of,
    slow_orders,
)
from pipeline.criticism.data.sensor_noise import is_rounded, resolution, sensor_noise
from pipeline.criticism.data.table_segments import flux_table
from pipeline.criticism.data.traces import (
    ANGLES,
    LINES_V,
    PAD,
    SMOOTHED,
    coarse_steps,
    decimated,
    even_angle,
    even_clock,
    prepared,
    shaft_angle,
    smoothed,
    tellable,
    thinned,
    whole_log,
    window_of,
    with_angle,
    with_travel,
)
from pipeline.criticism.effect import Array, Machine
from pipeline.numerics.coasting import coasting_rows
from pipeline.numerics.projection import Projection, projection, window_starts
from pipeline.records.capture import Campaign, Capture

_STEP_WINDOW_S = 0.002
"""Window of a current step [s]: short, since all that it tells is over after a few L/R."""
_LEAST_METER_NOISE = 1e-4
"""Share of its largest reading that a meter is known no better than, by judgement: with the
scatter alone, a meter that reads the same at every angle had a noise of 1e-16."""
_FEW = 12
"""Windows of a segment in a rough fit: enough to meet a sound J to a tenth."""
_LEAST_WINDOW = 8
"""Samples of a window at the least: its test function vanishes at both ends."""
_WINDOWS, _WINDOWS_LOG = 48, 32
"""Windows of a map, an open winding or a coast, and of a drive's log, at the most. By judgement:
cost goes with them, and a programme has several logs."""
_LEAD = 0.05
"""Share of a coast from which on the time before it counts as driven. By judgement: the moment of
letting go is shorter."""


def segments(campaign: Campaign, machine: Machine) -> tuple[Segment, ...]:
    """Every usable capture as a segment, in path order; a capture that lacks what its test's
    equation needs, is too short, or whose clock does not rise, is left out.
    """
    made: list[Segment] = []
    gains = gains_of(campaign.captures)
    for recorded in campaign.captures:
        maker = _MAKERS.get(recorded.meta.test)
        capture = None if maker is None else tellable(recorded)
        found = None if maker is None or capture is None else maker(capture, machine)
        parts = found if isinstance(found, tuple) else (found,)
        usable = (s for s in parts if s is not None and (s.weak is None or s.weak.starts.size))
        own = gains[recorded.path]
        made += [_by_instruments(_by_encoder(s, machine.encoder_rad), own) for s in usable]
    if any(segment.kind == "dq" for segment in made):
        # there are captures to predict a table from as a whole
        made = [replace(s, blocks=None) if s.kind == "flux_map" else s for s in made]
    return tuple(made)


def _by_instruments(segment: Segment, gains: Mapping[str, str]) -> Segment:
    """The segment with the gains of the instruments that recorded it, by kind."""
    volts = gains.get("gain_commanded") or gains.get("gain_voltage", "gain_voltage")
    amps = gains.get("gain_current") or gains.get("gain_current_bench", "gain_current")
    return replace(segment, meter=volts, ammeter=amps)


def _by_encoder(segment: Segment, step: float) -> Segment:
    """The segment with the encoder step that drive logs show, if its angle is in such steps.

    A shaft that turns by nearly whole steps a sample does not show the step itself, and its
    rounding is then periodic in the angle, as an electrical order is.
    """
    theta = segment.recorded.get("theta_mech_rad")
    known = theta is not None and is_rounded(theta, step)
    return replace(segment, angle_step_rad=step) if known else segment


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
    blocks = None if segment.blocks is None else segment.blocks[chosen]
    lines = None if segment.lines is None else segment.lines[:, :, chosen]
    return replace(segment, recorded=cut, weak=few, blocks=blocks, lines=lines)


def _temperatures(capture: Capture) -> list[str]:
    return [name for name in SMOOTHED if capture.has(name)]


def _drive(capture: Capture, machine: Machine) -> Segment | tuple[Segment, ...] | None:
    """A log with both axes, or with the q axis alone."""
    return _dq(capture, machine) or q_log(capture, machine)


def _dq(capture: Capture, machine: Machine) -> Segment | None:
    if not capture.has("vd_v", "vq_v", "id_a", "iq_a"):
        return None
    names = with_angle(capture, ["vd_v", "vq_v", "id_a", "iq_a", *_temperatures(capture)])
    turning = len(names) > 4 and any("theta" in n or "omega" in n for n in names)
    angle = not ANGLES.isdisjoint(names)
    torque = capture.has("torque_shaft_nm") and turning and angle
    names += ["torque_shaft_nm"] if torque else []
    period, found, keep = even_clock(capture, tuple(names))
    shaft_angle(found, period, machine)
    turned = float(np.ptp(found["theta_mech_rad"]))
    channels: tuple[str, ...] = ("vd_v", "vq_v")
    if torque and turned > 0.1:
        channels += ("torque_shaft_nm",)
    size = found["vd_v"].size
    window = window_of(period, size)
    orders = electrical_orders(machine) if angle and turned > 0.1 else ()
    told = prepared(found, period)
    if capture.meta.test == "torque_map":
        noise = dict(told.noise)
        noise["theta_mech_rad"] = max(noise["theta_mech_rad"], machine.encoder_rad / math.sqrt(12))
        even_angle(found, noise, window)
        told = replace(told, noise=noise)
    most = _WINDOWS if capture.meta.test == "torque_map" else _WINDOWS_LOG
    found["t_s"] = period * np.arange(size, dtype=np.float64)
    logged = capture.meta.test == "drive" and len(channels) > 2
    whole = {**found, "good": keep.astype(float)} if logged else None
    log = whole_log(found, period)
    found, starts = thinned(found, keep, window, most)
    weak = projection(found["theta_mech_rad"], starts, window, orders)
    made = segment_of(
        capture, "dq", "drive", period, found=found, sensors=told, channels=channels, weak=weak
    )
    return replace(made, whole=whole, log=log)


def _shaft(capture: Capture, machine: Machine) -> Segment | None:
    names = with_angle(capture, [])
    if not names:
        return None
    if capture.meta.test == "cogging":
        if not capture.has("torque_shaft_nm"):
            return None
        names = [*names, "torque_shaft_nm"]
    period, found, keep = even_clock(capture, tuple(names))
    shaft_angle(found, period, machine)
    channel = "torque_shaft_nm" if "torque_shaft_nm" in found else "omega_mech_rad_s"
    if capture.meta.test == "cogging":
        return _slow_turn(capture, machine, period, found, keep, channel)
    window = window_of(period, keep.size)
    keep = keep & _coasts(found["theta_mech_rad"], window)
    told = prepared(found, period)
    found["t_s"] = period * np.arange(keep.size, dtype=np.float64)
    found, starts = thinned(found, keep, window, _WINDOWS)
    weak = projection(found["theta_mech_rad"], starts, window, ())
    return segment_of(
        capture, "shaft", "bench", period, found=found, sensors=told, channels=(channel,), weak=weak
    )


def _coasts(theta: Array, window: int) -> NDArray[np.bool_]:
    """Samples [n] in which a shaft coasts.

    These are all samples, unless the shaft is driven or held at its speed before some coast, for
    more than a twentieth of that coast. Then they are those of the coasts alone.
    """
    speed = smoothed(np.gradient(theta), 2 * (window // 2) + 1)
    runs = sorted(((rows.start, rows.stop) for rows, _ in coasting_rows(speed)))
    ends = [0, *(stop for _, stop in runs)]
    driven = any(
        start - end > _LEAD * (stop - start) for (start, stop), end in zip(runs, ends, strict=False)
    )
    free = np.full(theta.size, not driven)
    for start, stop in runs:
        free[start:stop] = True
    return free


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
    if theta.size // factor < _LEAST_WINDOW + 2:
        return None
    noise = {n: sensor_noise(c, n.startswith("theta")) for n, c in found.items()}
    steps = coarse_steps(found, noise)
    noise = {n: sigma / math.sqrt(factor) for n, sigma in noise.items()}
    found = {name: decimated(column, factor) for name, column in found.items()}
    told = Sensors(noise, steps, with_travel(found, noise))
    keep = decimated(keep.astype(float), factor) > 0.999
    keep[:1] = keep[-1:] = False
    size = keep.size
    window = max(int(size / round(turns)), _LEAST_WINDOW) if turns > 1.2 else size - 2
    window = min(window, size - 2)
    # the first and the last sample have no neighbours
    starts = 1 + window_starts(keep[1:-1], window)
    weak = projection(found["theta_mech_rad"], starts, window, orders, cycles=0.9, margin=12.0)
    return segment_of(
        capture,
        "shaft",
        "bench",
        period * factor,
        found=found,
        sensors=told,
        channels=(channel,),
        weak=weak,
    )


def _open(capture: Capture, machine: Machine) -> Segment | None:
    lines = [n for n in LINES_V if capture.has(n)]
    if len(lines) < 2:
        return None
    extra = ["temp_magnet_degc"] if capture.has("temp_magnet_degc") else []
    names = with_angle(capture, [*lines, *extra])
    if not ANGLES.intersection(names):
        # where the magnet stands at first is another in every spin, and no speed tells it
        return None
    period, found, keep = even_clock(capture, tuple(names))
    shaft_angle(found, period, machine)
    window = window_of(period, keep.size)
    told = prepared(found, period)
    found["t_s"] = period * np.arange(keep.size, dtype=np.float64)
    found, starts = thinned(found, keep, window, _WINDOWS)
    weak = projection(found["theta_mech_rad"], starts, window, electrical_orders(machine))
    weak = weak.only(_steady(weak, found["theta_mech_rad"]))
    return segment_of(
        capture,
        "open",
        "bench",
        period,
        found=found,
        sensors=told,
        channels=("vd_v", "vq_v"),
        weak=weak,
    )


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
    told = prepared(found, period)
    fixed = {"pair_rad": PAIR_RAD[pair], "phase": float("abc".index(current[1]))}
    if capture.meta.test == "current_step":
        if capture.meta.theta_elec_deg is None:
            return None
        fixed["theta_elec_rad"] = math.radians(capture.meta.theta_elec_deg)
        edges = np.abs(np.diff(volts)) > 8 * told.noise["v_pair_v"]
        keep[:-1] &= ~edges
        keep[1:] &= ~edges
        window = max(min(round(_STEP_WINDOW_S / period), keep.size // 4), _LEAST_WINDOW)
    else:
        window = window_of(period, keep.size)
    weak = projection(np.zeros(keep.size), window_starts(keep, window), window, ())
    if capture.meta.test == "resistance":
        weak = _settled(weak, amps, told.noise["i_pair_a"])
    return segment_of(
        capture,
        "terminal",
        "bench",
        period,
        found=found,
        sensors=told,
        channels=("v_pair_v",),
        weak=weak,
        blocks=None,
        offsets=None,
        **fixed,
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


def _settled(weak: Projection, amps: Array, noise: float) -> Projection:
    """The windows in which the current does not move: there the inductance does not matter."""
    spread = np.array([np.ptp(amps[s : s + weak.length]) for s in weak.starts])
    calm = spread < 8.0 * max(noise, 1e-12)
    return weak.only(calm)


def _lcr(capture: Capture, _: Machine) -> Segment | None:
    """A table over the angle. Its noise is the scatter about a mean and two waves a turn, but never
    less than the rounding of its last digit, or a ten-thousandth of the largest reading.
    """
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
        scatter = math.sqrt(float(((found[name] - fitted) ** 2).sum()) / (angle.size - 3))
        least = _LEAST_METER_NOISE * float(np.abs(found[name]).max())
        noise[name] = max(scatter, resolution(found[name]) / math.sqrt(12), least)
    channels = tuple(n for n in ("lab_h", "rab_ohm") if n in found)
    return segment_of(
        capture,
        "lcr",
        "lcr",
        1.0,
        found=found,
        sensors=Sensors(noise),
        channels=channels,
        weak=None,
    )


_MAKERS: Mapping[str, Callable[[Capture, Machine], Segment | tuple[Segment, ...] | None]] = {
    "torque_map": _dq,
    "drive": _drive,
    "heat_run": _dq,
    "cogging": _shaft,
    "spin_down": _shaft,
    "open_circuit": _open,
    "resistance": _terminal,
    "current_step": _terminal,
    "lcr": _lcr,
    "flux_map": flux_table,
    "holding_current": standing,
}
TESTS = frozenset(_MAKERS)
"""Tests that have an equation here."""
