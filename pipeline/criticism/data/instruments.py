"""Which instrument recorded what: each has a gain, with its capture's own uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from pipeline.criticism.parameter import THERMOMETER, TRANSDUCER
from pipeline.records.capture import Capture, CaptureMeta

_AXES_A = ("id_a", "iq_a")
_LINES_A = ("ia_a", "ib_a", "ic_a")
_VOLTS = ("vd_v", "vq_v", "va_v", "vb_v", "vc_v", "vab_v", "vbc_v", "vca_v")
_FLUXES = ("psi_d_wb", "psi_q_wb")
_AT_REST = "gain_current_rest"
_METERS = ("gain_current", "gain_current_bench", _AT_REST, "gain_voltage", "gain_commanded")
"""Gains of which a station may have several instruments; the first of a kind has its name."""
_OF_STATION = (TRANSDUCER, THERMOMETER)
"""Kinds of which a station has one."""


def gains_of(captures: Iterable[Capture]) -> dict[str, dict[str, str]]:
    """The nuisance that is the gain of each instrument, by capture.

    Parameters
    ----------
    captures
        Captures of one motor.

    Returns
    -------
    dict of dict
        By path and kind (`gain_current`, `gain_voltage`, ...) the name of the nuisance.

    Notes
    -----
    Captures of one station that state the same uncertainty of the same kind have the same
    instrument: a scope of 1.5 % is not the multimeter of 0.3 % beside it, nor is anything of
    another station. The best of a kind has the name of the kind, others a number. What feeds and
    measures a rotor at rest, as in a heat run, may be the bench's supply or an analyser: its
    ammeter is neither.

    """
    captures = tuple(captures)
    used = {capture.path: _used(capture) for capture in captures}
    named = {}
    for kind in (*_METERS, *_OF_STATION):
        known = {kinds[kind] for kinds in used.values() if kind in kinds}
        for n, one in enumerate(sorted(known), 1):
            named[kind, one] = kind if n == 1 and kind != _AT_REST else f"{kind}_{n}"
    return {p: {kind: named[kind, one] for kind, one in kinds.items()} for p, kinds in used.items()}


def stated_u(captures: Iterable[Capture]) -> dict[str, float]:
    """Standard uncertainty of the station's gains and thermometers.

    Parameters
    ----------
    captures
        Captures of one motor.

    Returns
    -------
    dict of float
        By nuisance: gains [1], thermometers [K]; what no capture states is absent. The largest
        value where several captures state one.

    """
    captures = tuple(captures)
    gains = gains_of(captures)
    stated: dict[str, float] = {}
    for capture in captures:
        meta, used = capture.meta, _used(capture)
        for kind, name in gains[capture.path].items():
            u = used[kind][0] if kind in _METERS else _of_station(meta)[kind]
            if math.isinf(u) and name != kind:
                # a further instrument is known by its number here, so it always states something
                u = _assumed(meta).get(kind, meta.instrument_u("u_rel_current"))
            if not math.isinf(u):
                stated[name] = u if kind in _METERS else max(stated.get(name, 0.0), u)
        for name, one in (
            ("gain_lcr", _u_lcr(meta)),
            ("phase_lcr_rad", _u_lcr(meta)),
            ("gain_clock", meta.u_rel_clock),
            ("zero_angle_rad", meta.stated_u_rel("u_zero_angle_rad")),
        ):
            if one:
                stated[name] = max(stated.get(name, 0.0), one)
    return stated


def _of_station(meta: CaptureMeta) -> dict[str, float]:
    """What a capture states of the instruments of which its station has one; infinite where
    nothing.
    """
    return {TRANSDUCER: meta.u_rel_torque or math.inf, THERMOMETER: meta.u_temp_degc or math.inf}


def _assumed(meta: CaptureMeta) -> dict[str, float]:
    """What they are known to where nothing is stated."""
    return {
        TRANSDUCER: meta.instrument_u("u_rel_torque"),
        THERMOMETER: meta.instrument_u("u_temp_degc"),
    }


def _used(capture: Capture) -> Mapping[str, tuple[float, str]]:
    """The kinds of instrument that a capture's columns have: the uncertainty that it states,
    infinite where it states none, and the station. A station has one transducer, whatever its
    captures state.
    """
    meta, used = capture.meta, {}
    at = meta.station or ""
    amps, volts = ((u or math.inf, at) for u in (meta.u_rel_current, meta.u_rel_voltage))
    if any(name.startswith("temp_") for name in capture.columns):
        used[THERMOMETER] = 0.0, at
    if capture.has("torque_shaft_nm"):
        used[TRANSDUCER] = 0.0, at
    if meta.test == "lcr":
        return used
    if any(capture.has(name) for name in _AXES_A):
        at_rest = meta.test == "heat_run" and meta.voltage_kind == "measured"
        used[_AT_REST if at_rest else "gain_current"] = amps
    elif any(capture.has(name) for name in _LINES_A):
        used["gain_current_bench"] = amps
    if any(capture.has(name) for name in (*_VOLTS, *_FLUXES)):
        commanded = meta.voltage_kind == "commanded"
        used["gain_commanded" if commanded else "gain_voltage"] = volts
    return used


def _u_lcr(meta: CaptureMeta) -> float | None:
    """Gain of an LCR meter: as stated, else that of the voltage and current it is made of."""
    if meta.test != "lcr":
        return None
    stated = meta.stated_u_rel("u_rel_lcr")
    if stated is not None:
        return stated
    return math.hypot(meta.u_rel_voltage or 0.0, meta.u_rel_current or 0.0)
