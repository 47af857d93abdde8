"""What part of a difference is the station's: links between stations, their biases, with u.

A station reads all its motors too high or too low by one amount. A lot that was measured on one
station alone says nothing of it; what links stations are golden motors measured on all of them,
lots that were split over them, and a station that measured both sides.

Model: y = block + station + error, a block being a lot or a golden motor; solved by weighted least
squares with the blocks eliminated. Where readings scatter by more than they state, the biases'
uncertainty grows by as much (Birge's ratio). Reference: S. R. Searle, G. Casella, C. E. McCulloch,
Variance Components, 1992, 4.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.records.capture import Array


@dataclass(frozen=True, slots=True)
class Reading:
    """One value on one station.

    Attributes
    ----------
    block
        Readings of one block are of one motor or lot.
    station
        The station; several are joined.
    value, sd
        Value and standard deviation of its error [unit].

    """

    block: str
    station: str
    value: float
    sd: float


@dataclass(frozen=True, slots=True)
class Correction:
    """Biases of linked stations.

    Attributes
    ----------
    group
        Number of the linked set of each station; stations of different sets cannot be compared.
    bias
        Of each station [unit]; they sum to zero in a set, 0 for a station alone.
    covariance
        Of the biases [unit²].

    """

    group: Mapping[str, int]
    bias: Mapping[str, float] = field(default_factory=dict)
    covariance: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def linked(self, one: Iterable[str], other: Iterable[str]) -> bool:
        """Whether all of some stations are of one linked set.

        Parameters
        ----------
        one
            Stations.
        other
            Further stations.

        """
        return len({self.group[station] for station in {*one, *other}}) <= 1

    def of(self, station: str) -> float:
        """The bias of a station.

        Parameters
        ----------
        station
            The station.

        Returns
        -------
        float
            To subtract from a value [unit].

        """
        return self.bias.get(station, 0.0)

    def u_of(self, station: str) -> float:
        """Standard uncertainty of the bias of a station.

        Parameters
        ----------
        station
            The station.

        Returns
        -------
        float
            In the unit of the constant.

        """
        return math.sqrt(max(self.covariance.get((station, station), 0.0), 0.0))

    def u_of_contrast(self, shares: Mapping[str, float]) -> float:
        """Standard uncertainty of a weighted sum of biases.

        Parameters
        ----------
        shares
            Weight of each station.

        Returns
        -------
        float
            Of Σ share · bias [unit].

        """
        total = sum(
            one * other * self.covariance.get((a, b), 0.0)
            for a, one in shares.items()
            for b, other in shares.items()
        )
        return math.sqrt(max(total, 0.0))


def station_correction(readings: Sequence[Reading], stations: Iterable[str]) -> Correction:
    """Biases of stations from readings of the same lots and golden motors on several of them.

    Parameters
    ----------
    readings
        Values of a block (a lot or a golden motor) on a station, each with its standard deviation.
    stations
        Names of all stations that matter, read or not.

    Returns
    -------
    Correction
        Biases sum to zero within each linked set; stations of different sets cannot be compared.

    Notes
    -----
    y = block + station + error by weighted least squares, the blocks eliminated. Where readings
    scatter by more than they state, the covariance is multiplied by χ²/dof (Birge's ratio,
    squared).

    References
    ----------
    Searle, Casella and McCulloch, Variance Components, Wiley, 1992, ch. 4.
    R. T. Birge, Phys. Rev. 40, 1932, 207, doi:10.1103/PhysRev.40.207.

    Examples
    --------
    One motor reads 10 on A and 12 on B:

    >>> readings = [Reading("motor 1", "A", 10.0, 1.0), Reading("motor 1", "B", 12.0, 1.0)]
    >>> found = station_correction(readings, ["A", "B", "C"])
    >>> round(found.of("A"), 9), round(found.of("B"), 9), found.linked(["A"], ["C"])
    (-1.0, 1.0, False)

    """
    names = sorted({*stations, *(reading.station for reading in readings)})
    blocks: dict[str, set[str]] = {}
    for reading in readings:
        blocks.setdefault(reading.block, set()).add(reading.station)
    group = _components(names, blocks.values())
    bias: dict[str, float] = {}
    covariance: dict[tuple[str, str], float] = {}
    for number in sorted(set(group.values())):
        members = [name for name in names if group[name] == number]
        if len(members) > 1:
            linked = [r for r in readings if r.station in members and len(blocks[r.block]) > 1]
            _solve(linked, members, bias, covariance)
    return Correction(group, bias, covariance)


def _components(names: Sequence[str], links: Iterable[set[str]]) -> dict[str, int]:
    """The number of the connected set of each name."""
    parent = {name: name for name in names}

    def root(name: str) -> str:
        while parent[name] != name:
            name = parent[name]
        return name

    for linked in links:
        first, *rest = sorted(linked)
        for other in rest:
            parent[root(other)] = root(first)
    roots = sorted({root(name) for name in names})
    return {name: roots.index(root(name)) for name in names}


def _solve(
    readings: Sequence[Reading],
    members: Sequence[str],
    bias: dict[str, float],
    covariance: dict[tuple[str, str], float],
) -> None:
    """Least squares with the weighted mean of each block taken off, biases adding to zero."""
    size = len(members)
    column = {name: k for k, name in enumerate(members)}
    normal, right = np.zeros((size, size)), np.zeros(size)
    by_block: dict[str, list[Reading]] = {}
    for reading in readings:
        by_block.setdefault(reading.block, []).append(reading)
    floor = 1e-12 * max((abs(r.value) for r in readings), default=1.0) or 1e-12
    for block in by_block.values():
        weight = np.array([1.0 / max(r.sd, floor) ** 2 for r in block])
        design = np.zeros((len(block), size))
        design[np.arange(len(block)), [column[r.station] for r in block]] = 1.0
        value = np.array([r.value for r in block])
        share = weight / weight.sum()
        design -= share @ design
        value = value - share @ value
        normal += design.T @ (weight[:, None] * design)
        right += design.T @ (weight * value)
    scale = float(np.trace(normal)) / size
    readings_left = len(readings) - len(by_block) - size + 1
    constrained = normal + scale / size * np.ones((size, size))
    inverse = np.linalg.inv(constrained)
    solution = inverse @ right
    # The constraint's own share of the inverse carries no information.
    spread = inverse - np.ones((size, size)) / (scale * size)
    spread *= max(
        1.0, _chi_squared(by_block.values(), column, solution, floor) / max(readings_left, 1)
    )
    for a, k in column.items():
        bias[a] = float(solution[k] - solution.mean())
        for b, j in column.items():
            covariance[a, b] = float(spread[k, j])


def _chi_squared(
    blocks: Iterable[Sequence[Reading]], column: Mapping[str, int], solution: Array, floor: float
) -> float:
    """Sum of squares of the weighted residuals."""
    total = 0.0
    for block in blocks:
        weight = np.array([1.0 / max(r.sd, floor) ** 2 for r in block])
        residual = np.array([r.value - solution[column[r.station]] for r in block])
        residual -= np.sum(weight * residual) / weight.sum()
        total += float(np.sum(weight * residual**2))
    return total
