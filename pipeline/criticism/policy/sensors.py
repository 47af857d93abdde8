"""Constants of judgement of how noisy and how coarse a sensor is, from its own recording."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorNoise:
    """White noise by third differences, and the step of a rounding."""

    block: int = chosen(
        48, "samples", "length of a block of third differences",
        why="shorter ones scatter more, longer ones are seldom free of steps and bursts",
    )  # fmt: skip
    blocks: int = chosen(
        12, "1", "blocks of a short record at the least",
        why="some are free of steps where a multimeter took twenty rows of each level",
    )  # fmt: skip
    shortest_block: int = derived(
        8, "samples", "length of its blocks at the least",
        source="a mean square of the 3.6 degrees of freedom of eight third differences",
    )  # fmt: skip
    quiet: tuple[float, ...] = chosen(
        (0.3, -0.5244), "1", "quantile over the blocks, and the normal variable's value there",
        why="a low one, since steps and bursts only add",
    )  # fmt: skip
    steps_growth: float = chosen(
        1.5, "1", "noise of longer blocks over that of shorter ones from which on they have steps",
        why="of white noise both are the same to a few percent; levels of fifty rows made it ten "
        "to forty",
    )  # fmt: skip
    wave_rows: int = chosen(
        3, "samples", "third differences that a block has for each wave it is fitted with",
        why="a third of them are fitted then, and what that takes of white noise is made up for",
    )  # fmt: skip
    still: float = derived(
        1e-3, "1", "third difference of a wave, over the largest, below which it is left out",
        source="of a turn of a tenth of a radian a row, beside waves of a radian",
    )  # fmt: skip
    motion_growth: float = derived(
        4.0, "1", "growth of a noise with means of twice the length that no noise has",
        source="a loop of second order falls by 40 dB a decade; a smooth motion grows by eleven",
    )  # fmt: skip
    window_means: float = chosen(
        5.0, "1", "the longest means in which a speed's noise is looked at, in a window",
        why="third differences of them see two waves a window, as its acceleration does; an eighth "
        "was held against twelve logs first, and saw less than their residuals had",
    )  # fmt: skip
    steady: tuple[float, ...] = chosen(
        (0.6, 0.2533), "1", "the same of an angle", why="its rounding comes and goes"
    )
    smooth: tuple[int, ...] = chosen(
        (21, 51, 101, 201, 401), "samples", "parabolas that smooth a signal to be rounded anew",
        why="of a few samples it still is a stair, of many its bends are lost",
    )  # fmt: skip
    smooth_share: float = chosen(
        1.05, "1", "what they may leave, over the rounding's standard deviation",
        why="a twentieth is the scatter of a standard deviation of 200 samples",
    )  # fmt: skip
    smooth_part: int = derived(
        200, "samples", "part of a signal that has a parabola of its own length",
        source="`smooth_share` is the scatter of as many",
    )  # fmt: skip
    burst: float = chosen(
        12.0, "1", "third difference over the median one that is a jump and not the rounding",
        why="rounding alone comes to four",
    )  # fmt: skip
    between: float = chosen(
        0.01, "1", "share of third differences between digits of a file and a step far above them",
        why="of steps alone there are none in between; of a noisy angle they have every size",
    )  # fmt: skip
    together: float = derived(
        0.5, "1", "coherence of the phase below which there is no step",
        source="noise of 0.04 steps, added after the rounding, comes to it",
    )  # fmt: skip
    high: float = derived(
        0.9, "1", "share of the highest coherence that a larger step needs to be preferred",
        source="a peak at 1.5 steps has 0.82 at a slow steady speed",
    )  # fmt: skip
    snap_octaves: float = chosen(
        0.06, "octaves", "distance within which a whole number of steps a turn is taken",
        why="4 %; 2000 counts are 0.034 from 2048, which the coherence separates",
    )  # fmt: skip
    snap_loss: float = chosen(
        0.01, "1", "coherence that it may lose", why="less than two neighbours differ by"
    )
    whole: float = chosen(
        0.05, "steps", "distance from a whole number of steps that is none",
        why="distances of no step come so near one time in ten",
    )  # fmt: skip
    mostly: float = chosen(
        0.95, "1", "share of all distances that must be whole for a signal to have a resolution",
        why="a few readings are averages",
    )  # fmt: skip
    undithered: float = derived(
        0.45, "steps", "noise below which a rounding error follows the signal",
        source="Widrow and Kollar, ch. 19: half a step makes it white",
    )  # fmt: skip
    moving: float = chosen(
        16.0, "steps", "travel of an angle that may be in steps",
        why="one that stands still is in step with anything",
    )  # fmt: skip
    in_step: float = chosen(
        0.9, "1", "coherence that it then needs", why="noise of 0.07 steps comes to it"
    )
    most_readings: int = chosen(
        128,
        "1",
        "readings of an encoder at the most whose mean a drive logs as one",
        why="drives control at 8 to 100 kHz and log at 100 Hz and more",
    )
