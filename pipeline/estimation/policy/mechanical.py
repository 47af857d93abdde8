"""Numbers of judgement about torque, inertia and drag."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_D_SHARE


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaftRows:
    """Windows of the equation of motion.

    Attributes
    ----------
    drive_windows_s : s
        windows of a drive, of which the shortest that is quiet is taken
        chosen: as torque changes in them
    quiet_share : 1
        of the acceleration, below which a window's noise is quiet
        derived: a fiftieth adds 0.02 % to its scatter
    jump_sigmas : standard deviations of noise
        step of a current from which on it jumps
        derived: steps of white noise have 1.4, and come to five times that; their median as well
    jump_share : 1
        of the highest speed, by which a speed that jumps changes from row to row
        chosen: of one pump's log at 20 Hz, J was 42 % too small at 0.1 and is withheld at 0.03
    jump_rows : rows
        rows beside a jump of the speed whose windows are left out with it
        chosen: as of a diagnosis: a loop settles there, in rows too few to follow it
    coast_share : 1
        of a coast-down, that a window takes
        calibrated: `the number halved and doubled` on coasts only slow down: half or twice of it
        moved T_c and B by a ninth of their u
    longest_coast_window_s : s
        longest window of a coast-down
        calibrated: `the number halved and doubled` on coasts, where half or twice of it moved
        nothing
    attenuated_share : 1
        of a constant, that noise of the columns may take before it counts as unknown
        chosen: beyond it the correction to first order is no measure of itself
    slowest_share : 1
        of the highest speed, below which the shaft may stand
        calibrated: `the number halved and doubled` on drives and coasts: twice of it moved T_c and
        B by an eighth of their u, where there is a Stribeck's excess to lose, half of it nothing
    resolved_periods : samples
        shortest time constant that can be separated from a delay
        calibrated: `the number halved and doubled` on simulated logs of voltage and angle: at one
        sample and less kA came out up to ten times too large, at two and more its intervals held
    longest_delay_s : s
        longest delay of the motion behind a logged voltage
        chosen: filters and buses of robots delay by up to some tenths of a second
    overlap : 1
        share of its samples that a window has in common with the next
        derived: as in Welch's spectra: no sample counts less than another, more only repeats

    """

    drive_windows_s: tuple[float, ...] = (0.02, 0.04, 0.08)
    quiet_share: float = 0.02
    jump_sigmas: float = 10.0
    jump_share: float = 0.03
    jump_rows: int = 3
    coast_share: float = 0.05
    longest_coast_window_s: float = 0.5
    attenuated_share: float = 0.05
    slowest_share: float = 0.01
    resolved_periods: float = 2.0
    longest_delay_s: float = 0.3
    overlap: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Drag:
    """When drag has another form than Coulomb and viscous, and how much data it takes.

    Attributes
    ----------
    most_nuisances : 1
        nuisances that may join the equation of motion
        calibrated: `the number halved and doubled` on ten simulated campaigns: half or twice of it
        moved no constant by a twentieth of its u
    noise_alone : 1
        χ²/n of a torque by the current's noise, at the most, where all noise is in it
        chosen: there another error is as large as the noise; of one sound joint at 50 Hz it is 1.8
    least_own_share : 1
        part of a nuisance of the current that the torque does not hold, to count
        chosen: what parts it is also what any other error follows: with 0.02 and 0.05 of two drives
        between two currents J was half of what it is, with 0.4 and more of others right
    material_share : 1
        of the drag, that two numbers may leave and stand for it still
        derived: a square root of speed beside them would then have moved T_c by 20 %, B by 56 %, a
        cube by 6 and 25 %: they are the law's constants; half or twice chose no other form
    enough_coasting_rows : 1
        windows of coasts that decide on the form of drag
        derived: six that share no sample, thrice what the two constants need; one coast makes 39
    rows_a_column : 1
        windows that share no sample which a nuisance takes
        calibrated: `the number halved and doubled` on drives of 0.3 to 0.8 s of two motors, 60
        each: 3 to 10 gave J alike within a fifth of u, at 15 a nuisance was left out that then
        stood in J
    least_freedom : 1
        fewest degrees of freedom of an inertia's scatter
        derived: the scatter of v degrees is known to 1/sqrt(2 v): a quarter (JCGM 100:2008, E.4.3)
    most_reluctance : 1
        torque of reluctance over the magnet's where the d current is the largest, at the most,
        where nothing shows it
        chosen: (L_q − L_d) i/ψ of a reluctance motor with weak magnets
    unexplained_share : 1
        of the acceleration, squared, that may follow no logged torque
        calibrated: `the number halved and doubled` on loads of a third of rated torque, which left
        0.38 to 0.6 in drives of three motors; none, on a real bench, 0.006. It is twice what a
        transducer of unstated gain leaves open
    loaded_share : 1
        of the acceleration, squared, that may follow no logged torque where J is given without
        drags
        derived: where a controller works against a load, 1/J comes out too small by this share at
        most, which is in u; a tenth is five times what leaves drags alone
    sampling_u_s : s
        standard uncertainty of where in its pulse a drive's current is sampled
        chosen: half of a dead time, and of what filters delay; dead times are 0.5 to 2 µs
    speed_share : 1
        relative standard uncertainty of J, T_c and B where a bench's own speed is the only record
        of the motion
        chosen: what smooths or delays a speed does so to the acceleration, and does not say how
        much

    """

    most_nuisances: int = 14
    noise_alone: float = 2.0
    least_own_share: float = 0.15
    material_share: float = 0.02
    enough_coasting_rows: int = 12
    rows_a_column: int = 10
    least_freedom: int = 8
    most_reluctance: float = 3.0
    unexplained_share: float = 0.02
    loaded_share: float = 0.1
    sampling_u_s: float = 0.5e-6
    speed_share: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class DragOverTime:
    """How a drag that changes with time within captures is looked for.

    Attributes
    ----------
    scales : 1
        shortest and longest time constant, of the longest capture
        chosen: what is over in one window of a coast is an event; what is slower is straight in it
    captures : 1
        fewest captures that tell drag over time from drag over speed
        derived: in one coast every time has one speed
    trials : 1
        time constants, and times of a step, that are tried
        chosen: neighbours are 1.7 apart, and refining goes on from there

    """

    scales: tuple[float, ...] = (0.03, 10.0)
    captures: int = 2
    trials: int = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastDown:
    """How a coast-down is fitted.

    Attributes
    ----------
    most_samples : 1
        block means that a coast is thinned to
        chosen: the time of the fit goes with it
    most_smoothed : rows
        rows that a coast's speed is smoothed over, at the most
        chosen: enough for an encoder's rounding
    least_smoothed : rows
        rows that it is smoothed over, at the least
        chosen: fewer show rounding
    smoothed_part : 1
        of its rows, a part of which it is smoothed over
        chosen: the smoothed ends of a coast are flat, and go with what was held
    unexplained : 1
        residual over the encoder's noise, above which drag's form is open
        chosen: the halves of the coasts then say how far
    most_additions : 1
        terms that may join a coast-down at a time
        chosen: one of drag and two of an eccentric encoder
    setup_share : 1
        difference of two files' decelerations, of their mean, above which they are of two set-ups
        chosen: by judgement: grease changes a coast by a tenth from cold to warm, a chain by more
    setup_u : 1
        standard uncertainties by which the drag of coasts also has to miss that of drives
        chosen: by judgement: the budgets of both are added, so that chance hardly passes it
    setup_top : 1
        of the lower top speed of two coasts, from which on they are compared
        chosen: by judgement: the smoothed speed of the first moments is of the driven shaft too
    setup_least : 1
        of the speed that two coasts have to have in common
        chosen: by judgement: the noise of a smoothed speed is a hundredth of that

    """

    most_samples: int = 4000
    most_smoothed: float = 20.0
    least_smoothed: float = 4.0
    smoothed_part: float = 12.0
    unexplained: float = 3.0
    most_additions: int = 3
    setup_share: float = 0.2
    setup_u: float = 3.0
    setup_top: float = 0.95
    setup_least: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueMap:
    """What a torque map shows of drag.

    Attributes
    ----------
    untested_form_share : 1
        of the drag at the slowest speed that may have another form
        chosen: Stribeck's, iron's or windage, where no speed is left over to test it
    unlogged_d_share : 1
        relative standard uncertainty of Kt where the d current was not logged
        chosen: a third of the current along d, where its field is a fifth of the magnet's and the
        axes' inductances differ by a third
    other_current_share : 1
        scatter of torque over that of the recorded current, from which on Kt is not known
        chosen: conventions of Kt differ by no less: 1.10 at the least
    level : 1
        chance of offsets to count as beyond their scatter
        derived: beyond the 99 % interval

    """

    untested_form_share: float = 0.1
    unlogged_d_share: float = UNLOGGED_D_SHARE
    other_current_share: float = 0.1
    level: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueSlope:
    """The slope of torque at small current.

    Attributes
    ----------
    level : 1
        chance of a further odd power to join where torque is straight
        derived: beyond the 99 % interval
    highest_power : 1
        highest odd power of q current
        chosen: four terms bend as iron does; eight levels would be needed for the next

    """

    level: float = 0.01
    highest_power: int = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Ripple:
    """Back-EMF harmonics of a winding that is sold as sinusoidal.

    Attributes
    ----------
    usual_6 : 1
        usual size of each of the harmonics 5 and 7 over the fundamental
        chosen: such a winding keeps them to a few per cent
    usual_12 : 1
        usual size of each of the harmonics 11 and 13
        chosen: smaller by the order

    """

    usual_6: float = 0.03
    usual_12: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class RippleTorque:
    """Torque of ripple currents.

    Attributes
    ----------
    apart_cycles : 1
        cycles over the rows by which an order is apart from the mean and from its mirror image
        chosen: twice what makes them independent; the noise of the rows is then not enlarged
    window_cycles : 1
        cycles of the lowest order in a window of a drive
        chosen: one more than they need, and short, as a drive's speed changes
    rows_at_once : 1
        rows of windows that are solved together
        chosen: ten complex columns of them take 16 MB
    half_share : 1
        of the travel of a window, that either half of its time has to have
        derived: the power of a ripple goes with the square of speed: its mean is then off by 5 %
    alike : 1
        neighbours in speed, whose median the ripple of a drive is
        chosen: half of them may hold a step of the current
    drop_share : 1
        effective harmonics of a drop with the sign of each phase's current, in the rotor's frame
        derived: 4/π times the root of the sum of 1/k², k = 5, 7, 11, 13

    """

    apart_cycles: float = 2.0
    window_cycles: float = 3.0
    rows_at_once: int = 100000
    half_share: float = 0.4
    alike: int = 12
    drop_share: float = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class Cogging:
    """Which orders of torque against angle are a motor's.

    Attributes
    ----------
    highest_order : 1
        highest order a turn that is looked for
        chosen: cogging of 36 slots and 42 poles is 252 a turn, and has three multiples in it
    level : 1
        chance that any order is found in noise
        derived: beyond the 99 % interval
    stranger_level : 1
        chance below which an order that no tooth makes counts
        chosen: over a turn its crest meets the others somewhere: a false one adds its whole height
    friction_level : 1
        chance of turns' means to scatter beyond the noise
        derived: beyond the 99 % interval
    viscous_at_top : 1
        viscous drag at the highest speed over dry friction, at the most
        chosen: of rolling bearings with grease the two are alike; a part of twice as much is rare
    sectors : 1
        sectors of a turn, half of which are held out
        derived: a prime, of whose squares the pattern has a flat spectrum (Schroeder, Number Theory
        in Science and Communication, 15)
    replicates : 1
        draws of a bootstrap
        chosen: its standard deviation is then known to a twentieth

    """

    highest_order: int = 1000
    level: float = 0.01
    stranger_level: float = 1e-6
    friction_level: float = 0.01
    viscous_at_top: float = 2.0
    sectors: int = 61
    replicates: int = 200
