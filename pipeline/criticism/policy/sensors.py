"""Constants of judgement of how noisy and how coarse a sensor is, from its own recording."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorNoise:
    """White noise by third differences, and the step of a rounding.

    Attributes
    ----------
    block : samples
        length of a block of third differences
        chosen: shorter ones scatter more, longer ones are seldom free of steps and bursts
    blocks : 1
        blocks of a short record at the least
        chosen: some are free of steps where a multimeter took twenty rows of each level
    shortest_block : samples
        length of its blocks at the least
        derived: a mean square of the 3.6 degrees of freedom of eight third differences
    quiet : 1
        quantile over the blocks, and the normal variable's value there
        chosen: a low one, since steps and bursts only add
    steps_growth : 1
        noise of longer blocks over that of shorter ones from which on they have steps
        chosen: of white noise both are the same to a few percent; levels of fifty rows made it ten
        to forty
    wave_rows : samples
        third differences that a block has for each wave it is fitted with
        chosen: a third of them are fitted then, and what that takes of white noise is made up for
    still : 1
        third difference of a wave, over the largest, below which it is left out
        derived: of a turn of a tenth of a radian a row, beside waves of a radian
    motion_growth : 1
        growth of a noise with means of twice the length that no noise has
        derived: a loop of second order falls by 40 dB a decade; a smooth motion grows by eleven
    window_means : 1
        the longest means in which a speed's noise is looked at, in a window
        chosen: third differences of them see two waves a window, as its acceleration does; an
        eighth was held against twelve logs first, and saw less than their residuals had
    steady : 1
        the same of an angle
        chosen: its rounding comes and goes
    smooth : samples
        parabolas that smooth a signal to be rounded anew
        chosen: of a few samples it still is a stair, of many its bends are lost
    smooth_share : 1
        what they may leave, over the rounding's standard deviation
        chosen: a twentieth is the scatter of a standard deviation of 200 samples
    smooth_part : samples
        part of a signal that has a parabola of its own length
        derived: `smooth_share` is the scatter of as many
    burst : 1
        third difference over the median one that is a jump and not the rounding
        chosen: rounding alone comes to four
    between : 1
        share of third differences between digits of a file and a step far above them
        chosen: of steps alone there are none in between; of a noisy angle they have every size
    together : 1
        coherence of the phase below which there is no step
        derived: noise of 0.04 steps, added after the rounding, comes to it
    high : 1
        share of the highest coherence that a larger step needs to be preferred
        derived: a peak at 1.5 steps has 0.82 at a slow steady speed
    snap_octaves : octaves
        distance within which a whole number of steps a turn is taken
        chosen: 4 %; 2000 counts are 0.034 from 2048, which the coherence separates
    snap_loss : 1
        coherence that it may lose
        chosen: less than two neighbours differ by
    whole : steps
        distance from a whole number of steps that is none
        chosen: distances of no step come so near one time in ten
    mostly : 1
        share of all distances that must be whole for a signal to have a resolution
        chosen: a few readings are averages
    undithered : steps
        noise below which a rounding error follows the signal
        derived: Widrow and Kollar, ch. 19: half a step makes it white
    moving : steps
        travel of an angle that may be in steps
        chosen: one that stands still is in step with anything
    in_step : 1
        coherence that it then needs
        chosen: noise of 0.07 steps comes to it
    own_noise : deviance
        by which a record's own noise of its encoder must be likelier than that of all records
        chosen: as two effects that tie
    most_readings : 1
        readings of an encoder at the most whose mean a drive logs as one
        chosen: drives control at 8 to 100 kHz and log at 100 Hz and more

    """

    block: int = 48
    blocks: int = 12
    shortest_block: int = 8
    quiet: tuple[float, ...] = (0.3, -0.5244)
    steps_growth: float = 1.5
    wave_rows: int = 3
    still: float = 1e-3
    motion_growth: float = 4.0
    window_means: float = 5.0
    steady: tuple[float, ...] = (0.6, 0.2533)
    smooth: tuple[int, ...] = (21, 51, 101, 201, 401)
    smooth_share: float = 1.05
    smooth_part: int = 200
    burst: float = 12.0
    between: float = 0.01
    together: float = 0.5
    high: float = 0.9
    snap_octaves: float = 0.06
    snap_loss: float = 0.01
    whole: float = 0.05
    mostly: float = 0.95
    undithered: float = 0.45
    moving: float = 16.0
    in_step: float = 0.9
    own_noise: float = 12.0
    most_readings: int = 128
