"""What the captures of one motor say together: contradictions, and regions that none covers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from pipeline.contracts.protocol import warning
from pipeline.contracts.requirements import LINE_CURRENTS
from pipeline.contracts.rotation import shaft_angle
from pipeline.contracts.waveform import samples_per_time_constant
from pipeline.records.capture import Campaign, Capture
from pipeline.records.finding import Finding
from pipeline.records.stated import stated_constants

NAMEPLATE = ("motor_type", "lot", "winding", "pole_pairs", "slots")
CONSEQUENCE = {
    "pole_pairs": "constants that need it take the count from the data, never the nameplate",
    "winding": "the wye equivalent is published, which holds for both",
}

# Way back over way there, of all captures of a motor.
RETURN_SHARE = 0.5

# Saliency and iron's bend part the time constants of one rotor by far less.
SETTLING_RATIO = 100.0


def agree(campaign: Campaign) -> tuple[Finding, ...]:
    """Where one motor's captures contradict each other or leave an experiment out.

    Parameters
    ----------
    campaign
        All captures of one motor.

    Returns
    -------
    tuple of Finding
        Warnings at the file of the smaller group, naming the other. Neither of two captures that
        disagree is refused: which nameplate is wrong is not for one of them to say.

    """
    findings = [finding for key in NAMEPLATE for finding in _contradictions(campaign, key)]
    looks = (
        _statements, _one_test_only, _cogging_directions, _holding_directions, _torque_signs,
        _step_clocks,
    )  # fmt: skip
    for look in looks:
        findings += look(campaign)
    return tuple(findings)


def _contradictions(campaign: Campaign, key: str) -> Iterator[Finding]:
    stated = [(c, getattr(c.meta, key)) for c in campaign.captures]
    stated = [(capture, value) for capture, value in stated if value is not None]
    counts = Counter(value for _, value in stated)
    first: dict[object, Capture] = {}
    for capture, value in stated:
        first.setdefault(value, capture)
    usual = campaign.nameplate(key)
    consequence = CONSEQUENCE.get(key, "the most frequent one counts")
    for value, capture in first.items():
        if value != usual:
            yield warning(
                capture,
                f"{key}_contradiction",
                f"{key} is {value} {_here(counts[value])} of {campaign.motor_id}, but {usual} in "
                f"{first[usual].path}{_beside(counts[usual])}",
                f"correct the metadata of one of them; {consequence}",
            )


def _statements(campaign: Campaign) -> Iterator[Finding]:
    """Captures that state one constant differently; what `records.stated` takes is named."""
    for used in stated_constants(campaign):
        for capture in campaign.captures:
            stated = capture.meta.extra.get(used.name)
            if stated is None or capture.path in used.captures or used.name in campaign.stated:
                continue
            yield warning(
                capture,
                "statement_contradiction",
                f"{used.name} is stated as {stated}, but as {used.number:g} ± {used.u:.2g} in "
                f"{used.captures[0]}{_beside(len(used.captures))}, which counts",
                f"correct {used.name} or u_{used.name} of one of them",
            )


def _here(count: int) -> str:
    if count == 1:
        return "here alone of the captures"
    return f"here and in {count - 1} more captures"


def _beside(count: int) -> str:
    return "" if count == 1 else f" and {count - 1} more"


def _one_test_only(campaign: Campaign) -> Iterator[Finding]:
    tests = {c.meta.test for c in campaign.captures}
    if len(tests) == 1:
        yield warning(
            campaign.captures[0],
            "one_test_only",
            f"{campaign.motor_id} has captures of {tests.pop()} only: no two constants can be "
            "held against each other",
            "see what to record next with `plan`",
        )


def _cogging_directions(campaign: Campaign) -> Iterator[Finding]:
    captures = campaign.of("cogging")
    turned = [_net_turn(c) for c in captures]
    if captures and not min(turned) < 0.0 < max(turned) and not any(map(_reverses, captures)):
        yield warning(
            captures[0],
            "direction_coverage",
            "the slow turn goes one way only: friction cannot be separated from cogging",
            "record the same turn the other way",
        )


def _holding_directions(campaign: Campaign) -> Iterator[Finding]:
    captures = campaign.of("holding_current")
    steps = [np.diff(angle[:: max(1, angle.size // 500)]) for angle in map(_angle, captures)]
    forth = sum(float(step[step > 0.0].sum()) for step in steps)
    back = sum(float(-step[step < 0.0].sum()) for step in steps)
    if min(back, forth) < RETURN_SHARE * max(back, forth):
        yield warning(
            captures[0],
            "direction_coverage",
            "angles were held on the way in one direction only: friction cannot be separated from "
            "cogging",
            "hold the same angles on the way back as well",
        )


def _angle(capture: Capture) -> np.ndarray:
    index = capture.table_of("theta_mech_rad")
    angle = shaft_angle(capture, capture.tables[index]["t_s"].to_numpy())
    return np.zeros(1) if angle is None else angle[np.isfinite(angle)]


def _net_turn(capture: Capture) -> float:
    angle = _angle(capture)
    return float(angle[-1] - angle[0])


def _reverses(capture: Capture) -> bool:
    angle = _angle(capture)
    reached = float(angle.max() - angle[0]), float(angle.max() - angle[-1])
    back = float(angle[0] - angle.min()), float(angle[-1] - angle.min())
    return min(reached) > np.pi or min(back) > np.pi


def _torque_signs(campaign: Campaign) -> Iterator[Finding]:
    captures = campaign.of("torque_map")
    if not captures:
        return
    reach = [_extremes(c) for c in captures]
    low, high = min(r[0] for r in reach), max(r[1] for r in reach)
    if not (low < -0.2 * high and high > -0.2 * low):
        yield warning(
            captures[0],
            "current_coverage",
            f"q current runs from {low:.3g} to {high:.3g} A: only one sign of torque, so friction "
            "and inverter errors do not cancel",
            "record steps of q current of the other sign as well",
        )


def _extremes(capture: Capture) -> tuple[float, float]:
    current = capture.arrays("iq_a")["iq_a"]
    return float(np.nanpercentile(current, 2.0)), float(np.nanpercentile(current, 98.0))


def _step_clocks(campaign: Campaign) -> Iterator[Finding]:
    settling = [(c, _settling_s(c)) for c in campaign.of("current_step")]
    times = [seconds for _, seconds in settling if 0.0 < seconds < math.inf]
    if not times or max(times) < SETTLING_RATIO * min(times):
        return
    usual = float(np.exp(np.median(np.log(times))))
    least = math.sqrt(SETTLING_RATIO)
    for capture, seconds in settling:
        if 0.0 < seconds < math.inf and not usual / least < seconds < usual * least:
            yield warning(
                capture,
                "clock_contradiction",
                f"its current settles in {seconds:.3g} s, where {usual:.3g} s is usual in the "
                f"steps of {campaign.motor_id}: no Ld and Lq from steps while one clock is wrong",
                "correct t_s, in seconds, or take the capture out",
            )


def _settling_s(capture: Capture) -> float:
    """Time constant of a step's current [s], roughly; infinite where it has no edge."""
    names = [n for n in LINE_CURRENTS if capture.has("t_s", n)]
    columns = capture.arrays("t_s", *names)
    current = columns[names[0]][np.isfinite(columns[names[0]])] if names else np.zeros(0)
    if current.size < 2:
        return math.inf
    return samples_per_time_constant(current) * float(np.median(np.diff(columns["t_s"])))
