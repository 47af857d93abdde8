"""From captures to segments: the signals that each equation needs, on one even clock."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.encoder_noise import readings_and_noise, shared_noise
from pipeline.criticism.data.instruments import gains_of
from pipeline.criticism.data.rounding import is_rounded, rounding_step
from pipeline.criticism.data.segment import UNSMOOTHED, Cache, Segment, joins, with_lines
from pipeline.criticism.data.traces import READ_BETWEEN, with_values
from pipeline.criticism.equation import Equation
from pipeline.criticism.library.equations import equation_of, equations
from pipeline.criticism.machine.model import (
    COAST_SHARES,
    EARLY_S,
    EARLY_SHARES,
    LATENESS,
    OPEN_FLUX,
    UNLOGGED_AT_REST,
)
from pipeline.criticism.operating import Array
from pipeline.criticism.parameter import THERMOMETER, TRANSDUCER, UNLOGGED, Machine
from pipeline.criticism.residuals.observability import hooks_in
from pipeline.numerics.coast_setups import Limits, Setup, coast_setups
from pipeline.records.capture import Campaign, Capture

_REPEATED = {
    "spin_down": (COAST_SHARES, "b_nm_s_rad", {"torque_shaft_nm"}),
    "open_circuit": ((OPEN_FLUX,), "psi_wb", {"vq_v", "torque_shaft_nm", "psi_d_wb"}),
}
"""Nuisances of a test whose machine may not be quite that of others; the constant they share and
the signals of others that show it."""
_ALTERNATING = 64.0 / 20.0
"""Variance of the third difference of a rounding that alternates, over that of white noise."""


def segments(campaign: Campaign, machine: Machine) -> tuple[Segment, ...]:
    """Every usable capture as segments, in the order of paths.

    Parameters
    ----------
    campaign
        Captures of one motor.
    machine
        Size of the motor.

    Returns
    -------
    tuple of Segment
        A capture is left out that lacks what the equation of its test needs, is too short, or whose
        clock does not rise.

    """
    cut_segments: list[Segment] = []
    gains = gains_of(campaign.captures)
    mixed = {c.path for setup in mixed_setups(campaign, machine) for c in setup.captures}
    for recorded in campaign.captures:
        used = recorded.meta.test in known_tests() and recorded.path not in mixed
        capture = with_values(recorded) if used else None
        if capture is not None:
            gain = gains[recorded.path]
            cut = (_by_encoder(s, machine) for s in _cut(capture, machine))
            cut_segments += [_by_instruments(segment, gain) for segment in cut]
    cut_segments = _with_shared_noise(cut_segments, machine)
    cut_segments = _from_one_zero(cut_segments, machine)
    kinds = {segment.kind for segment in cut_segments}
    # what other captures can predict is held out as a whole
    whole = {e.name for e in equations().values() if kinds.intersection(e.use.whole_beside)}
    cut_segments = [replace(s, whole=s.kind in whole) for s in cut_segments]
    return tuple(
        replace(s, fixed={**s.fixed, **_shares_of_repeats(s, cut_segments), **_early(s)})
        for s in cut_segments
    )


def _from_one_zero(cut_segments: Sequence[Segment], machine: Machine) -> list[Segment]:
    """The segments with angles from one zero of the bench's encoder, that of the first.

    An incremental encoder counts from where it was switched on. What zeros differ by less than
    `one_zero_rad` may be the lag of a filter, and stays.
    """
    turned, first = list(cut_segments), None
    for place, segment in enumerate(cut_segments):
        begins = equation_of(segment).begins
        zero = None if begins is None else begins(segment, machine).get("bench_angle_rad")
        if zero is None:
            continue
        first = zero if first is None else first
        apart = math.remainder(zero - first, 2.0 * math.pi)
        if abs(apart) > machine.policy.cutting.one_zero_rad:
            theta = segment.recorded["theta_mech_rad"] - apart / machine.pole_pairs
            recorded = {**segment.recorded, "theta_mech_rad": theta}
            turned[place] = replace(segment, recorded=recorded, cache=Cache())
    return turned


def mixed_setups(campaign: Campaign, machine: Machine) -> tuple[Setup, ...]:
    """The set-ups of coasts that have no common inertia and drag; none where all go together.

    Parameters
    ----------
    campaign
        All captures of one motor.
    machine
        Policy.

    Returns
    -------
    tuple of Setup
        Their files.

    """
    policy = machine.policy.cutting
    limits = Limits(policy.setup_share, policy.setup_top, policy.setup_least)
    setups = coast_setups(campaign.of("spin_down"), limits)
    return setups if len(setups) > 1 else ()


def known_tests() -> frozenset[str]:
    """Tests that have an equation."""
    return frozenset(test for equation in equations().values() for test in equation.tests)


def _cut(capture: Capture, machine: Machine) -> Iterator[Segment]:
    """The segments of a capture, one an equation that can use it."""
    for equation in equations().values():
        if capture.meta.test not in equation.tests or not capture.has(*equation.columns):
            continue
        segment = equation.cut(capture, machine)
        if segment is not None and (segment.weak is None or segment.weak.starts.size):
            lacks = {**_unlogged(segment, equation, machine), **_late_speed(segment, capture)}
            yield replace(segment, fixed={**segment.fixed, **lacks})


def _shares_of_repeats(segment: Segment, others: Sequence[Segment]) -> dict[str, float]:
    """The nuisances of a coast or an open-circuit spin beside other tests of drags or magnet."""
    shares, constant, signals = _REPEATED.get(segment.test, ((), "", set()))
    shown = any(
        constant in equation_of(other).observes.constants and not signals.isdisjoint(other.channels)
        for other in others
        if other.test != segment.test
    )
    return dict.fromkeys(shares, 1.0) if shown else {}


def _early(segment: Segment) -> dict[str, float]:
    """Nuisances of a friction that changes with time, of what turns a shaft freely from its start
    on; they are left free where that explains the captures (`selection.free_shares`).
    """
    free = segment.test in ("spin_down", "drive") and "t_s" in segment.recorded
    of_shaft = free and "torque" in hooks_in(segment)
    return dict.fromkeys((*EARLY_SHARES, EARLY_S), 1.0) if of_shaft else {}


def _unlogged(segment: Segment, equation: Equation, machine: Machine) -> dict[str, float]:
    """Nuisances of the temperatures that such a test changes and the capture did not record: one
    that all such captures have in common, and one of the capture's own.
    """
    hooks = {"temp_winding_degc": "drop", "temp_magnet_degc": "flux"}
    lacks = [
        name
        for name, hook in hooks.items()
        if hook in equation.use.warms and name not in segment.recorded
    ]
    common = (
        UNLOGGED_AT_REST if hooks[name] == "drop" and equation.use.at_rest else UNLOGGED[name]
        for name in lacks
    )
    local = (n for n, at in machine.unlogged.items() if at in {(c, segment.capture) for c in lacks})
    return dict.fromkeys((*common, *local), 1.0)


def _late_speed(segment: Segment, capture: Capture) -> dict[str, float]:
    """The nuisances of a motion that is known by a drive's own speed alone."""
    has_angle = capture.has("theta_mech_rad") or capture.has("theta_elec_rad")
    drive_speed = segment.instrument.name == "drive" and capture.has("omega_mech_rad_s")
    return dict.fromkeys(LATENESS, 1.0) if drive_speed and not has_angle else {}


def _by_instruments(segment: Segment, gains: Mapping[str, str]) -> Segment:
    """The segment with the errors of the instruments that recorded it, by kind."""
    volts = gains.get("gain_commanded") or gains.get("gain_voltage", "gain_voltage")
    ammeters = [name for kind, name in gains.items() if kind.startswith("gain_current")]
    amps = ammeters[0] if ammeters else "gain_current"
    instrument = replace(
        segment.instrument,
        meter=volts,
        ammeter=amps,
        transducer=gains.get(TRANSDUCER, TRANSDUCER),
        thermometer=gains.get(THERMOMETER, THERMOMETER),
    )
    return replace(segment, instrument=instrument)


def _by_encoder(segment: Segment, machine: Machine) -> Segment:
    """The segment with the step of its angle: a multiple of that of the drive's encoder, if it
    is in such steps, else its own.

    A shaft that turns by nearly whole steps a sample does not show the step itself, and its
    rounding is then periodic in the angle, as an electrical order is. A drive that logs means of
    n readings has its angle in fractions q of the step, with a noise of q √(n/12): a noise before
    the rounding looks alike, but for where it is (`readings_and_noise`). A single reading that
    alternates may seem to be of `_ALTERNATING`. The integral of a rounded speed is in steps as
    well, but its error is a walk.
    """
    theta, step = segment.recorded.get("theta_mech_rad"), machine.encoder_rad
    theta = segment.recorded.get(UNSMOOTHED, theta)
    if theta is None or segment.sensors.speed is not None:
        return segment
    policy = machine.policy.sensor_noise
    lost = segment.recorded.get(READ_BETWEEN, np.zeros(theta.size)) > 0.0
    if is_rounded(theta[~lost], step, policy):
        evenly = float(np.ptp(np.diff(theta))) < step
        multiples = range(1, 2 if evenly else policy.most_readings + 1)
        step = max(n * step for n in multiples if is_rounded(theta[~lost], n * step, policy))
    else:
        known = segment.sensors.angle_step_rad
        alone = np.where(lost, np.nan, theta)
        step = rounding_step(alone, policy) if known is None else known
    readings = 1.0
    if step > 0.0:
        readings = 12.0 * (segment.sensors.noise.get("theta_mech_rad", 0.0) / step) ** 2
    count = min(round(readings), policy.most_readings) if readings > _ALTERNATING else 1
    dither = 0.0
    if step > 0.0:
        count, dither = readings_and_noise(_angles(segment), step, count, policy)
    sensors = replace(segment.sensors, angle_step_rad=step, readings=count, dither_rad=dither)
    return replace(segment, sensors=sensors)


def _with_shared_noise(found: Sequence[Segment], machine: Machine) -> list[Segment]:
    """Segments with the noise of their encoder before its rounding as all of them show it, in the
    same steps.
    """
    with_noise = list(found)
    single = [n for n, one in enumerate(found) if one.sensors.readings == 1]
    for step in {step for n in single if (step := found[n].sensors.angle_step_rad)}:
        places = [n for n in single if found[n].sensors.angle_step_rad == step]
        if len(places) == 1:
            continue
        alone = [found[n].sensors.dither_rad for n in places]
        records = [_angles(found[n]) for n in places]
        noises = shared_noise(records, step, alone, machine.policy.sensor_noise)
        for n, noise in zip(places, noises, strict=True):
            with_noise[n] = replace(found[n], sensors=replace(found[n].sensors, dither_rad=noise))
    return with_noise


def _angles(segment: Segment) -> list[Array]:
    """Stretches of the recorded angle [rad], before any smoothing, each without a gap."""
    theta = segment.recorded.get(UNSMOOTHED, segment.recorded.get("theta_mech_rad"))
    return [] if theta is None else np.split(theta, joins(segment))


def sparse(segment: Segment, windows: int, pad: int) -> Segment:
    """The same segment with a few of its windows only, for a first, rough fit.

    Parameters
    ----------
    segment
        The segment.
    windows
        How many windows are kept.
    pad
        Samples on either side of each that are kept as well.

    Returns
    -------
    Segment
        The same where it has no more, and for a table.

    """
    weak = segment.weak
    if weak is None or weak.starts.size <= windows:
        return segment
    chosen = np.linspace(0, weak.starts.size - 1, windows).round().astype(np.int64)
    starts = weak.starts[chosen]
    rows = starts[:, None] - pad + np.arange(weak.length + 2 * pad)[None, :]
    rows = np.clip(rows, 0, segment.size - 1).ravel()
    cut = {name: column[rows] for name, column in segment.recorded.items()}
    moved = pad + (weak.length + 2 * pad) * np.arange(windows)
    thin = replace(weak, starts=moved, functions=weak.functions[chosen], valid=weak.valid[chosen])
    blocks = None if segment.blocks is None else segment.blocks[chosen]
    short = replace(segment, recorded=cut, weak=thin, blocks=blocks, cache=Cache())
    lines = segment.disturbances.lines
    return short if lines is None else with_lines(short, lines[:, :, chosen])
