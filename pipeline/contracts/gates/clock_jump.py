"""A clock that skips while the motor does not: time passes, the signal does not move on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.waveform import Array, gaps_of
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

NAME = "clock_jump"
WITNESSES = {
    "open_circuit": ("theta_mech_rad", "theta_elec_rad"),
    "hand_turn": ("theta_mech_rad",),
    "cogging": ("theta_mech_rad",),
    "torque_map": ("theta_mech_rad", "theta_elec_rad"),
    "drive": ("theta_mech_rad", "theta_elec_rad"),
    "spin_down": ("theta_mech_rad", "omega_mech_rad_s"),
    "current_step": ("ia_a", "ib_a", "ic_a"),
    "heat_run": ("temp_winding_degc", "theta_mech_rad"),
}
GAPS_LOOKED_AT = 200
REMEDY = (
    "fix the logger's clock, or cut the file at that row; state `pause_s` where the recorder paused"
)


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a capture in which a steady signal goes on across a gap as if there were none.

    Notes
    -----
    A gap is longer than `gap_intervals` median intervals. Straight lines over `window` samples on
    either side give the change of the signal across it, Δ, and its slope s. The clock has skipped
    where |Δ − s · gap| is above `sigmas` of the samples' scatter and |Δ − s · interval| is below a
    quarter of it. Where the two slopes differ by enough to explain Δ, the samples on either side
    must also join without a bend of their own: a shaft that turns back while samples are lost is
    back near where it was.
    Skips that stay below the uncertainty of the time base over the record change
    nothing that the record determines, and are warnings: one late row of a heat run.

    """
    findings = []
    for table in capture.tables:
        if "t_s" not in table.columns or table.height < 3:
            continue
        t_s = table["t_s"].to_numpy()
        gaps, usual_s = gaps_of(t_s, options["gap_intervals"], capture.meta.pause_s)
        left_s = capture.meta.instrument_u("u_rel_clock") * float(t_s[-1] - t_s[0])
        names = [n for n in WITNESSES[capture.meta.test] if n in table.columns]
        for gap in gaps[:GAPS_LOOKED_AT]:
            for name in names:
                if not _went_on(table, name, int(gap), usual_s, options):
                    continue
                skipped = float(t_s[gap + 1] - t_s[gap])
                words = (
                    f"t_s jumps by {skipped:.4g} s between two samples while {name} goes on "
                    f"as after {usual_s:.3g} s"
                )
                rows = (int(gap), int(gap) + 1)
                left_s -= skipped - usual_s
                if left_s < 0.0:
                    raise CaptureError(NAME, words, REMEDY, rows)
                findings.append(warning(capture, NAME, words, REMEDY, rows))
                break
    return Passed(findings=tuple(findings))


def _went_on(
    table: pl.DataFrame, name: str, gap: int, usual_s: float, options: Mapping[str, float]
) -> bool:
    """Whether the signal moved by one usual interval's worth, and clearly not by the gap's.

    Straight lines on either side give the signal and its slope at the gap's ends. The change
    between them is held against the mean slope times the gap, and times one usual interval. Half
    the difference of the slopes is the doubt about the slope in between.
    """
    window = int(options["window"])
    t_s, signal = table["t_s"].to_numpy(), table[name].to_numpy()
    before = slice(max(0, gap + 1 - window), gap + 1)
    after = slice(gap + 1, gap + 1 + window)
    before_gap = _line(t_s[before], signal[before], float(t_s[gap]))
    right = _line(t_s[after], signal[after], float(t_s[gap + 1]))
    if before_gap is None or right is None:
        return False
    skipped = t_s[gap + 1] - t_s[gap]
    slope = 0.5 * (before_gap[1] + right[1])
    as_stamped = right[0] - before_gap[0] - slope * skipped
    if_closed = right[0] - before_gap[0] - slope * usual_s
    scatter = float(np.hypot(before_gap[2], right[2]))
    doubt = 0.5 * abs(right[1] - before_gap[1])
    clear = abs(as_stamped) > options["sigmas"] * (scatter + doubt * usual_s)
    closed = abs(if_closed) < 0.25 * abs(as_stamped)
    straight = abs(as_stamped) > options["sigmas"] * (scatter + doubt * skipped)
    return bool(clear and closed and (straight or _joins(signal[before], signal[after])))


def _joins(before: Array, after: Array) -> bool:
    """Whether samples of one run go on into those of another as they do within each.

    Parameters
    ----------
    before, after : ndarray [n]
        Samples of one signal on either side of a gap, in its unit.

    Notes
    -----
    The two second differences that span the gap are held against twice the largest of the others:
    of fifty samples of noise, none is that far out by chance.

    """
    before, after = before[np.isfinite(before)], after[np.isfinite(after)]
    joined = np.concatenate((before, after))
    bends = np.abs(np.diff(joined, 2))
    spanning = slice(before.size - 2, before.size)
    return bool(bends[spanning].max() <= 2.0 * np.delete(bends, spanning).max())


def _line(t_s: Array, values: Array, at_s: float) -> tuple[float, float, float] | None:
    """Value of a straight line at a time, its slope, and the scatter of the samples about it."""
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 6:
        return None
    t_s, values = t_s[finite], values[finite]
    centred = t_s - t_s.mean()
    slope = float(centred @ values / (centred @ centred))
    residuals = values - values.mean() - slope * centred
    scatter = float(np.sqrt(residuals @ residuals / (residuals.size - 2)))
    return float(values.mean() + slope * (at_s - t_s.mean())), slope, scatter


GATE = Gate(
    NAME,
    tuple(WITNESSES),
    check,
    {
        # Half way between one interval and two.
        "gap_intervals": 1.5,
        # Samples a side: enough for a slope through noise, few enough to be straight.
        "window": 25.0,
        # Over the scatter about the lines: never by chance in any fleet.
        "sigmas": 8.0,
    },
)
