"""Constants of judgement of `validation`: error maps, runs and held-out traces."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Cells of maps, floors of runs, windows that are run.

    Attributes
    ----------
    speed_cells : 1
        cells of speed of a map
        chosen: more hold fewer visits each
    current_cells : 1
        cells of current of a map
        chosen: more hold fewer visits each
    curve_cells : 1
        cells of a curve
        chosen: more hold fewer visits each
    angle_cells : 1
        cells of an electrical turn, 10° each
        chosen: six of each of its sixth harmonic's waves
    most_angle_cells : 1
        cells of a mechanical turn at the most
        chosen: a picture's width
    histogram_reach : noise floors
        reach of a histogram to either side
        chosen: what is beyond is an outlier
    histogram_cells : 1
        cells of a histogram
        chosen: a quarter of a noise floor each
    run_replicates : 1
        times that noise is added to a run at the least
        chosen: cost
    run_pooled : window means
        window means that a run's floor is pooled over
        chosen: a floor is known to 7 %, the root of 1/(2·96)
    look_s : s
        length of the means that pictures show
        chosen: shorter, and noise covers the torque; longer, and steps of currents are rounded
    most_rounds : 1
        Newton's steps of a run at the most
        chosen: what has not settled by then does not
    shortest : samples
        window that is worth a run
        chosen: of less, a run is its own start
    lost : largest currents and electrical turns
        correction from which on a window never settles
        chosen: beyond any machine

    """

    speed_cells: int = 16
    current_cells: int = 12
    curve_cells: int = 12
    angle_cells: int = 36
    most_angle_cells: int = 512
    histogram_reach: float = 8.0
    histogram_cells: int = 64
    run_replicates: int = 2
    run_pooled: int = 96
    look_s: float = 1e-3
    most_rounds: int = 15
    shortest: int = 32
    lost: float = 30.0
