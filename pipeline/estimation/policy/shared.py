"""Numbers of judgement about evidence, agreement, temperatures and instruments."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_U_K
from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """How much evidence a constant, an error or an effect needs."""

    sigmas: float = derived(
        4.0, "1", "standard deviations at which something is there",
        source="by chance once in 16,000 of a normal deviate, either sign",
    )  # fmt: skip
    rows: int = derived(
        20, "1", "fewest samples or windows whose scatter counts as known",
        source="the scatter of 20 is known to a sixth (JCGM 100:2008, E.4.3)",
    )  # fmt: skip
    clusters: int = derived(
        10, "1", "fewest clusters whose scores make a covariance",
        source="errors by clusters are too small where these are few (Cameron and Miller, J. "
        "Human Resources 50(2), 2015, VI): at three, 0.4 to 0.7 of the scatter of J over 60 "
        "drives of two motors; at 12 to 24 it is 0.4 to 0.8, of a tenth of what the gains make of "
        "J",
    )  # fmt: skip
    memory_rows: int = chosen(
        200, "1", "longest correlation of residuals that is looked for, in windows",
        why="two seconds of windows: longer than what converter, load and speed loop remember",
    )  # fmt: skip
    cluster_s: float = chosen(
        0.25, "s", "length of a cluster of windows that may be correlated",
        why="rows of a drive forget within seven windows, 0.07 s: over three times that",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """When methods of one constant disagree."""

    level: float = derived(
        0.01, "1", "chance of methods to count as disagreeing where they do not",
        source="beyond the 99 % interval: of a hundred sound comparisons one is widened",
    )  # fmt: skip
    precise: float = derived(
        3.0, "1",
        "u of a method over another's, times the root of their number, beyond which it says "
        "nothing of that one",
        source="Particle Data Group, Review of Particle Physics, 2024, 5.2.2 (scale factors)",
    )  # fmt: skip
    contradiction: float = chosen(
        1e-4, "1", "chance at which a rougher method than that excludes a value",
        why="four standard uncertainties; of ten pairs of methods a motor has, one motor in a "
        "thousand is widened though it is sound",
    )  # fmt: skip
    speed_ratio: float = chosen(
        10.0, "1", "ratio of speeds beyond which two drags are two quantities",
        why="drag at creep speed and at full speed differ where friction bends",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Regimes:
    """When parts of the rows of one regression disagree."""

    least_share: float = chosen(
        0.1, "1", "least share of the information on a constant that a regime holds",
        why="below it errors that are small beside the rest are large beside the regime's few rows",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureSpread:
    """Relative standard uncertainties that no budget of a single capture holds.

    From one capture to the next the method's own assumptions change: magnets lose 0.11 % of their
    flux a kelvin (NdFeB) and copper gains 0.39 %. An unknown temperature counts as twenty
    kelvin, as ten where no test warms the motor, a known one as five where the sensor sits
    elsewhere.
    """

    flux_temperature_known: float = derived(
        0.005, "1", "of flux, magnet temperature logged", source="5 K of 0.11 % a kelvin"
    )
    flux_temperature_unknown: float = derived(
        0.02, "1", "of flux, temperature unknown: after a load an open winding is warm as well",
        source="20 K of 0.11 % a kelvin",
    )  # fmt: skip
    flux_temperature_unpowered: float = derived(
        0.01, "1", "of flux, temperature unknown, where no test warms the motor",
        source="10 K of 0.11 % a kelvin",
    )  # fmt: skip
    torque: float = chosen(
        0.01, "1", "of a torque constant between maps of other currents",
        why="iron saturates by per cents",
    )  # fmt: skip
    resistance_temperature_known: float = derived(
        0.02, "1", "of resistance, winding temperature logged", source="5 K of 0.39 % a kelvin"
    )
    resistance_temperature_unknown: float = chosen(
        0.05, "1", "of resistance, winding temperature unknown",
        why="13 K of 0.39 % a kelvin, between what is taken with and without current",
    )  # fmt: skip
    inductance: float = chosen(
        0.03, "1", "of inductance between steps of like heights",
        why="it falls by some per cent with the current, of which only like ones are compared",
    )  # fmt: skip
    log: float = chosen(
        0.03, "1", "of anything from an everyday log", why="nobody controls what happens in one"
    )
    inverter: float = derived(
        0.02, "1", "of the DC link's voltage, lost between command and terminals",
        source="a microsecond of dead time at 20 kHz",
    )  # fmt: skip
    count: float = chosen(
        0.002, "1", "of a count of pole pairs", why="a count is whole: anything below a half serves"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatRecord:
    """How a heat run is cut into blocks."""

    blocks: int = chosen(
        300, "1", "blocks that a heat run is averaged to",
        why="enough for the shape of an exponential; more only cost time",
    )  # fmt: skip
    steady_share: float = chosen(
        0.02, "1", "of the largest current, within which it counts as steady",
        why="one step of a coarse converter is no change",
    )  # fmt: skip
    flowing_share: float = chosen(
        0.2, "1", "of the largest current, above which a stretch heats",
        why="a fifth of the current is a twenty-fifth of the heat",
    )  # fmt: skip
    unexplained: float = chosen(
        3.0, "1", "residual over the thermometer's noise, above which one time constant is not all",
        why="chance does not do that; one exponential then reads R up to a quarter low",
    )  # fmt: skip
    motional_share: float = chosen(
        1e-4, "1", "of the electrical power, below which a rotor's own is left out",
        why="a hundredth of a per cent of R is below what any gain leaves",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnet:
    """What is assumed of magnets whose coefficient was not measured."""

    coefficient_1_k: float = derived(
        -0.0011, "1/K", "temperature coefficient of the flux at 25 degC",
        source="sintered NdFeB loses 0.09 to 0.12 % a kelvin",
    )  # fmt: skip
    u_coefficient_1_k: float = derived(
        4e-4, "1/K", "standard uncertainty of that coefficient",
        source="SmCo loses less than half of what NdFeB does, ferrite 0.2 %",
    )  # fmt: skip
    unlogged_k: float = chosen(
        UNLOGGED_U_K, "K", "standard uncertainty of a temperature that was not logged",
        why="most motors on a bench lie within twice that of their surroundings",
    )  # fmt: skip
    elsewhere_k: float = chosen(
        5.0, "K",
        "standard uncertainty of the magnets' temperature by winding or case, without current",
        why="what is in one housing comes within twice that in some minutes",
    )  # fmt: skip
