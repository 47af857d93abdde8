"""Constants of judgement of a shaft in two parts, and of currents between the rows of a log."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import calibrated, chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Torsion:
    """Windows in which a coupling's twist is looked at, and the fit of its law."""

    blocks_s: tuple[float, ...] = chosen(
        (0.5e-3, 1e-3, 2e-3, 4e-3), "s", "lengths of a block, the first that keeps noise small",
        why="what a gap does is short",
    )  # fmt: skip
    torque_u: float = chosen(
        5.0, "standard deviations of noise", "torque that is certainly one",
        why="lower, and blocks in which the gap is open count as closed",
    )  # fmt: skip
    noise_share: float = chosen(
        0.08, "1", "what is certainly a torque, as a share of the torque's scatter, at the most",
        why="with a larger one few blocks are closed",
    )  # fmt: skip
    window_s: float = chosen(
        0.03, "s", "length of a window", why="in a longer one an unrecorded load is no constant"
    )
    window_blocks: int = chosen(
        12, "blocks", "blocks of a window at the least",
        why="a parabola and three columns leave little of a shorter one",
    )  # fmt: skip
    closed_blocks: int = chosen(
        10, "blocks", "blocks of a window that pass torque on, at the least",
        why="a parabola and three columns leave little of fewer",
    )  # fmt: skip
    torque_range: float = chosen(
        10.0, "1", "range of the torque in a window over what is certainly a torque",
        why="under an even torque a twist is a constant",
    )  # fmt: skip
    torque_moves: float = chosen(
        0.5, "1", "range of the torque in a window over its scatter in the log",
        why="under an even torque a twist is a constant",
    )  # fmt: skip
    starts_rad: tuple[float, ...] = chosen(
        (0.0, 3e-4, 1e-3, 3e-3, 1e-2), "rad", "gaps that a fit is begun with",
        why="a factor of three apart over what couplings have",
    )  # fmt: skip
    rounds: int = chosen(40, "1", "renewals of the weights at the most", why="a bound of the cost")
    settled: float = chosen(
        1e-3, "1", "relative change that ends the renewals", why="far below any uncertainty"
    )
    usual: float = derived(
        0.25, "1", "quantile of the turning windows' χ²/n up to which a window counts in full",
        source="the lower quartile; a higher one lets windows in which a load jumps decide",
    )  # fmt: skip
    mean_s: float = chosen(
        0.5e-3, "s", "length of a running mean of the torque that a coupling passes on",
        why="a ringing of 290 Hz passes to one per cent; longer means take a part of it, shorter "
        "ones leave the encoder's rounding",
    )  # fmt: skip
    mean_samples: int = derived(
        7, "samples", "samples of that mean at the most",
        source="six of them and a difference stay within the samples kept around a window",
    )  # fmt: skip
    sure_u: float = chosen(
        3.5, "standard uncertainties", "distance of a gap or softness from what it is held against",
        why="chance passes it once in four thousand",
    )  # fmt: skip
    least_shown: float = chosen(
        0.5, "1", "share of a fit's twist or gap, and of its 1/J, that full logs show at the least",
        why="damping and drags move what they show by some per cent; another cause than a twist "
        "leaves a tenth of it",
    )  # fmt: skip
    windows: int = chosen(
        6, "windows", "windows with torque of both signs that a look needs",
        why="their scatter is the uncertainty, and of fewer it is not known",
    )  # fmt: skip
    no_gap_rad: float = derived(
        2e-4, "rad", "gap below which none matters", source="the negligible size of `backlash`"
    )
    odd: float = chosen(
        25.0, "1", "the most that this χ²/n may be",
        why="where most windows miss the equation by more, none is usual",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Ripple:
    """Waves of a log's current between its rows."""

    rows: int = calibrated(
        64, "rows", "rows of a log that determine the waves of its current between rows",
        by="24 to 96 rows, before waves had to predict others",
        on="harmonics of the back-EMF in 1 kHz telemetry: 1.5 noise floors were left at 24 rows, "
        "1.3 at 48, 0.8 at 64 and 96",
    )  # fmt: skip
    slow: float = chosen(
        0.1, "cycles a row", "how slowly phases move on at which a wave is taken as a slow current",
        why="a control loop moves the current in some ten rows; at half of it steps of a speed's "
        "reference passed for waves",
    )  # fmt: skip
    fast_share: float = chosen(
        0.5, "1", "share of a wave's power in its rows, beside what is slow, that shows its size",
        why="a wave is all slow or hardly: in between its phases pass the limit within its rows",
    )  # fmt: skip
    predicted: float = chosen(
        0.5, "1", "share of what is not slow that waves predict in rows they were not fitted to",
        why="with less, most of it is something else; at 0.7 harmonics left 1.7 noise floors",
    )  # fmt: skip
