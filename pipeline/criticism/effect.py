"""What a physical effect is: one file in `effects/`, one `EFFECT`, found by the registry.

One object serves simulation, residual, fit and report. An effect enters the machine's equations
by the hooks it fills in; all of them are zero at zero parameters, so that any effect can be added
to any model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.criticism.operating import (
    Array,
    Complex,
    Flags,
    Operating,
    Recorded,
    Values,
    between,
    log1p,
)
from pipeline.criticism.parameter import Machine, Parameter, alone, choice

__all__ = [
    "Array",
    "Complex",
    "Effect",
    "Machine",
    "Operating",
    "Parameter",
    "Recorded",
    "Values",
    "alone",
    "between",
    "choice",
    "log1p",
]
"""What the file of an effect takes from here."""
RECORDERS = ("log", "open", "shaft", "step")
"""What a bench may record on clocks of their own: logs under load, open windings, a shaft alone
(coasts and slow turns), steps of a locked rotor."""


@dataclass(frozen=True, slots=True)
class FullLog:
    """All of one drive log, with what the fitted model gives for it at its samples.

    Attributes
    ----------
    x
        State, with its air-gap torque.
    drag_nm
        Torque of everything else in the model [n].
    shaft_nm
        True torque at the sensor of the shaft [n]; zero of a free shaft without a sensor.
    good
        Samples that were recorded well [n].
    u_theta_rad, u_shaft_nm, u_air_gap_nm
        Standard deviations of the noise of angle, shaft torque and air-gap torque.

    """

    x: Operating
    drag_nm: Array
    shaft_nm: Array
    good: Flags
    u_theta_rad: float
    u_shaft_nm: float
    u_air_gap_nm: float


@dataclass(frozen=True, slots=True)
class Discrimination:
    """Which of the effects that share a discriminator it is, and parameters with their standard
    uncertainties, in their own units; no name where full logs exclude one of the fitted size.
    """

    name: str | None
    values: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Shown:
    """What full logs show of an effect without a fit of it.

    Attributes
    ----------
    discrimination
        The effect, and parameters with their standard uncertainties.
    start
        Where a fit with it begins: further parameters of the effect, in their units.
    base
        The same of constants of the base.

    """

    discrimination: Discrimination
    start: Values
    base: Values


CoenergyHook = Callable[[Operating, Values], Any]
DropHook = Callable[[Operating, Values], Complex]
TorqueHook = Callable[[Operating, Values], Array]
AngleHook = Callable[[Operating, Values], Array]
CurrentHook = Callable[[Recorded, Values], Complex]
LoadHook = Callable[[Recorded, Values], Array]
VoltageHook = Callable[[Complex, Operating, Values, str], Complex]
ClockHook = Callable[[str, Values], float]
DiscriminatorHook = Callable[[Sequence[FullLog], Values], Discrimination | None]
ShownHook = Callable[[Sequence[FullLog]], Shown | None]


@dataclass(frozen=True, slots=True)
class LinearForm:
    """The equation of an effect in other parameters, in which it is linear wherever they are.

    Attributes
    ----------
    effect
        An effect with these parameters; its name is never reported.
    channel
        The signal in which it acts.
    values
        The effect's own parameters from the linear ones, the base constants and the machine, in
        their units; None where no machine has such.

    """

    effect: Effect
    channel: str
    values: Callable[[Values, Values, Machine], Values | None]


@dataclass(frozen=True, kw_only=True)
class Description:
    """The description of an effect for people.

    `words` is its formula in a line, `signature` what it looks like, `headline` what a person says
    of it, with sizes in braces, or several (`criticism.library.headline`); its name without one.
    `touches`: constants of a datasheet that mean something else where it acts, and what.
    `in_friction`: whether tests without voltages or d current count its drag as friction.
    `far_inertia`: its parameter that is the share of the inertia of a free shaft beyond a coupling;
    `far_by_torque`: whether only a drive that logs a torque shows that share.
    """

    words: str
    signature: str
    reference: str
    headline: str | tuple[str, ...] = ""
    touches: Mapping[str, str] = field(default_factory=dict)
    in_friction: bool = False
    far_inertia: str = ""
    far_by_torque: bool = False


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What shows an effect: `signals` are the capture columns without which it cannot be seen,
    `tests` those that excite it, the best first, and `experiment` the one to record.

    `exact`: its form is a law, of which nothing is left over for another effect to take up.
    `of_phases`: it goes with the electrical angle, which is not known without the pole pairs.
    `rotor_angles`: the fewest known angles of the rotor that show it, as two fit any wave.
    `alternatives`: other effects, each with the test or calibration that discriminates it from
    this. `rare`: benches seldom have it, so that of two that tie the other is named. `in_place_of`:
    a nuisance, zero in a model with the effect, and the parameter that is it at an unusual size.
    `friction`: with the other drags of the model it takes power from the shaft in either sense.
    """

    tests: tuple[str, ...]
    experiment: str
    signals: tuple[str, ...] = ()
    rare: bool = False
    exact: bool = False
    of_phases: bool = False
    rotor_angles: int = 0
    in_place_of: tuple[str, str] | None = None
    friction: bool = False
    alternatives: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Hooks:
    """Where an effect enters the equations. Every hook gets the parameters by name, in their units.

    coenergy(x, q): co-energy over 1.5 [Wb·A] as an analytic function of `x.id_a`, `x.iq_a`,
        `x.eps_rad`, which arrive complex: flux is its gradient by the currents, torque gains
        1.5 p times its gradient by the electrical angle (no abs, no branches on those three).
    drop(x, q): complex voltage drop in the rotor frame [V], added to R i.
    torque(x, q): torque that opposes positive rotation [N·m].
    parallel(x, q): complex current [A] that flows beside the one that magnetises.
    angle(x, q): recorded less true electrical angle [rad].
    current(r, q): true complex current from the recorded one [A].
    load(r, q): true shaft torque from the recorded one [N·m].
    speed(ω, q, T): a drive's own recorded speed from the true one [rad/s], T the sample period.
    voltage(v, x, q, instrument): recorded voltage from the true one [V].
    shaft(t, q): recorded shaft torque from the true one [N·m].
    clock(recorder, q): recorded time over true time, less one [1], of a `RECORDERS` name.

    coupling: the torque is of a far mass, and by the drags of all other effects, `x.drag_nm`.

    linear: its linear form, from which it is fitted where no tangent leads to it.

    discriminator(logs, q): which of the effects that share this very function it is;
        None where full logs do not say. For effects whose equations differ in what windows smooth.

    shown(logs): what full logs show of the effects that share a discriminator, whatever the
        model without them has of the shaft; None where they show none.
    """

    coenergy: CoenergyHook | None = None
    drop: DropHook | None = None
    torque: TorqueHook | None = None
    parallel: DropHook | None = None
    angle: AngleHook | None = None
    current: CurrentHook | None = None
    load: LoadHook | None = None
    voltage: VoltageHook | None = None
    shaft: Callable[[Array, Values], Array] | None = None
    speed: Callable[[Array, Values, float], Array] | None = None
    clock: ClockHook | None = None
    coupling: bool = False
    linear: LinearForm | None = None
    discriminator: DiscriminatorHook | None = None
    shown: ShownHook | None = None

    @property
    def hook(self) -> str:
        """Where it enters: flux, drop, torque or sensor; the drop of one that has a flux too."""
        if self.drop is not None:
            return "drop"
        if self.coenergy is not None:
            return "flux"
        return "torque" if self.torque is not None else "sensor"


@dataclass(frozen=True, kw_only=True)
class Effect(Description, Evidence, Hooks):
    """One effect: what it is called, where it acts, what shows it and its description.

    `parameters`, or `expand(machine)` where their number depends on the machine. `left_out`: the
    numbers of the optional terms that this copy of the effect does without.
    """

    name: str
    parameters: tuple[Parameter, ...] = ()
    expand: Callable[[Machine], tuple[Parameter, ...]] | None = None
    left_out: tuple[int, ...] = ()

    def parameters_of(self, machine: Machine) -> tuple[Parameter, ...]:
        """The parameters for one machine, without those of optional terms that are left out.

        Parameters
        ----------
        machine
            Determines how many there are, where the effect has `expand`.

        """
        return tuple(p for p in self.every(machine) if p.optional not in self.left_out)

    def every(self, machine: Machine) -> tuple[Parameter, ...]:
        """The parameters for one machine, with those of optional terms that are left out.

        Parameters
        ----------
        machine
            Determines how many there are, where the effect has `expand`.

        """
        return self.expand(machine) if self.expand is not None else self.parameters

    def named(self, machine: Machine) -> dict[str, Parameter]:
        """The parameters for one machine by full name, `effect.parameter`.

        Parameters
        ----------
        machine
            Determines how many there are, where the effect has `expand`.

        """
        return {f"{self.name}.{p.name}": p for p in self.parameters_of(machine)}

    def gone_through(self, machine: Machine) -> bool:
        """Whether the captures go through enough of a wave of the effect over the angle.

        Parameters
        ----------
        machine
            Holds how far the shaft turns, and at how many angles the winding was recorded.

        Returns
        -------
        bool
            True for an effect without such waves.

        """
        if machine.rotor_angles < self.rotor_angles:
            return False
        orders = [p.order for p in self.parameters_of(machine) if p.order]
        return not orders or max(orders) * machine.travel_turns >= machine.policy.cutting.least_wave

    def dof(self, machine: Machine) -> int:
        """How many parameters are fitted.

        Parameters
        ----------
        machine
            Determines how many there are.

        """
        return sum(not p.choice for p in self.parameters_of(machine))
