"""Numbers of judgement about evidence, agreement, temperatures and instruments."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_U_K


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """How much evidence a constant, an error or an effect needs.

    Attributes
    ----------
    sigmas : 1
        standard deviations at which something is there
        derived: by chance once in 16,000 of a normal deviate, either sign
    rows : 1
        fewest samples or windows whose scatter counts as known
        derived: the scatter of 20 is known to a sixth (JCGM 100:2008, E.4.3)
    clusters : 1
        fewest clusters whose scores make a covariance
        derived: errors by clusters are too small where these are few (Cameron and Miller, J. Human
        Resources 50(2), 2015, VI): at three, 0.4 to 0.7 of the scatter of J over 60 drives of two
        motors; at 12 to 24 it is 0.4 to 0.8, of a tenth of what the gains make of J
    memory_rows : 1
        longest correlation of residuals that is looked for, in windows
        chosen: two seconds of windows: longer than what converter, load and speed loop remember
    cluster_s : s
        length of a cluster of windows that may be correlated
        chosen: rows of a drive forget within seven windows, 0.07 s: over three times that

    """

    sigmas: float = 4.0
    rows: int = 20
    clusters: int = 10
    memory_rows: int = 200
    cluster_s: float = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """When methods of one constant disagree.

    Attributes
    ----------
    level : 1
        chance of methods to count as disagreeing where they do not
        derived: beyond the 99 % interval: of a hundred sound comparisons one is widened
    precise : 1
        u of a method over another's, times the root of their number, beyond which it says nothing
        of that one
        derived: Particle Data Group, Review of Particle Physics, 2024, 5.2.2 (scale factors)
    contradiction : 1
        chance at which a rougher method than that excludes a value
        chosen: four standard uncertainties; of ten pairs of methods a motor has, one motor in a
        thousand is widened though it is sound
    outranked : 1
        ratio of uncertainties beyond which the better known of two methods comes first
        chosen: beyond it the assumptions that the order of methods goes by are the lesser doubt
    speed_ratio : 1
        ratio of speeds beyond which two drags are two quantities
        chosen: drag at creep speed and at full speed differ where friction bends

    """

    level: float = 0.01
    precise: float = 3.0
    contradiction: float = 1e-4
    outranked: float = 10.0
    speed_ratio: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Regimes:
    """When parts of the rows of one regression disagree.

    Attributes
    ----------
    least_share : 1
        least share of the information on a constant that a regime holds
        chosen: below it errors that are small beside the rest are large beside the regime's few
        rows

    """

    least_share: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureSpread:
    """Relative standard uncertainties that no budget of a single capture holds.

    From one capture to the next the method's own assumptions change: magnets lose 0.11 % of their
    flux a kelvin (NdFeB) and copper gains 0.39 %. An unknown temperature counts as twenty
    kelvin, as ten where no test warms the motor, a known one as five where the sensor sits
    elsewhere.

    Attributes
    ----------
    flux_temperature_known : 1
        of flux, magnet temperature logged
        derived: 5 K of 0.11 % a kelvin
    flux_temperature_unknown : 1
        of flux, temperature unknown: after a load an open winding is warm as well
        derived: 20 K of 0.11 % a kelvin
    flux_temperature_unpowered : 1
        of flux, temperature unknown, where no test warms the motor
        derived: 10 K of 0.11 % a kelvin
    torque : 1
        of a torque constant between maps of other currents
        chosen: iron saturates by per cents
    resistance_temperature_known : 1
        of resistance, winding temperature logged
        derived: 5 K of 0.39 % a kelvin
    resistance_temperature_unknown : 1
        of resistance, winding temperature unknown
        chosen: 13 K of 0.39 % a kelvin, between what is taken with and without current
    inductance : 1
        of inductance between steps of like heights
        chosen: it falls by some per cent with the current, of which only like ones are compared
    log : 1
        of anything from an everyday log
        chosen: nobody controls what happens in one
    inverter : 1
        of the DC link's voltage, lost between command and terminals
        derived: a microsecond of dead time at 20 kHz
    count : 1
        of a count of pole pairs
        chosen: a count is whole: anything below a half serves

    """

    flux_temperature_known: float = 0.005
    flux_temperature_unknown: float = 0.02
    flux_temperature_unpowered: float = 0.01
    torque: float = 0.01
    resistance_temperature_known: float = 0.02
    resistance_temperature_unknown: float = 0.05
    inductance: float = 0.03
    log: float = 0.03
    inverter: float = 0.02
    count: float = 0.002


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatRecord:
    """How a heat run is cut into blocks.

    Attributes
    ----------
    blocks : 1
        blocks that a heat run is averaged to
        chosen: enough for the shape of an exponential; more only cost time
    steady_share : 1
        of the largest current, within which it counts as steady
        chosen: one step of a coarse converter is no change
    flowing_share : 1
        of the largest current, above which a stretch heats
        chosen: a fifth of the current is a twenty-fifth of the heat
    unexplained : 1
        residual over the thermometer's noise, above which one time constant is not all
        chosen: chance does not do that; one exponential then reads R up to a quarter low
    motional_share : 1
        of the electrical power, below which a rotor's own is left out
        chosen: a hundredth of a per cent of R is below what any gain leaves

    """

    blocks: int = 300
    steady_share: float = 0.02
    flowing_share: float = 0.2
    unexplained: float = 3.0
    motional_share: float = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnet:
    """What is assumed of magnets whose coefficient was not measured.

    Attributes
    ----------
    coefficient_1_k : 1/K
        temperature coefficient of the flux at 25 degC
        derived: sintered NdFeB loses 0.09 to 0.12 % a kelvin
    u_coefficient_1_k : 1/K
        standard uncertainty of that coefficient
        derived: SmCo loses less than half of what NdFeB does, ferrite 0.2 %
    unlogged_k : K
        standard uncertainty of a temperature that was not logged
        chosen: most motors on a bench lie within twice that of their surroundings
    elsewhere_k : K
        standard uncertainty of the magnets' temperature by winding or case, without current
        chosen: what is in one housing comes within twice that in some minutes

    """

    coefficient_1_k: float = -0.0011
    u_coefficient_1_k: float = 4e-4
    unlogged_k: float = UNLOGGED_U_K
    elsewhere_k: float = 5.0
