"""What a physical effect is: one file in `effects/`, one `EFFECT`, found by the registry.

One object serves simulation, residual, fit and report. An effect enters the machine's equations
by the hooks it fills in; all of them are zero at zero parameters, so that any effect can be added
to any model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.policy.policy import DEFAULT, Policy

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SCALES = ("current_a", "voltage_v", "speed_rad_s", "freq_hz", "torque_nm", "period_s", "flux_wb")
"""What `Machine.scales` holds, and a parameter's `scale` may name."""
RECORDERS = ("log", "open", "shaft", "step")
"""What a bench may record on clocks of their own: logs under load, open windings, a shaft alone
(coasts and slow turns), steps of a locked rotor."""

_NEIGHBOURS = 2


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect. Sizes are in multiples of the machine's own `scale`.

    `scale` names an entry of `Machine.scales` (`torque_nm`, `voltage_v`, ...) or is `1`.
    `typical` is a size seen on real benches, `negligible` one that nobody would act on; both are
    magnitudes; with a shape below its negligible one the effect is not there. `scan`: trial values
    of a shape parameter, which has no influence while the amplitudes of its effect are zero; empty
    for an amplitude. A `choice` takes one of these values and is never fitted. `optional`: the
    parameters of one number above 0 form a term that the effect can do without; without it they
    are zero. `u`: standard uncertainty, in its own unit, of a value that a discriminator gives.
    `usual`: what handbooks say of the material, and its standard uncertainty, in its own unit: a
    prior of every fit. `at_least`: another amplitude of the effect; if this one stays below half of
    it, captures speak against the effect. `starts`: values, in multiples of `scale`, at which an
    amplitude is tried too, since the residual bends too far from zero for its tangent. `order`:
    the waves a turn that an amplitude is of.
    """

    name: str
    unit: str
    typical: float
    negligible: float
    scale: str = "1"
    low: float = -math.inf
    high: float = math.inf
    words: str = ""
    scan: tuple[float, ...] = ()
    choice: bool = False
    optional: int = 0
    u: float = 0.0
    at_least: str = ""
    usual: tuple[float, float] | None = None
    starts: tuple[float, ...] = ()
    order: float = 0.0

    @property
    def amplitude(self) -> bool:
        """Whether the effect vanishes with this parameter."""
        return not self.scan


@dataclass(frozen=True, slots=True)
class Machine:
    """What the captures say of the motor's size, before any fit.

    `scales` [unit of the name's suffix]: the largest current, speed, torque and voltage seen,
    the sample period, and what follows from them. `torque_orders` are the orders per turn that
    stand out of a slow turn, `load_orders` others that a fit left in logs under load, whole
    numbers or not, `slots` the nameplate's. `stated_u` is the standard uncertainty of the
    station's gains and thermometers, by the name of the nuisance that stands for each;
    `encoder_rad` the step of the encoder that the drive's logs show, 0 where they show none;
    `travel_turns` how far the shaft goes in any one capture: a wave of the angle shows where it is
    gone through once at least. `stated`: what somebody states of the motor's constants, value and
    standard uncertainty by the name of the parameter, in its unit. `policy`: the constants of
    judgement by which its captures are cut, and models of it fitted and judged.
    """

    pole_pairs: int
    slots: int | None
    scales: Mapping[str, float]
    torque_orders: tuple[int, ...] = ()
    stated_u: Mapping[str, float] = field(default_factory=dict)
    encoder_rad: float = 0.0
    load_orders: tuple[float, ...] = ()
    travel_turns: float = math.inf
    stated: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    policy: Policy = DEFAULT

    @property
    def cogging_order(self) -> int | None:
        """LCM(slots, 2p) [1/turn], the order that all slots and poles make together; None where the
        slots are not known, or so many fractional ones that nothing is left of it: what stands out
        of a slow turn counts all the same.

        Reference: Zhu & Howe, IEEE Trans. Energy Convers. 15 (2000): its torque falls with it.
        """
        order = math.lcm(self.slots, 2 * self.pole_pairs) if self.slots else 0
        return order if 0 < order <= self.policy.cutting.highest_order else None

    def scale(self, parameter: Parameter) -> float:
        """Size [parameter.unit] of one relative unit of a parameter."""
        return 1.0 if parameter.scale == "1" else self.scales[parameter.scale]


@dataclass(frozen=True, slots=True)
class Supply:
    """How a drive feeds the machine, where that is known.

    `pwm_s`, `vdc_v`: period of the inverter's switching and voltage of its link, 0 where not known.
    `hold_s`: time for which a voltage vector stands while the rotor turns, 0 where not known.
    `volts_v`: the voltage that the drive's log records, in the true rotor frame, where it has both
    axes; a leg near zero current is judged by it. `q_alone`: the log shows the
    q axis only, so that of a voltage's delay its envelope is what shows.
    """

    pwm_s: float = 0.0
    vdc_v: float = 0.0
    volts_v: Complex | None = None
    q_alone: bool = False
    hold_s: float = 0.0


@dataclass(frozen=True, slots=True)
class ShaftState:
    """How the shaft is held and what records it.

    `held`: a dynamometer holds the far end of the shaft; else the recorded torque is the far end's
    load. `alone`: nothing records the torque that the shaft passes on, so that its load is a drag.
    `finer`: points a sample of the angle. `run` [n] is the number of reversals before a sample and
    `runs_rad` [runs] the angle turned from each to the next, negative backwards.
    """

    held: bool = False
    alone: bool = False
    finer: int = 1
    run: NDArray[np.int64] | None = None
    runs_rad: Array | None = None


@dataclass(slots=True, kw_only=True)
class Samples:
    """What has one number a sample [n]: the machine's true state.

    Currents are true machine currents in the true rotor frame (amplitude-invariant), angles and
    speed are true shaft quantities. `travel_rad` is the angle turned since the last reversal,
    infinite before the first.
    """

    id_a: Any
    iq_a: Any
    eps_rad: Any
    theta_rad: Array
    omega_rad_s: Array
    winding_k: Array
    magnet_k: Array
    travel_rad: Array
    freq_hz: Array


@dataclass(slots=True, kw_only=True)
class Operating(Samples):
    """Where the machine is at each sample; what hooks are evaluated on.

    `base` holds r_ohm, ld_h, lq_h, psi_wb of the fit, `ts_s` is the sample period. `inverter`: the
    machine is fed and logged by a drive, so that inverter and drive-sensor effects apply; `supply`
    says how. `psi_wb` [n] (complex, d + jq) and `torque_em_nm` [n] are there for drop and torque
    hooks. `kept` is what `once` made.
    """

    machine: Machine
    base: Mapping[str, float]
    ts_s: float
    inverter: bool
    supply: Supply = Supply()
    shaft: ShaftState = ShaftState()
    psi_wb: Complex | None = None
    torque_em_nm: Array | None = None
    kept: dict[tuple[int, Hashable], tuple[Any, Any]] = field(default_factory=dict)

    def fed(self, **supply: Any) -> Operating:
        """The same machine, fed and logged by a drive of which that much more is known."""
        return replace(self, inverter=True, supply=replace(self.supply, **supply))

    def once(self, column: Any, name: Hashable, make: Callable[[], Any]) -> Any:
        """What depends on a column alone, made once for all copies that share the array."""
        known = self.kept.get((id(column), name))
        if known is None:
            # the column is kept with it, so that nothing else takes its identity
            known = self.kept[id(column), name] = column, make()
        return known[1]

    def waves(self, order: int) -> tuple[Any, Any]:
        """Cosine and sine of `order` times the electrical angle [n], computed once an angle."""
        waves: tuple[Any, Any] = self.once(self.eps_rad, order, lambda: _waves(order, self.eps_rad))
        return waves

    def shaft_waves(self, order: int) -> tuple[Array, Array]:
        """Cosine and sine of `order` times the shaft angle [n], as a sample's torque has them.

        A free shaft's torque is given by the second difference of its angle, which is a mean under
        a triangle of two samples: sinc² of the half turn of the wave in one. Of a coasting shaft
        that mean is taken over `finer` points a sample, and each has the mean of its own part: a
        wave that turns many times from point to point would beat with them.
        """
        name = ("shaft", order, self.shaft.held)
        waves: tuple[Array, Array] = self.once(self.theta_rad, name, lambda: self._turned(order))
        return waves

    def _turned(self, order: int) -> tuple[Array, Array]:
        angle = order * self.theta_rad
        power = 2 if self.inverter else 1
        if self.shaft.held or (power == 1 and self.shaft.finer == 1) or angle.size < _NEIGHBOURS:
            return np.cos(angle), np.sin(angle)
        seen = np.sinc(np.gradient(angle) / (2.0 * math.pi)) ** power
        return seen * np.cos(angle), seen * np.sin(angle)

    def one_sample(self) -> Operating:
        """The first sample alone [1]."""
        first = self.at(np.zeros(1, dtype=np.int64))
        return replace(first, shaft=replace(first.shaft, run=None))

    def at(self, rows: NDArray[np.int64]) -> Operating:
        """Some of the samples, for hooks that ask for nothing before or after a sample."""
        samples = {one.name: getattr(self, one.name)[rows] for one in fields(Samples)}
        run = None if self.shaft.run is None else self.shaft.run[rows]
        return replace(
            self,
            **samples,
            shaft=replace(self.shaft, run=run),
            supply=replace(self.supply, volts_v=None),
            psi_wb=None,
            torque_em_nm=None,
            kept={},
        )

    @property
    def i_a(self) -> Complex:
        """Complex rotor-frame current d + jq [A]."""
        name = ("current", id(self.iq_a))
        _, current = self.once(self.id_a, name, lambda: (self.iq_a, self.id_a + 1j * self.iq_a))
        whole: Complex = current
        return whole

    @property
    def flux_wb(self) -> Complex:
        """Complex rotor-frame flux linkage [Wb]; ValueError before the flux hooks have run."""
        if self.psi_wb is None:
            raise ValueError("flux linkage is not there yet: flux hooks come first")
        return self.psi_wb

    @property
    def torque_nm(self) -> Array:
        """Air-gap torque [N·m]; ValueError before the flux hooks have run."""
        if self.torque_em_nm is None:
            raise ValueError("torque is not there yet: flux hooks come first")
        return self.torque_em_nm


def log1p(value: Any) -> Any:
    """log(1 + value) of real values, or of values [n] a complex step aside.

    To first order in the imaginary part, which is all that a complex step asks for, and ten times
    as fast as the complex function.
    """
    if not np.iscomplexobj(value):
        return np.log1p(value)
    return np.log1p(value.real) + 1j * (value.imag / (1.0 + value.real))


def _waves(order: int, angle: Any) -> tuple[Any, Any]:
    """Cosine and sine [n] of a multiple of an angle, which may be a complex step aside."""
    turned = order * angle
    cosine, sine = np.cos(turned.real), np.sin(turned.real)
    if not np.iscomplexobj(angle):
        return cosine, sine
    return cosine - 1j * (turned.imag * sine), sine + 1j * (turned.imag * cosine)


@dataclass(frozen=True, slots=True)
class Recorded:
    """What sensor hooks may correct: complex dq current [A], shaft torque [N·m], on one clock.

    `eps_rad` and `omega_e_rad_s` are electrical, `ts_s` the sample period; `instrument`: which
    of a bench's (`drive` or `bench`), `phase` (0, 1, 2) whose line current a
    two-terminal test recorded. `ahead`(delay): what current, torque and electrical angle are so
    much later [s], less what they are now, from the whole log; without it, from these samples.
    """

    i_a: Complex
    torque_nm: Array
    eps_rad: Array
    omega_e_rad_s: Array
    ts_s: float
    inverter: bool
    instrument: str
    phase: int | None = None
    ahead: Callable[[float], tuple[Complex, Array, Array]] | None = None

    def later(self, delay_s: float) -> tuple[Complex, Array, Array]:
        """Current [n, A] and torque [n, N·m] as they are recorded `delay_s` later, and the
        electrical angle that the rotor turns until then [n, rad].
        """
        if self.ahead is not None:
            current, torque, turned = self.ahead(delay_s)
            return self.i_a + current, self.torque_nm + torque, turned
        at: Array = np.arange(self.torque_nm.size, dtype=np.float64) + delay_s / self.ts_s
        turned = self.omega_e_rad_s * delay_s
        return between(self.i_a, at), between(self.torque_nm, at), turned


def between(signal: Any, at: Array) -> Any:
    """A signal [N] at places [n] between its samples, its ends held.

    Through two samples by a cubic whose slopes there are the central differences. Reference:
    Catmull & Rom (1974), A class of local interpolating splines.
    """
    place = np.clip(at, 0.0, signal.size - 1.0)
    first = np.minimum(place.astype(np.int64), max(signal.size - 2, 0))
    part = place - first
    near = [signal[np.clip(first + k, 0, signal.size - 1)] for k in (-1, 0, 1, 2)]
    before, here, there, after = near
    bend = 2.0 * before - 5.0 * here + 4.0 * there - after
    twist = 3.0 * (here - there) + after - before
    return here + 0.5 * part * (there - before + part * (bend + part * twist))


Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class FullLog:
    """All of one drive log [n], with what the fitted model makes of it.

    `x` with its air-gap torque, `drag_nm` of everything else in the model, `shaft_nm` the true
    torque at the shaft's sensor, `good` the samples that were recorded well; `u_*` are the standard
    deviations of the noise of angle [rad], shaft torque and air-gap torque [N·m].
    """

    x: Operating
    drag_nm: Array
    shaft_nm: Array
    good: NDArray[np.bool_]
    u_theta_rad: float
    u_shaft_nm: float
    u_air_gap_nm: float


@dataclass(frozen=True, slots=True)
class Discrimination:
    """Which of the effects that share a discriminator it is, and parameters with their standard
    uncertainties, in their own units.
    """

    name: str
    values: Mapping[str, tuple[float, float]]


CoenergyHook = Callable[[Operating, Values], Any]
DropHook = Callable[[Operating, Values], Complex]
TorqueHook = Callable[[Operating, Values], Array]
AngleHook = Callable[[Operating, Values], Array]
CurrentHook = Callable[[Recorded, Values], Complex]
LoadHook = Callable[[Recorded, Values], Array]
VoltageHook = Callable[[Complex, Operating, Values, str], Complex]
ClockHook = Callable[[str, Values], float]
DiscriminatorHook = Callable[[Sequence[FullLog], Values], Discrimination | None]


@dataclass(frozen=True, slots=True)
class LinearForm:
    """The equation of an effect in other parameters, which it is linear in wherever they are.

    `effect` has these parameters; its name is never reported. `values`(q, base, machine): the
    effect's own parameters from them and from the base constants, in their units; None where no
    machine has such. `channel`: the signal in which it acts.
    """

    effect: Effect
    channel: str
    values: Callable[[Values, Values, Machine], Values | None]


@dataclass(frozen=True, kw_only=True)
class Description:
    """The description of an effect for people.

    `words` is its formula in a line, `signature` what it looks like, `headline` what a person says
    of it, with sizes in braces (`criticism.library.headline`); name and parameters without one.
    """

    words: str
    signature: str
    reference: str
    headline: str = ""


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What shows an effect: `signals` are the capture columns without which it cannot be seen,
    `tests` those that excite it, the best first, and `experiment` the one to record.

    `rivals`: other effects and the test or calibration that parts them from this.
    """

    tests: tuple[str, ...]
    experiment: str
    signals: tuple[str, ...] = ()
    rivals: Mapping[str, str] = field(default_factory=dict)


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

    linear: its linear form, from which it is fitted where no tangent leads to it.

    discriminator(logs, q): which of the effects that share this very function it is;
        None where full logs do not say. For effects whose equations differ in what windows smooth.
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
    linear: LinearForm | None = None
    discriminator: DiscriminatorHook | None = None

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
        """The parameters for one machine, `expand`ed where their number depends on it."""
        return tuple(p for p in self.every(machine) if p.optional not in self.left_out)

    def every(self, machine: Machine) -> tuple[Parameter, ...]:
        """The parameters with those of the optional terms that are left out."""
        return self.expand(machine) if self.expand is not None else self.parameters

    def gone_through(self, machine: Machine) -> bool:
        """Whether some capture goes through a whole period of one of its waves of the angle; of an
        effect without such waves, always.
        """
        orders = [p.order for p in self.parameters_of(machine) if p.order]
        return not orders or max(orders) * machine.travel_turns >= 1.0

    def dof(self, machine: Machine) -> int:
        """How many parameters are fitted."""
        return sum(not p.choice for p in self.parameters_of(machine))
