"""Constants of judgement of `validation`: error maps, runs and held-out traces."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Cells of maps, floors of runs, windows that are run."""

    speed_cells: int = chosen(
        16, unit="1", meaning="cells of speed of a map", why="more hold fewer visits each"
    )
    current_cells: int = chosen(
        12, unit="1", meaning="cells of current of a map", why="more hold fewer visits each"
    )
    curve_cells: int = chosen(
        12, unit="1", meaning="cells of a curve", why="more hold fewer visits each"
    )
    angle_cells: int = chosen(
        36,
        unit="1",
        meaning="cells of an electrical turn, 10° each",
        why="six of each of its sixth harmonic's waves",
    )
    most_angle_cells: int = chosen(
        512, unit="1", meaning="cells of a mechanical turn at the most", why="a picture's width"
    )
    histogram_reach: float = chosen(
        8.0,
        unit="noise floors",
        meaning="reach of a histogram to either side",
        why="what is beyond is an outlier",
    )
    histogram_cells: int = chosen(
        64, unit="1", meaning="cells of a histogram", why="a quarter of a noise floor each"
    )
    run_replicates: int = chosen(
        2, unit="1", meaning="times that noise is added to a run at the least", why="cost"
    )
    run_pooled: int = chosen(
        96,
        unit="window means",
        meaning="window means that a run's floor is pooled over",
        why="a floor is known to 7 %, the root of 1/(2·96)",
    )
    look_s: float = chosen(
        1e-3,
        unit="s",
        meaning="length of the means that pictures show",
        why="shorter, and noise covers the torque; longer, and steps of currents are rounded",
    )
    most_rounds: int = chosen(
        15,
        unit="1",
        meaning="Newton's steps of a run at the most",
        why="what has not settled by then does not",
    )
    shortest: int = chosen(
        32,
        unit="samples",
        meaning="window that is worth a run",
        why="of less, a run is its own start",
    )
    lost: float = chosen(
        30.0,
        unit="largest currents and electrical turns",
        meaning="correction from which on a window never settles",
        why="beyond any machine",
    )
