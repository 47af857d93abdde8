"""The numbers of one constant, baseline against candidate, before any family of tests."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.lots.lot_test import lot_test
from pipeline.lots.sample import Value
from pipeline.lots.stations import Correction, Reading, station_correction
from pipeline.lots.variance import nested
from pipeline.records.lot_constant import Side

UNSTATED = "not stated: "


@dataclass(frozen=True, slots=True)
class Contrast:
    """Candidate minus baseline.

    Attributes
    ----------
    difference, u, dof
        Difference of the means of lot means, its standard uncertainty [unit] and degrees of
        freedom.
    motor_p
        p-value of the motors; None where it cannot be had.
    lot_t, lot_dof, lot_p, lot_se
        The lot-level test and its standard error [unit]; None below two baseline lots.

    """

    difference: float
    u: float
    dof: float
    motor_p: float | None
    lot_t: float | None
    lot_dof: float | None
    lot_p: float | None
    lot_se: float | None


@dataclass(frozen=True, slots=True)
class Assessment:
    """Values corrected for their station, lot by lot, and what follows from them.

    Attributes
    ----------
    values, corrected, correction
        Values as published, corrected [unit], and the biases.
    base, candidate
        Corrected values by lot, in the order of time [unit].
    unlinked
        Baseline lots of stations that nothing links to those of the candidate.
    confounded
        Why nothing can be compared; empty where it can.
    within_sd
        Standard deviation between motors of one lot [unit].
    lots_sd
        Standard deviation between means of baseline lots [unit].
    contrast
        Candidate minus baseline.

    """

    values: tuple[Value, ...]
    corrected: Mapping[str, float]
    correction: Correction
    base: Mapping[str, tuple[float, ...]]
    candidate: Mapping[str, tuple[float, ...]]
    unlinked: tuple[str, ...]
    confounded: str
    within_sd: float | None
    lots_sd: float | None
    contrast: Contrast | None

    @property
    def base_means(self) -> list[float]:
        """Means of the baseline's lots [unit]."""
        return [float(np.mean(values)) for values in self.base.values()]

    @property
    def candidate_means(self) -> list[float]:
        """Means of the candidate's lots [unit]."""
        return [float(np.mean(values)) for values in self.candidate.values()]


class Groups(NamedTuple):
    """Corrected values of a side by lot."""

    base: dict[str, tuple[float, ...]]
    candidate: dict[str, tuple[float, ...]]


def label(value: Value) -> str:
    """The station of a value.

    Parameters
    ----------
    value
        The value; a station that is not stated is another one in every lot.

    """
    return value.station or f"{UNSTATED}{value.lot}"


def assess(values: Sequence[Value], golden: Sequence[Value], lots: Sequence[str]) -> Assessment:
    """Everything that one constant's values say of two groups of lots.

    Parameters
    ----------
    values
        One value a motor, both sides.
    golden
        Values of motors that are measured again and again, for the biases of stations; independent
        of each other.
    lots
        Names in order of time.

    Returns
    -------
    Assessment
        Its `contrast` is None without a motor on either side, and where the stations of the sides
        are not linked.

    Notes
    -----
    The unit of the baseline is the lot: its mean is the mean of lot means. The variance of the
    difference is that of motors within lots over their numbers, or that of baseline lot means where
    it is larger, plus the stations' biases and the shared gains; its degrees of freedom are
    Welch-Satterthwaite's.

    References
    ----------
    F. E. Satterthwaite, Biometrics Bulletin 2(6), 1946, 110, doi:10.2307/3002019.

    """
    correction = _corrections(values, golden)
    kept, unlinked, confounded = _linked(values, correction)
    corrected = {v.motor_id: v.value - correction.of(label(v)) for v in values}
    groups = Groups(*(_by_lot(kept, corrected, lots, side) for side in ("baseline", "candidate")))
    spread = nested([*groups.base.values(), *groups.candidate.values()])
    within = None if spread.within is None else math.sqrt(spread.within)
    means = [float(np.mean(one)) for one in groups.base.values()]
    lots_sd = float(np.std(means, ddof=1)) if len(means) > 1 else None
    contrast = None
    if groups.base and groups.candidate and not confounded:
        contrast = _contrast(kept, groups, correction, within, spread.dof_within, lots_sd)
    return Assessment(
        tuple(values),
        corrected,
        correction,
        groups.base,
        groups.candidate,
        tuple(sorted(unlinked)),
        confounded,
        within,
        lots_sd,
        contrast,
    )


def _corrections(values: Sequence[Value], golden: Sequence[Value]) -> Correction:
    cells: dict[tuple[str, str], list[float]] = {}
    for value in values:
        cells.setdefault((value.lot, label(value)), []).append(value.value)
    spread = nested(list(cells.values())).within
    typical = max((abs(v.value) for v in values), default=1.0)
    sd = math.sqrt(spread) if spread else 1e-9 * typical
    again: dict[tuple[str, str], list[float]] = {}
    for one in golden:
        again.setdefault((one.motor_id, label(one)), []).append(one.value)
    repeated = nested(list(again.values())).within or 0.0
    readings = [Reading(f"lot {v.lot}", label(v), v.value, sd) for v in values]
    readings += [
        Reading(f"motor {g.motor_id}", label(g), g.value, math.sqrt(g.u_a**2 + repeated))
        for g in golden
    ]
    return station_correction(readings, [label(v) for v in values])


def _linked(values: Sequence[Value], correction: Correction) -> tuple[list[Value], set[str], str]:
    """Values that can be compared; baseline lots that cannot; why nothing can, or nothing."""
    candidate = {label(v) for v in values if v.side == "candidate"}
    baseline = {label(v) for v in values if v.side == "baseline"}
    if not candidate or not baseline:
        return list(values), set(), ""
    sets = {correction.group[name] for name in candidate}
    if len(sets) > 1:
        words = f"the candidate's stations {_names(candidate)} are not linked to each other"
        return list(values), set(), words
    unlinked = {
        v.lot for v in values if v.side == "baseline" and correction.group[label(v)] not in sets
    }
    kept = [v for v in values if v.side == "candidate" or v.lot not in unlinked]
    if any(v.side == "baseline" for v in kept):
        return kept, unlinked, ""
    words = (
        f"station {_names(candidate)} of the candidate and {_names(baseline)} of the baseline are "
        "linked "
        "by nothing: no golden motor, no lot measured on both"
    )
    return list(values), set(), words


def _names(stations: set[str]) -> str:
    return ", ".join(sorted("(not stated)" if s.startswith(UNSTATED) else s for s in stations))


def _by_lot(
    values: Sequence[Value], corrected: Mapping[str, float], lots: Sequence[str], side: Side
) -> dict[str, tuple[float, ...]]:
    groups: dict[str, list[float]] = {}
    for value in values:
        if value.side == side:
            groups.setdefault(value.lot, []).append(corrected[value.motor_id])
    return {lot: tuple(groups[lot]) for lot in lots if lot in groups}


def _contrast(
    values: Sequence[Value],
    groups: Groups,
    correction: Correction,
    within: float | None,
    within_dof: int,
    lots_sd: float | None,
) -> Contrast:
    """The difference of the means of lot means, and how sure it is."""
    new = [float(np.mean(one)) for one in groups.candidate.values()]
    old = [float(np.mean(one)) for one in groups.base.values()]
    difference = float(np.mean(new) - np.mean(old))
    shares = _shares(values, groups)
    u_link = correction.u_of_contrast(shares)
    u_shared = _u_shared(values, groups, frozenset(_corrected_stations(shares)))
    motor_var = within**2 if within is not None else 0.0
    new_var = motor_var * _mean_share(groups.candidate)
    old_var, old_dof = motor_var * _mean_share(groups.base), float(max(within_dof, 1))
    new_dof = old_dof
    if lots_sd is not None and lots_sd**2 / len(old) > old_var:
        old_var, old_dof = lots_sd**2 / len(old), len(old) - 1.0
        parts = [(new_var, new_dof), (old_var, old_dof)]
    else:
        parts = [(new_var + old_var, new_dof)]
    fixed = u_link**2 + u_shared**2
    total = sum(part for part, _ in parts) + fixed
    loss = sum(part**2 / dof for part, dof in parts)
    dof = min(total**2 / loss, 1e9) if loss > 0.0 else 1e9
    u = math.sqrt(total)
    motor_p = None if within is None else _p_value(difference, u, dof)
    if len(old) < 2 or lots_sd is None:
        return Contrast(difference, u, dof, motor_p, None, None, None, None)
    fewer = motor_var * max(0.0, _each(groups.candidate) - _each(groups.base))
    more = math.sqrt(fixed + fewer / len(new))
    tested = lot_test(old, float(np.mean(new)), more, len(new))
    se = math.hypot(lots_sd * math.sqrt(1.0 / len(new) + 1.0 / len(old)), more)
    t, lot_dof, lot_p = (float(part) for part in tested)
    return Contrast(difference, u, dof, motor_p, t, lot_dof, lot_p, se)


def _p_value(difference: float, u: float, dof: float) -> float:
    from scipy.special import stdtr

    if u == 0.0:
        return 1.0 if difference == 0.0 else 0.0
    return float(2.0 * stdtr(dof, -abs(difference) / u))


def _mean_share(groups: Mapping[str, Sequence[float]]) -> float:
    """Σ 1/n over lots, over their number squared: what σ² of motors is in the mean of means."""
    return sum(1.0 / len(one) for one in groups.values()) / len(groups) ** 2


def _each(groups: Mapping[str, Sequence[float]]) -> float:
    """Mean of 1/n over lots: what σ² of motors is in one lot's mean."""
    return sum(1.0 / len(one) for one in groups.values()) / len(groups)


def _shares(values: Sequence[Value], groups: Groups) -> dict[str, float]:
    """Share of each station in the candidate's mean less that in the baseline's."""
    shares: dict[str, float] = {}
    for value, part in _parts(values, groups):
        shares[label(value)] = shares.get(label(value), 0.0) + part
    return shares


def _parts(values: Sequence[Value], groups: Groups) -> Iterator[tuple[Value, float]]:
    """What each value counts in the candidate's mean of lot means less the baseline's."""
    for sign, side, lots in ((1.0, "candidate", groups.candidate), (-1.0, "baseline", groups.base)):
        for value in values:
            if value.side == side and value.lot in lots:
                yield value, sign / (len(lots) * len(lots[value.lot]))


def _corrected_stations(shares: Mapping[str, float]) -> list[str]:
    """Stations whose bias was taken off and does not cancel by itself."""
    return [name for name, share in shares.items() if abs(share) > 1e-12]


def _u_shared(values: Sequence[Value], groups: Groups, corrected: frozenset[str]) -> float:
    """What instruments and assumptions common to a side leave in the difference [unit].

    Gains of one station cancel where it measured both sides alike. Those of stations whose bias
    was taken off are in the bias's own uncertainty, and are left out here.
    """
    gone = {station for joined in corrected for station in joined.split("+")}
    sums: dict[str, float] = {}
    for value, part in _parts(values, groups):
        for source, u in value.shared.items():
            if source.rpartition("@")[2] not in gone:
                sums[source] = sums.get(source, 0.0) + part * u
    return math.sqrt(sum(total**2 for total in sums.values()))
