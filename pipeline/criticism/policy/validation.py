"""Constants of judgement of `validation`: error maps, runs and held-out traces."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Cells of maps, floors of runs, windows that are run."""

    speed_cells: int = chosen(16, "1", "cells of speed of a map", why="more hold fewer visits each")
    current_cells: int = chosen(
        12, "1", "cells of current of a map", why="more hold fewer visits each"
    )
    curve_cells: int = chosen(12, "1", "cells of a curve", why="more hold fewer visits each")
    angle_cells: int = chosen(
        36, "1", "cells of an electrical turn, 10° each",
        why="six of each of its sixth harmonic's waves",
    )  # fmt: skip
    most_angle_cells: int = chosen(
        512, "1", "cells of a mechanical turn at the most", why="a picture's width"
    )
    histogram_reach: float = chosen(
        8.0, "noise floors", "reach of a histogram to either side",
        why="what is beyond is an outlier",
    )  # fmt: skip
    histogram_cells: int = chosen(
        64, "1", "cells of a histogram", why="a quarter of a noise floor each"
    )
    run_replicates: int = chosen(
        2, "1", "times that noise is added to a run at the least", why="cost"
    )
    run_pooled: int = chosen(
        96, "window means", "window means that a run's floor is pooled over",
        why="a floor is known to 7 %, the root of 1/(2·96)",
    )  # fmt: skip
    look_s: float = chosen(
        1e-3, "s", "length of the means that pictures show",
        why="shorter, and noise covers the torque; longer, and steps of currents are rounded",
    )  # fmt: skip
    most_rounds: int = chosen(
        15, "1", "Newton's steps of a run at the most", why="what has not settled by then does not"
    )
    shortest: int = chosen(
        32, "samples", "window that is worth a run", why="of less, a run is its own start"
    )
    lost: float = chosen(
        30.0, "largest currents and electrical turns",
        "correction from which on a window never settles",
        why="beyond any machine",
    )  # fmt: skip
