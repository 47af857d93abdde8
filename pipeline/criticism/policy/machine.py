"""Constants of judgement of a shaft in two parts, and of currents between the rows of a log."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Torsion:
    """Windows in which a coupling's twist is looked at, and the fit of its law.

    Attributes
    ----------
    blocks_s : s
        lengths of a block, the first that keeps noise small
        chosen: what a gap does is short
    torque_u : standard deviations of noise
        torque that is certainly one
        chosen: lower, and blocks in which the gap is open count as closed
    noise_share : 1
        what is certainly a torque, as a share of the torque's scatter, at the most
        chosen: with a larger one few blocks are closed
    window_s : s
        length of a window
        chosen: in a longer one an unrecorded load is no constant
    window_blocks : blocks
        blocks of a window at the least
        chosen: a parabola and three columns leave little of a shorter one
    closed_blocks : blocks
        blocks of a window that pass torque on, at the least
        chosen: a parabola and three columns leave little of fewer
    torque_range : 1
        range of the torque in a window over what is certainly a torque
        chosen: under an even torque a twist is a constant
    torque_moves : 1
        range of the torque in a window over its scatter in the log
        chosen: under an even torque a twist is a constant
    starts_rad : rad
        gaps that a fit is begun with
        chosen: a factor of three apart over what couplings have
    rounds : 1
        renewals of the weights at the most
        chosen: a bound of the cost
    settled : 1
        relative change that ends the renewals
        chosen: far below any uncertainty
    usual : 1
        quantile of the turning windows' χ²/n up to which a window counts in full
        derived: the lower quartile; a higher one lets windows in which a load jumps decide
    mean_s : s
        length of a running mean of the torque that a coupling passes on
        chosen: a ringing of 290 Hz passes to one per cent; longer means take a part of it, shorter
        ones leave the encoder's rounding
    mean_samples : samples
        samples of that mean at the most
        derived: six of them and a difference stay within the samples kept around a window
    sure_u : standard uncertainties
        distance of a gap or softness from what it is held against
        chosen: chance passes it once in four thousand
    least_shown : 1
        share of a fit's twist or gap, and of its 1/J, that full logs show at the least
        chosen: damping and drags move what they show by some per cent; another cause than a twist
        leaves a tenth of it
    windows : windows
        windows with torque of both signs that a look needs
        chosen: their scatter is the uncertainty, and of fewer it is not known
    no_gap_rad : rad
        gap below which none matters
        derived: the negligible size of `backlash`
    odd : 1
        the most that this χ²/n may be
        chosen: where most windows miss the equation by more, none is usual

    """

    blocks_s: tuple[float, ...] = (0.5e-3, 1e-3, 2e-3, 4e-3)
    torque_u: float = 5.0
    noise_share: float = 0.08
    window_s: float = 0.03
    window_blocks: int = 12
    closed_blocks: int = 10
    torque_range: float = 10.0
    torque_moves: float = 0.5
    starts_rad: tuple[float, ...] = (0.0, 3e-4, 1e-3, 3e-3, 1e-2)
    rounds: int = 40
    settled: float = 1e-3
    usual: float = 0.25
    mean_s: float = 0.5e-3
    mean_samples: int = 7
    sure_u: float = 3.5
    least_shown: float = 0.5
    windows: int = 6
    no_gap_rad: float = 2e-4
    odd: float = 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ripple:
    """Waves of a log's current between its rows.

    Attributes
    ----------
    rows : rows
        rows of a log that determine the waves of its current between rows
        calibrated: `24 to 96 rows, before waves had to predict others` on harmonics of the back-EMF
        in 1 kHz telemetry: 1.5 noise floors were left at 24 rows, 1.3 at 48, 0.8 at 64 and 96
    slow : cycles a row
        how slowly phases move on at which a wave is taken as a slow current
        chosen: a control loop moves the current in some ten rows; at half of it steps of a speed's
        reference passed for waves
    fast_share : 1
        share of a wave's power in its rows, beside what is slow, that shows its size
        chosen: a wave is all slow or hardly: in between its phases pass the limit within its rows
    predicted : 1
        share of what is not slow that waves predict in rows they were not fitted to
        chosen: with less, most of it is something else; at 0.7 harmonics left 1.7 noise floors

    """

    rows: int = 64
    slow: float = 0.1
    fast_share: float = 0.5
    predicted: float = 0.5
