"""A capture compared with its datasheet: what the published constants do not explain.

An estimator's evidence shows one fit. This shows the datasheet as a whole on ordinary records, and
so what no single fit covers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.integrals import trapezoid
from pipeline.physics.machine import DqMeans, air_gap_torque, dq_voltages
from pipeline.records.capture import Array, Capture, Flags, Indices
from pipeline.records.datasheet import Datasheet
from pipeline.records.evidence import Evidence, Series

NAME = "datasheet"
TITLE = "Against the datasheet"
WINDOW_S, LEAST_SAMPLES, LEAST_WINDOWS = 1e-3, 8, 16
MOST_WINDOWS = 20_000
GAP, JUMP_SHARE = 1.5, 0.05
_VOLTAGE = ("r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "pole_pairs")
_TORQUE = ("kt_peak_nm_a", "kt_from_ke_nm_a")
_ZERO_CURRENT = ("cogging",)


@dataclass(frozen=True, slots=True)
class _Windows:
    """A record cut into windows: `edges` [w + 1] rows, `whole` [w] where no gap falls inside."""

    t_s: Array
    edges: Indices
    whole: Flags

    @property
    def middle_s(self) -> Array:
        """Middles of the windows [w, s]."""
        ends = self.t_s[self.edges]
        return 0.5 * (ends[1:] + ends[:-1])

    def mean(self, values: Array) -> Array:
        """Trapezoidal means [w] of samples [n]."""
        return np.diff(trapezoid(self.t_s, values)[self.edges]) / np.diff(self.t_s[self.edges])

    def rate(self, values: Array) -> Array:
        """Rates [w, 1/s] from the ends of the windows; no derivative is taken."""
        return np.diff(values[self.edges]) / np.diff(self.t_s[self.edges])


def replay(capture: Capture, datasheet: Datasheet) -> tuple[Evidence, ...]:
    """Voltages (window means) and shaft torque (samples) of a capture beside the datasheet's.

    Empty where the capture lacks the columns or the datasheet the constants. Losses, saturation and
    cogging are left out on purpose, so that the residual shows them.

    Parameters
    ----------
    capture
        The capture.
    datasheet
        The datasheet.

    """
    known = {n: e.number for n, e in datasheet.constants.items() if e.known}
    return (*_torque(capture, known), *_voltages(capture, known))


def _voltages(capture: Capture, known: Mapping[str, float]) -> Iterator[Evidence]:
    record = _record(capture, ("vd_v", "vq_v", "id_a", "iq_a"))
    if record is None or not all(name in known for name in _VOLTAGE):
        return
    cut = _windows(record["t_s"])
    if cut is None:
        return
    state = DqMeans(
        cut.mean(record["id_a"]),
        cut.mean(record["iq_a"]),
        cut.rate(record["id_a"]),
        cut.rate(record["iq_a"]),
        known["pole_pairs"] * _speed(record, cut),
    )
    copper = 1.0 + known.get("temp_coeff_copper_1_k", 0.0) * _warm(record, cut, "winding")
    magnet = 1.0 + known.get("temp_coeff_magnet_1_k", 0.0) * _warm(record, cut, "magnet")
    r_ohm, psi_wb = known["r_phase_ohm"] * copper, known["psi_pm_wb"] * magnet
    model = dq_voltages(state, r_ohm, known["ld_h"], known["lq_h"], psi_wb)
    for name, fitted in zip(("vq_v", "vd_v"), model[::-1], strict=True):
        measured = cut.mean(record[name])
        kept = cut.whole
        series = Series("", cut.middle_s[kept], measured[kept], fitted[kept])
        yield _evidence(capture, name, series, "window means")


def _torque(capture: Capture, known: Mapping[str, float]) -> tuple[Evidence, ...]:
    """The shaft's torque: what the currents make, less friction and what accelerates the rotor.

    Where the acceleration jumps between windows the model is NaN: it is unknown within them.
    """
    currents = () if capture.meta.test in _ZERO_CURRENT else ("iq_a",)
    record = _record(capture, ("torque_shaft_nm", *currents))
    kt_nm_a = next((known[name] for name in _TORQUE if name in known), None)
    if record is None or kt_nm_a is None:
        return ()
    cut = _windows(record["t_s"])
    if cut is None:
        return ()
    t_s, nothing = record["t_s"], np.zeros(record["t_s"].size)
    speed = _speed(record, cut)
    omega = np.interp(t_s, cut.middle_s, speed)
    rising = np.interp(t_s, cut.middle_s, np.gradient(speed, cut.middle_s))
    warm = np.interp(t_s, cut.middle_s, _warm(record, cut, "magnet"))
    torque_nm = air_gap_torque(
        record.get("id_a", nothing),
        record.get("iq_a", nothing),
        kt_nm_a * (1.0 + known.get("temp_coeff_magnet_1_k", 0.0) * warm),
        known.get("pole_pairs", 0.0),
        known.get("ld_h", 0.0) - known.get("lq_h", 0.0),
    )
    drag = known.get("torque_coulomb_nm", 0.0) * np.sign(omega)
    drag += known.get("b_visc_nm_s_rad", 0.0) * omega
    fitted = torque_nm - drag - known.get("j_rotor_kgm2", 0.0) * rising
    fitted[_jumps(cut, speed, known.get("j_rotor_kgm2", 0.0), record)] = np.nan
    series = Series("", t_s, record["torque_shaft_nm"], fitted)
    return (_evidence(capture, "torque_shaft_nm", series, "every sample"),)


def _jumps(cut: _Windows, speed: Array, j_kgm2: float, record: Mapping[str, Array]) -> Flags:
    """Samples [n] by windows whose accelerating torque differs by 5 % of the largest torque."""
    torque = j_kgm2 * np.gradient(speed, cut.middle_s)
    step = np.abs(np.diff(torque, prepend=torque[:1], append=torque[-1:]))
    most = float(np.abs(record["torque_shaft_nm"]).max())
    jumping = np.maximum(step[1:], step[:-1]) > JUMP_SHARE * most
    return np.interp(record["t_s"], cut.middle_s, jumping) > 0.0


def _evidence(capture: Capture, name: str, series: Series, caption: str) -> Evidence:
    return Evidence(NAME, TITLE, "t_s", name, "line", (series,), capture.path, caption)


def _record(capture: Capture, needed: tuple[str, ...]) -> dict[str, Array] | None:
    """Rows in which every column is finite; None where the capture does not hold what it takes."""
    angle = next((n for n in ("theta_mech_rad", "omega_mech_rad_s") if capture.has(n)), None)
    if angle is None or not capture.has("t_s", *needed):
        return None
    optional = ("id_a", "temp_winding_degc", "temp_magnet_degc")
    names = dict.fromkeys(("t_s", angle, *needed, *(n for n in optional if capture.has(n))))
    columns = capture.finite(*names)
    return columns if columns["t_s"].size else None


def _windows(t_s: Array) -> _Windows | None:
    """Windows of about a millisecond, longer where the record is long; None for a short record."""
    if t_s.size < LEAST_WINDOWS * LEAST_SAMPLES:
        return None
    period = float(np.median(np.diff(t_s)))
    length = max(LEAST_SAMPLES, round(WINDOW_S / period), -(-t_s.size // MOST_WINDOWS))
    edges = np.arange(0, t_s.size, length)
    if edges.size <= LEAST_WINDOWS:
        return None
    return _Windows(t_s, edges, np.diff(t_s[edges]) < GAP * length * period)


def _speed(record: Mapping[str, Array], cut: _Windows) -> Array:
    """Shaft speed [w, rad/s], by the angle where there is one: a bench's own estimate may lag."""
    if "theta_mech_rad" in record:
        return cut.rate(record["theta_mech_rad"])
    return cut.mean(record["omega_mech_rad_s"])


def _warm(record: Mapping[str, Array], cut: _Windows, place: str) -> Array:
    """Kelvin above 25 degC [w]; 0 where the capture has no temperature of that place."""
    column = record.get(f"temp_{place}_degc")
    return np.zeros(cut.whole.size) if column is None else cut.mean(column) - 25.0
