"""The signature of each effect, drawn from the simulator: what it adds to a noise-free recording.

Each effect is simulated at its typical size on a motor without any other effect, in the tests that
excite it. The same tests are simulated without it. Of all recorded columns, the one that changes
most is drawn, against the variable that explains the change best.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.api.figure import Figure, figure
from pipeline.api.simulated import single
from pipeline.criticism.effect import Effect
from pipeline.records.evidence import Evidence, Series
from pipeline.report.charts.chart import chart
from pipeline.settings import SimulateSettings
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import Recording
from pipeline.simulator.effects import FORMS

Array = NDArray[np.float64]

DESIGN, SEED = "servo-ipm", 1
CLOCK_REL = 5e-3
"""Error of the recorder's clock that stands for `clock_scale`, which is no effect of a motor."""
CAUSES = ("id_a", "iq_a", "ia_a", "omega_mech_rad_s", "theta_mech_rad", "freq_hz", "t_s")
"""Variables that a change is drawn against; where two explain it alike, the first."""
NOT_DRAWN = frozenset({"theta_mech_rad", "temp_winding_degc", "temp_magnet_degc"})
FEW_POINTS = frozenset({"holding_current", "lcr"})
"""Tests at single points, whose change has no shape."""
CELLS, POINTS = 360, 800
LARGE, SMALLEST, CONSTANT = 0.2, 1e-9, 1e-4
PERIODS, RARE = 6, 0.01
"""Periods of an order that are drawn; changes beyond these quantiles are transients."""
TURN_RAD = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class Signature:
    """A change [n, unit of `column`] against `x` [n, unit of `cause`].

    `explained` is the share of its variance that means over cells of `x` explain.
    """

    capture: str
    column: str
    cause: str
    x: Array
    change: Array
    explained: float

    @property
    def clear(self) -> bool:
        """Whether a variable other than time explains most of the change."""
        return self.cause != "t_s" and self.explained > 0.5

    def figure(self, title: str) -> Figure:
        """The drawing: the change as dots."""
        low, high = np.quantile(self.change, (RARE, 1.0 - RARE))
        room = high - low
        shown = (self.change >= low - room) & (self.change <= high + room)
        if self.cause == "theta_mech_rad":
            shown &= self.x <= PERIODS * TURN_RAD / max(_order(self.x, self.change), PERIODS)
        rows = np.flatnonzero(shown)
        kept = rows[np.linspace(0, rows.size - 1, min(POINTS, rows.size)).astype(int)]
        series = Series("", self.x[kept], self.change[kept], np.empty(0))
        drawn = Evidence("", title, self.cause, self.column, "scatter", (series,))
        return figure(f"{title}: change of {self.column} in {self.capture}", chart(drawn))


def simulated(effect: Effect) -> bool:
    """Whether the simulator has the effect."""
    return effect.name in FORMS or effect.name == "clock_scale"


def signature(effect: Effect) -> Signature:
    """The best explained of the large changes that an effect at its typical size makes.

    Raises ValueError where nothing changes.
    """
    found = [one for step in _steps(effect.tests) for one in _changes(effect.name, step)]
    if not found:
        raise ValueError(f"{effect.name} changes nothing in {', '.join(effect.tests)}")
    largest = max(size for size, _ in found)
    large = [one for size, one in found if size >= LARGE * largest]
    return max(large, key=lambda one: (one.clear, round(one.explained, 2)))


def _steps(tests: Sequence[str]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """The steps of the campaign that record these tests."""
    return (step for step in CAMPAIGN if step[1] in tests and step[1] not in FEW_POINTS)


def _changes(name: str, step: tuple[str, str, Mapping[str, Any]]) -> Iterator[tuple[float, Any]]:
    """Every change of a capture: its relative standard deviation, and its signature.

    The deviation is relative to the largest value of the same unit. Where a change is the same at
    every row, its size counts little.
    """
    before, after = (_recorded(name, step, present=there) for there in (False, True))
    for base, table in zip(before.tables, after.tables, strict=True):
        rows = min(len(next(iter(one.values()))) for one in (base, table))
        for column in sorted(table.keys() - NOT_DRAWN):
            change = table[column][:rows] - base[column][:rows]
            size = float(np.std(change) + CONSTANT * abs(np.mean(change))) / _scale(base, column)
            if size > SMALLEST:
                yield size, _best(step[0], column, table, change)


def _scale(table: Mapping[str, Array], column: str) -> float:
    """The largest value [unit of the column] of a column and of those of the same unit."""
    unit = column.rpartition("_")[2]
    same = [values for name, values in table.items() if name.rpartition("_")[2] == unit]
    return max(float(np.abs(values).max()) for values in same) or 1.0


def _best(capture: str, column: str, table: Mapping[str, Array], change: Array) -> Signature:
    """The change against the variable that explains it best; time only where no other does."""
    found = []
    for cause in CAUSES:
        of_angle = cause == "theta_mech_rad" and capture.startswith("spin_down")
        if cause in table and (cause != column or cause == "t_s") and not of_angle:
            x = table[cause][: change.size]
            x = np.mod(x, TURN_RAD) if cause == "theta_mech_rad" else x
            found.append(Signature(capture, column, cause, x, change, _explained(x, change)))
    return max(
        [one for one in found if one.clear] or found, key=lambda one: round(one.explained, 2)
    )


def _explained(x: Array, change: Array) -> float:
    """Share of the variance of a change that means over cells of x explain."""
    variance = float(np.var(change, ddof=1))
    if np.ptp(x) <= 1e-9 * np.abs(x).max() or variance == 0.0:
        return 0.0
    means, counts, cell = _cell_means(x, change)
    free = max(change.size - int(np.count_nonzero(counts)), 1)
    return 1.0 - float(np.sum((change - means[cell]) ** 2)) / free / variance


def _cell_means(x: Array, change: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Means [CELLS] and counts [CELLS] of a change in cells of x, and the cell of each row [n]."""
    cell = np.clip(((x - x.min()) / np.ptp(x) * CELLS).astype(int), 0, CELLS - 1)
    counts = np.bincount(cell, minlength=CELLS)
    return np.bincount(cell, change, CELLS) / np.maximum(counts, 1), counts, cell


def _order(x: Array, change: Array) -> int:
    """The largest order [1/turn] of a change over the angle."""
    means, _, _ = _cell_means(x, change)
    return int(np.argmax(np.abs(np.fft.rfft(means))[1:])) + 1


def _recorded(effect: str, step: tuple[str, str, Mapping[str, Any]], *, present: bool) -> Recording:
    """A noise-free recording of a motor with one effect alone, or without it."""
    settings = SimulateSettings(output="-", motor=DESIGN, effects="[]", seed=SEED, exact=True)
    ((_, design, bench, _, _),) = single(settings)
    motor = replace(design, effects=MappingProxyType({}))
    quiet = replace(bench, noise_scale=0.0)
    if effect == "clock_scale":
        quiet = replace(quiet, clock_rel=CLOCK_REL if present else 0.0)
    else:
        motor = with_effects(motor, f"[{effect}]" if present else f"[{effect}=0]")
    (recording,) = campaign(motor, quiet, SEED, (step,))
    return recording
