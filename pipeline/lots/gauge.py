"""Gauge R&R: how much of what motors seem to differ by is the bench.

References: [1] AIAG, Measurement Systems Analysis, 4th ed., 2010, III.B (analysis of variance).
[2] R. K. Burdick, C. M. Borror, D. C. Montgomery, J. Quality Technology 35 (2003) 342 (intervals).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from pipeline.records.capture import Array
from pipeline.records.lot_constant import Gauge

POOL_FROM = 0.25
GOOD, ACCEPTABLE = 0.10, 0.30
DRAWS = 20_000
SEED = 20_100_806
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Table:
    """Analysis of variance of a crossed study.

    Attributes
    ----------
    motors, stations, repeats
        Numbers P, O and n.
    ms_part, ms_station, ms_interaction, ms_error
        Mean squares [unit²].

    """

    motors: int
    stations: int
    repeats: int
    ms_part: float
    ms_station: float
    ms_interaction: float
    ms_error: float

    @property
    def dof(self) -> tuple[int, int, int, int]:
        """Of part, station, interaction and error."""
        p, o, n = self.motors, self.stations, self.repeats
        return p - 1, o - 1, (p - 1) * (o - 1), p * o * (n - 1)

    @property
    def interaction_p(self) -> float:
        """P value of MSI/MSE: do stations rank motors differently."""
        _, _, i, e = self.dof
        if self.ms_error == 0.0:
            return 1.0 if self.ms_interaction == 0.0 else 0.0
        return float(fdtrc(i, e, self.ms_interaction / self.ms_error))


@dataclass(frozen=True, slots=True)
class Components:
    """Variances [unit²]; `interaction` is 0 where it was pooled into repeatability."""

    repeatability: float
    station: float
    interaction: float
    part: float

    @property
    def rr(self) -> float:
        """Repeatability and reproducibility."""
        return self.repeatability + self.station + self.interaction

    @property
    def percent(self) -> float:
        """Study variation of R&R over the total, 0 to 1."""
        total = self.rr + self.part
        return math.sqrt(self.rr / total) if total > 0.0 else 0.0


def anova(values: Array) -> Table:
    """The analysis of variance of a crossed gauge study.

    Parameters
    ----------
    values
        Readings [P motors, O stations, n repeats, unit].

    Returns
    -------
    Table
        Mean squares of motors, stations, their interaction and the repeats.

    Raises
    ------
    ValueError
        There are fewer than two of any.

    References
    ----------
    AIAG, Measurement Systems Analysis, 4th ed., 2010, ch. III B.

    """
    p, o, n = values.shape
    if p < 2 or o < 2 or n < 2:
        raise ValueError("a crossed study needs two motors, two stations and two repeats")
    grand, cells = values.mean(), values.mean(axis=2)
    parts, stations = cells.mean(axis=1), cells.mean(axis=0)
    ss_part = o * n * float(np.sum((parts - grand) ** 2))
    ss_station = p * n * float(np.sum((stations - grand) ** 2))
    ss_cells = n * float(np.sum((cells - parts[:, None] - stations[None, :] + grand) ** 2))
    ss_error = float(np.sum((values - cells[:, :, None]) ** 2))
    return Table(
        p,
        o,
        n,
        ss_part / (p - 1),
        ss_station / (o - 1),
        ss_cells / ((p - 1) * (o - 1)),
        ss_error / (p * o * (n - 1)),
    )


def components(table: Table, pool_from: float = POOL_FROM) -> Components:
    """Variances of a crossed gauge study by expected mean squares.

    Parameters
    ----------
    table
        Mean squares.
    pool_from
        P value of the interaction above which it is pooled with the repeats [1].

    Returns
    -------
    Components
        None below zero.

    Notes
    -----
    σ²_rep = MSE, σ²_station = (MSO − MSI)/(P n), σ²_interaction = (MSI − MSE)/n and
    σ²_part = (MSP − MSI)/(O n); pooled, MSI and MSE are both their mean by degrees of freedom.

    References
    ----------
    AIAG, Measurement Systems Analysis, 4th ed., 2010, ch. III B.

    """
    pooled = table.interaction_p > pool_from
    msi, mse = _pooled(table) if pooled else (table.ms_interaction, table.ms_error)
    return Components(
        repeatability=mse,
        station=max(0.0, (table.ms_station - msi) / (table.motors * table.repeats)),
        interaction=0.0 if pooled else max(0.0, (msi - mse) / table.repeats),
        part=max(0.0, (table.ms_part - msi) / (table.stations * table.repeats)),
    )


def _pooled(table: Table) -> tuple[float, float]:
    _, _, i, e = table.dof
    mean = (i * table.ms_interaction + e * table.ms_error) / (i + e)
    return mean, mean


def study(values: Array, level: float = LEVEL) -> Gauge:
    """Gauge repeatability and reproducibility, with the interval of its share of the spread.

    Parameters
    ----------
    values
        Readings [P motors, O stations, n repeats, unit].
    level
        Coverage of the interval [1].

    Returns
    -------
    Gauge
        `good` below 10 % of the study variation, `acceptable` up to 30 %.

    Raises
    ------
    ValueError
        There are fewer than two motors, stations or repeats.

    Notes
    -----
    The interval is the generalized one: each mean square times its degrees of freedom over its own
    chi-square draw, then the components and their ratio, `DRAWS` times from a fixed seed. In the
    interval the interaction is never pooled.

    References
    ----------
    Burdick, Borror and Montgomery, J. Quality Technology 35(4), 2003, 342,
    doi:10.1080/00224065.2003.11980232.

    """
    table = anova(values)
    parts = components(table)
    low, high = _interval(table, level)
    share = parts.percent
    return Gauge(
        motors=table.motors,
        stations=table.stations,
        repeats=table.repeats,
        repeatability=math.sqrt(parts.repeatability),
        reproducibility=math.sqrt(parts.station + parts.interaction),
        rr=math.sqrt(parts.rr),
        part=math.sqrt(parts.part),
        percent=100.0 * share,
        percent_low=100.0 * low,
        percent_high=100.0 * high,
        level=level,
        verdict="good"
        if share < GOOD
        else "acceptable"
        if share <= ACCEPTABLE
        else "not_acceptable",
    )


def _interval(table: Table, level: float) -> tuple[float, float]:
    rng = np.random.default_rng(SEED)
    p, o, n = table.motors, table.stations, table.repeats
    squares = (table.ms_part, table.ms_station, table.ms_interaction, table.ms_error)
    drawn = [
        ms * dof / rng.chisquare(dof, DRAWS) for ms, dof in zip(squares, table.dof, strict=True)
    ]
    msp, mso, msi, mse = drawn
    rr = mse + np.maximum((mso - msi) / (p * n), 0.0) + np.maximum((msi - mse) / n, 0.0)
    part = np.maximum((msp - msi) / (o * n), 0.0)
    total = rr + part
    share = np.sqrt(np.divide(rr, total, out=np.zeros_like(rr), where=total > 0.0))
    low, high = np.quantile(share, [0.5 - level / 2.0, 0.5 + level / 2.0])
    return float(low), float(high)
