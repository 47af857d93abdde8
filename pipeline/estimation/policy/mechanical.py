"""Numbers of judgement about torque, inertia and drag."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_D_SHARE
from pipeline.records.policy import calibrated, chosen, derived

TRIED = "the number halved and doubled"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaftRows:
    """Windows of the equation of motion."""

    drive_windows_s: tuple[float, ...] = chosen(
        (0.02, 0.04, 0.08), "s", "windows of a drive, of which the shortest that is quiet is taken",
        why="as torque changes in them",
    )  # fmt: skip
    quiet_share: float = derived(
        0.02, "1", "of the acceleration, below which a window's noise is quiet",
        source="a fiftieth adds 0.02 % to its scatter",
    )  # fmt: skip
    jump_sigmas: float = derived(
        10.0, "standard deviations of noise", "step of a current from which on it jumps",
        source="steps of white noise have 1.4, and come to five times that; their median as well",
    )  # fmt: skip
    jump_share: float = chosen(
        0.03, "1", "of the highest speed, by which a speed that jumps changes from row to row",
        why="of one pump's log at 20 Hz, J was 42 % too small at 0.1 and is withheld at 0.03",
    )  # fmt: skip
    jump_rows: int = chosen(
        3, "rows", "rows beside a jump of the speed whose windows are left out with it",
        why="as of a diagnosis: a loop settles there, in rows too few to follow it",
    )  # fmt: skip
    coast_share: float = calibrated(
        0.05, "1", "of a coast-down, that a window takes",
        by=TRIED,
        on="coasts only slow down: half or twice of it moved T_c and B by a ninth of their u",
    )  # fmt: skip
    longest_coast_window_s: float = calibrated(
        0.5, "s", "longest window of a coast-down",
        by=TRIED,
        on="coasts, where half or twice of it moved nothing",
    )  # fmt: skip
    attenuated_share: float = chosen(
        0.05, "1", "of a constant, that noise of the columns may take before it counts as unknown",
        why="beyond it the correction to first order is no measure of itself",
    )  # fmt: skip
    slowest_share: float = calibrated(
        0.01, "1", "of the highest speed, below which the shaft may stand",
        by=TRIED,
        on="drives and coasts: twice of it moved T_c and B by an eighth of their u, where there "
        "is a Stribeck's excess to lose, half of it nothing",
    )  # fmt: skip
    resolved_periods: float = calibrated(
        2.0, "samples", "shortest time constant that can be separated from a delay",
        by=TRIED,
        on="simulated logs of voltage and angle: at one sample and less kA came out up to ten "
        "times too large, at two and more its intervals held",
    )  # fmt: skip
    longest_delay_s: float = chosen(
        0.3, "s", "longest delay of the motion behind a logged voltage",
        why="filters and buses of robots delay by up to some tenths of a second",
    )  # fmt: skip
    overlap: float = derived(
        0.5, "1", "share of its samples that a window has in common with the next",
        source="as in Welch's spectra: no sample counts less than another, more only repeats",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Drag:
    """When drag has another form than Coulomb and viscous, and how much data it takes."""

    most_nuisances: int = calibrated(
        14, "1", "nuisances that may join the equation of motion",
        by=TRIED,
        on="ten simulated campaigns: half or twice of it moved no constant by a twentieth of its u",
    )  # fmt: skip
    noise_alone: float = chosen(
        2.0, "1", "χ²/n of a torque by the current's noise, at the most, where all noise is in it",
        why="there another error is as large as the noise; of one sound joint at 50 Hz it is 1.8",
    )  # fmt: skip
    least_own_share: float = chosen(
        0.15, "1", "part of a nuisance of the current that the torque does not hold, to count",
        why="what parts it is also what any other error follows: with 0.02 and 0.05 of two drives "
        "between two currents J was half of what it is, with 0.4 and more of others right",
    )  # fmt: skip
    material_share: float = derived(
        0.02, "1", "of the drag, that two numbers may leave and stand for it still",
        source="a square root of speed beside them would then have moved T_c by 20 %, B by 56 %, "
        "a cube by 6 and 25 %: they are the law's constants; half or twice chose no other form",
    )  # fmt: skip
    enough_coasting_rows: int = derived(
        12, "1", "windows of coasts that decide on the form of drag",
        source="six that share no sample, thrice what the two constants need; one coast makes 39",
    )  # fmt: skip
    rows_a_column: int = calibrated(
        10, "1", "windows that share no sample which a nuisance takes",
        by=TRIED,
        on="drives of 0.3 to 0.8 s of two motors, 60 each: 3 to 10 gave J alike within a fifth of "
        "u, at 15 a nuisance was left out that then stood in J",
    )  # fmt: skip
    least_freedom: int = derived(
        8, "1", "fewest degrees of freedom of an inertia's scatter",
        source="the scatter of v degrees is known to 1/sqrt(2 v): a quarter (JCGM 100:2008, E.4.3)",
    )  # fmt: skip
    unexplained_share: float = calibrated(
        0.02, "1", "of the acceleration, squared, that may follow no logged torque",
        by=TRIED,
        on="loads of a third of rated torque, which left 0.38 to 0.6 in drives of three motors; "
        "none, on a real bench, 0.006. It is twice what a transducer of unstated gain leaves open",
    )  # fmt: skip
    loaded_share: float = derived(
        0.1, "1", "of the acceleration, squared, that may follow no logged torque where J is given "
        "without drags",
        source="where a controller works against a load, 1/J comes out too small by this share at "
        "most, which is in u; a tenth is five times what leaves drags alone",
    )  # fmt: skip
    sampling_u_s: float = chosen(
        0.5e-6, "s", "standard uncertainty of where in its pulse a drive's current is sampled",
        why="half of a dead time, and of what filters delay; dead times are 0.5 to 2 µs",
    )  # fmt: skip
    speed_share: float = chosen(
        0.02, "1",
        "relative standard uncertainty of J, T_c and B where a bench's own speed is the only "
        "record of the motion",
        why="what smooths or delays a speed does so to the acceleration, and does not say how much",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class DragOverTime:
    """How a drag that changes with time within captures is looked for."""

    scales: tuple[float, ...] = chosen(
        (0.03, 10.0), "1", "shortest and longest time constant, of the longest capture",
        why="what is over in one window of a coast is an event; what is slower is straight in it",
    )  # fmt: skip
    captures: int = derived(
        2, "1", "fewest captures that tell drag over time from drag over speed",
        source="in one coast every time has one speed",
    )  # fmt: skip
    trials: int = chosen(
        12, "1", "time constants, and times of a step, that are tried",
        why="neighbours are 1.7 apart, and refining goes on from there",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastDown:
    """How a coast-down is fitted."""

    most_samples: int = chosen(
        4000, "1", "block means that a coast is thinned to", why="the time of the fit goes with it"
    )
    most_smoothed: float = chosen(
        20.0, "rows", "rows that a coast's speed is smoothed over, at the most",
        why="enough for an encoder's rounding",
    )  # fmt: skip
    least_smoothed: float = chosen(
        4.0, "rows", "rows that it is smoothed over, at the least", why="fewer show rounding"
    )
    smoothed_part: float = chosen(
        12.0, "1", "of its rows, a part of which it is smoothed over",
        why="the smoothed ends of a coast are flat, and go with what was held",
    )  # fmt: skip
    unexplained: float = chosen(
        3.0, "1", "residual over the encoder's noise, above which drag's form is open",
        why="the halves of the coasts then say how far",
    )  # fmt: skip
    most_additions: int = chosen(
        3, "1", "terms that may join a coast-down at a time",
        why="one of drag and two of an eccentric encoder",
    )  # fmt: skip
    setup_share: float = chosen(
        0.2, unit="1", meaning="difference of two files' decelerations, of their mean, above which "
        "they are of two set-ups",
        why="by judgement: grease changes a coast by a tenth from cold to warm, a chain by more",
    )  # fmt: skip
    setup_u: float = chosen(
        3.0, unit="1", meaning="standard uncertainties by which the drag of coasts also has to "
        "miss that of drives",
        why="by judgement: the budgets of both are added, so that chance hardly passes it",
    )  # fmt: skip
    setup_top: float = chosen(
        0.95, unit="1", meaning="of the lower top speed of two coasts, from which on they are "
        "compared",
        why="by judgement: the smoothed speed of the first moments is of the driven shaft too",
    )  # fmt: skip
    setup_least: float = chosen(
        0.2, unit="1", meaning="of the speed that two coasts have to have in common",
        why="by judgement: the noise of a smoothed speed is a hundredth of that",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueMap:
    """What a torque map shows of drag."""

    untested_form_share: float = chosen(
        0.1, "1", "of the drag at the slowest speed that may have another form",
        why="Stribeck's, iron's or windage, where no speed is left over to test it",
    )  # fmt: skip
    unlogged_d_share: float = chosen(
        UNLOGGED_D_SHARE, "1",
        "relative standard uncertainty of Kt where the d current was not logged",
        why="a third of the current along d, where its field is a fifth of the magnet's and the "
        "axes' inductances differ by a third",
    )  # fmt: skip
    other_current_share: float = chosen(
        0.1, "1",
        "scatter of torque over that of the recorded current, from which on Kt is not known",
        why="conventions of Kt differ by no less: 1.10 at the least",
    )  # fmt: skip
    level: float = derived(
        0.01, "1", "chance of offsets to count as beyond their scatter",
        source="beyond the 99 % interval",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueSlope:
    """The slope of torque at small current."""

    level: float = derived(
        0.01, "1", "chance of a further odd power to join where torque is straight",
        source="beyond the 99 % interval",
    )  # fmt: skip
    highest_power: int = chosen(
        7, "1", "highest odd power of q current",
        why="four terms bend as iron does; eight levels would be needed for the next",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Ripple:
    """Back-EMF harmonics of a winding that is sold as sinusoidal."""

    usual_6: float = chosen(
        0.03, "1", "usual size of each of the harmonics 5 and 7 over the fundamental",
        why="such a winding keeps them to a few per cent",
    )  # fmt: skip
    usual_12: float = chosen(
        0.01, "1", "usual size of each of the harmonics 11 and 13", why="smaller by the order"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RippleTorque:
    """Torque of ripple currents."""

    apart_cycles: float = chosen(
        2.0, "1", "cycles over the rows by which an order is apart from the mean and from its "
        "mirror image",
        why="twice what makes them independent; the noise of the rows is then not enlarged",
    )  # fmt: skip
    window_cycles: float = chosen(
        3.0, "1", "cycles of the lowest order in a window of a drive",
        why="one more than they need, and short, as a drive's speed changes",
    )  # fmt: skip
    rows_at_once: int = chosen(
        100000, "1", "rows of windows that are solved together",
        why="ten complex columns of them take 16 MB",
    )  # fmt: skip
    half_share: float = derived(
        0.4, "1", "of the travel of a window, that either half of its time has to have",
        source="the power of a ripple goes with the square of speed: its mean is then off by 5 %",
    )  # fmt: skip
    alike: int = chosen(
        12, "1", "neighbours in speed, whose median the ripple of a drive is",
        why="half of them may hold a step of the current",
    )  # fmt: skip
    drop_share: float = derived(
        0.35, "1", "effective harmonics of a drop with the sign of each phase's current, in the "
        "rotor's frame",
        source="4/π times the root of the sum of 1/k², k = 5, 7, 11, 13",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Cogging:
    """Which orders of torque against angle are a motor's."""

    highest_order: int = chosen(
        1000, "1", "highest order a turn that is looked for",
        why="cogging of 36 slots and 42 poles is 252 a turn, and has three multiples in it",
    )  # fmt: skip
    level: float = derived(
        0.01, "1", "chance that any order is found in noise", source="beyond the 99 % interval"
    )
    stranger_level: float = chosen(
        1e-6, "1", "chance below which an order that no tooth makes counts",
        why="over a turn its crest meets the others somewhere: a false one adds its whole height",
    )  # fmt: skip
    friction_level: float = derived(
        0.01, "1", "chance of turns' means to scatter beyond the noise",
        source="beyond the 99 % interval",
    )  # fmt: skip
    sectors: int = derived(
        61, "1", "sectors of a turn, half of which are held out",
        source="a prime, of whose squares the pattern has a flat spectrum (Schroeder, Number "
        "Theory in Science and Communication, 15)",
    )  # fmt: skip
    replicates: int = chosen(
        200, "1", "draws of a bootstrap", why="its standard deviation is then known to a twentieth"
    )
