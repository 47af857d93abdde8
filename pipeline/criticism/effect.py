"""What a physical effect is: one file in `effects/`, one `EFFECT`, found by the registry.

One object serves simulation, residual, fit and report. An effect enters the machine's equations
by the hooks it fills in; all of them are zero at zero parameters, so that any effect can be added
to any model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.policy.policy import DEFAULT, Policy

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Made = TypeVar("Made")

SCALES = ("current_a", "voltage_v", "speed_rad_s", "freq_hz", "torque_nm", "period_s", "flux_wb")
"""What `Machine.scales` holds, and a parameter's `scale` may name."""
RECORDERS = ("log", "open", "shaft", "step")
"""What a bench may record on clocks of their own: logs under load, open windings, a shaft alone
(coasts and slow turns), steps of a locked rotor."""

_NEIGHBOURS = 2


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect; sizes are in multiples of the machine's own `scale`.

    Attributes
    ----------
    name, unit
        Name within the effect, and the unit of its value.
    typical
        Magnitude that is seen on real benches [scales].
    negligible
        Magnitude that is negligible in use [scales]; with a shape parameter below it the effect is
        absent.
    scale
        Entry of `Machine.scales`, such as `torque_nm`; `1` for the unit itself.
    low, high
        Bounds of the value [scales].
    words
        Meaning in a few words.
    scan
        Trial values of a shape parameter, which has no influence while the amplitudes of its effect
        are zero; empty for an amplitude.
    choice
        Whether it takes one of the values of `scan` and is never fitted.
    optional
        Parameters of one number above 0 form a term that the effect can do without; without it they
        are zero.
    u
        Standard uncertainty [unit] of a value that a discriminator gives: of an amplitude the prior
        `usual`, which is then measured.
    at_least
        Another amplitude of the effect; where this one stays below half of it, captures speak
        against the effect.
    usual
        Value and standard uncertainty [unit] that handbooks give for the material: a prior of every
        fit.
    starts
        Values [scales] at which an amplitude is tried too, where the tangent at zero does not lead
        to it.
    order
        Waves a turn of which it is an amplitude.

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


def choice(name: str, values: tuple[float, ...], words: str = "") -> Parameter:
    """A parameter that takes one of a few values and is never fitted.

    Parameters
    ----------
    name
        Name within the effect.
    values
        The values, in the order in which they are tried.
    words
        What each value means.

    """
    return Parameter(name, "1", 1.0, 0.0, words=words, scan=values, choice=True)


UNLOGGED = {"temp_winding_degc": "unlogged_winding_k", "temp_magnet_degc": "unlogged_magnet_k"}
"""Nuisance that stands for a temperature where a test that warms the machine did not record it."""


@dataclass(frozen=True, slots=True)
class Machine:
    """What the captures say of the size of the motor, before any fit.

    Attributes
    ----------
    pole_pairs, slots
        Counted or stated; `slots` of the nameplate.
    scales
        Largest current, speed, torque and voltage, the sample period, and what follows from them
        [unit of the name's suffix].
    torque_orders
        Orders a turn that stand out of a slow turn.
    stated_u
        Standard uncertainty of the station's gains and thermometers, by the name of the nuisance
        that stands for each.
    encoder_rad
        Step of the encoder that drive logs show; 0 where they show none.
    load_orders
        Other orders, whole numbers or not, that a fit left in logs under load.
    travel_turns
        How far the shaft turns in any one capture [turns].
    pairs_known
        Whether anything gives the pole pairs. Where not, they are taken as one, so that
        a flux linkage is Ke, and one over speed or torque says nothing of the flux.
    unlogged
        Column and capture, by the nuisance that stands for the temperature which that capture did
        not record.
    stated
        Stated constants of the motor: value and standard uncertainty by the name of the parameter.
    policy
        Constants of judgement.

    """

    pole_pairs: int
    slots: int | None
    scales: Mapping[str, float]
    torque_orders: tuple[int, ...] = ()
    stated_u: Mapping[str, float] = field(default_factory=dict)
    encoder_rad: float = 0.0
    load_orders: tuple[float, ...] = ()
    travel_turns: float = math.inf
    pairs_known: bool = True
    unlogged: Mapping[str, tuple[str, str]] = field(default_factory=dict)
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
        """Size of one relative unit of a parameter.

        Parameters
        ----------
        parameter
            A parameter of an effect.

        Returns
        -------
        float
            In the unit of the parameter; 1 where it has no scale.

        """
        return 1.0 if parameter.scale == "1" else self.scales[parameter.scale]


@dataclass(frozen=True, slots=True)
class Supply:
    """How a drive feeds the machine, where that is known.

    Attributes
    ----------
    pwm_s
        Period of the inverter's switching [s]; 0 where not known.
    vdc_v
        Voltage of its link [V]; 0 where not known.
    volts_v
        Voltage of the drive's log in the true rotor frame [n, V], where it has both axes.
    q_alone
        Whether the log holds the q axis only, so that of a voltage's delay only its envelope shows.
    hold_s
        Time for which a voltage vector is constant while the rotor turns [s]; 0 where not known.

    """

    pwm_s: float = 0.0
    vdc_v: float = 0.0
    volts_v: Complex | None = None
    q_alone: bool = False
    hold_s: float = 0.0


@dataclass(frozen=True, slots=True)
class ShaftState:
    """How the shaft is held and what records it.

    Attributes
    ----------
    held
        Whether a dynamometer holds the far end; else the recorded torque is the load of the far
        end.
    stator
        Whether a transducer reads the stator's reaction torque, which nothing behind the rotor is
        in.
    alone
        Whether nothing records the torque that the shaft passes on, so that its load is a drag.
    finer
        Points of the angle a sample.
    run
        Number of reversals before a sample [n].
    runs_rad
        Angle turned from each reversal to the next [runs, rad], negative backwards.
    behind_nm
        Recorded torque over one that follows it with a play [n], where a transducer recorded it.

    """

    held: bool = False
    stator: bool = False
    alone: bool = False
    finer: int = 1
    run: NDArray[np.int64] | None = None
    runs_rad: Array | None = None
    behind_nm: Array | None = None


@dataclass(slots=True, kw_only=True)
class Samples:
    """What has one number a sample: the true state of the machine.

    Attributes
    ----------
    id_a, iq_a
        True currents in the true rotor frame [n, A], amplitude-invariant.
    eps_rad
        True electrical angle [n].
    theta_rad, omega_rad_s
        True angle and speed of the shaft [n].
    winding_k, magnet_k
        Temperatures above 25 degC [n, K].
    travel_rad
        Angle turned since the last reversal [n]; infinite before the first.
    freq_hz
        Electrical frequency [n].

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


_MOTION = {"eps_rad", "theta_rad", "omega_rad_s"}
"""Columns of the motion."""


@dataclass(slots=True, kw_only=True)
class Operating(Samples):
    """Where the machine is at each sample; what hooks are evaluated on.

    `base` holds r_ohm, ld_h, lq_h, psi_wb of the fit, `ts_s` is the sample period. `inverter`: the
    machine is fed and logged by a drive, so that inverter and drive-sensor effects apply; `supply`
    says how. `psi_wb` [n] (complex, d + jq) and `torque_em_nm` [n] are there for drop and torque
    hooks. `cache` is what `once` made.
    """

    machine: Machine
    base: Mapping[str, float]
    ts_s: float
    inverter: bool
    supply: Supply = Supply()
    shaft: ShaftState = ShaftState()
    psi_wb: Complex | None = None
    torque_em_nm: Array | None = None
    cache: dict[tuple[int, Hashable], tuple[Any, Any]] = field(default_factory=dict)

    def fed(self, **supply: Any) -> Operating:
        """The same machine, fed and logged by a drive of which more is known.

        Parameters
        ----------
        **supply
            Fields of `Supply` with new values.

        """
        return replace(self, inverter=True, supply=replace(self.supply, **supply))

    def beside(self, other: Operating) -> Operating:
        """The same state with the arrays of another one where they are equal.

        Parameters
        ----------
        other
            State of the same segment at near values.

        Returns
        -------
        Operating
            What was computed `once` of the other's arrays serves both; the state itself where the
            motion differs.

        """
        columns = {
            name: theirs
            for name in (one.name for one in fields(Samples))
            if np.array_equal(getattr(self, name), theirs := getattr(other, name))
        }
        same = columns.keys() >= _MOTION and self.ts_s == other.ts_s
        return replace(self, **columns, cache=dict(other.cache)) if same else self

    def once(self, column: Any, name: Hashable, make: Callable[[], Made]) -> Made:
        """What depends on one array alone, computed once for all copies of the state that share the
        array.

        Parameters
        ----------
        column
            The array; its identity is the key.
        name
            What is computed from it.
        make
            Computes it.

        Returns
        -------
        Made
            The result of `make`, of this call or an earlier one.

        """
        known = self.cache.get((id(column), name))
        if known is None:
            # the column is kept with it, so that nothing else takes its identity
            known = self.cache[id(column), name] = column, make()
        result: Made = known[1]
        return result

    def waves(self, order: int) -> tuple[Any, Any]:
        """Cosine and sine of a multiple of the electrical angle, computed once an angle.

        Parameters
        ----------
        order
            Multiple of the electrical angle.

        Returns
        -------
        tuple of array [n]
            Cosine and sine.

        """
        return self.once(self.eps_rad, order, lambda: _waves(order, self.eps_rad))

    def shaft_waves(self, order: int) -> tuple[Array, Array]:
        """Cosine and sine of a multiple of the shaft angle, as a sample's torque contains them.

        Parameters
        ----------
        order
            Waves a turn.

        Returns
        -------
        tuple of array [n]
            Cosine and sine, attenuated by the averaging within a sample.

        Notes
        -----
        The torque of a free shaft is given by the second difference of its angle, which is a mean
        under a triangle of two samples: sinc² of half the angle that the wave turns in one sample.
        Where that mean is taken over `finer` points a sample, each has the mean of its own part:
        a wave that turns many times from point to point would alias.

        """
        name = ("shaft", order, self.shaft.held)
        return self.once(self.theta_rad, name, lambda: self._turned(order))

    def _turned(self, order: int) -> tuple[Array, Array]:
        angle, finer = order * self.theta_rad, self.shaft.finer > 1
        power = 1 if finer else 2
        if self.shaft.held or not (self.inverter or finer) or angle.size < _NEIGHBOURS:
            return np.cos(angle), np.sin(angle)
        share = np.sinc(np.gradient(angle) / (2.0 * math.pi)) ** power
        return share * np.cos(angle), share * np.sin(angle)

    def one_sample(self) -> Operating:
        """The first sample alone [1]."""
        first = self.at(np.zeros(1, dtype=np.int64))
        return replace(first, shaft=replace(first.shaft, run=None))

    def at(self, rows: NDArray[np.int64]) -> Operating:
        """Some of the samples, for hooks that use nothing before or after a sample.

        Parameters
        ----------
        rows
            Indices of the samples.

        Returns
        -------
        Operating
            Without flux, torque and logged voltage, and without what `once` computed.

        """
        samples = {one.name: getattr(self, one.name)[rows] for one in fields(Samples)}
        run = None if self.shaft.run is None else self.shaft.run[rows]
        behind = None if self.shaft.behind_nm is None else self.shaft.behind_nm[rows]
        return replace(
            self,
            **samples,
            shaft=replace(self.shaft, run=run, behind_nm=behind, finer=1),
            supply=replace(self.supply, volts_v=None),
            psi_wb=None,
            torque_em_nm=None,
            cache={},
        )

    @property
    def i_a(self) -> Complex:
        """Complex rotor-frame current d + jq [A]."""
        name = ("current", id(self.iq_a))
        _, current = self.once(self.id_a, name, self._current)
        return current

    def _current(self) -> tuple[Array, Complex]:
        """The complex current, with the q current that keeps its identity."""
        return self.iq_a, self.id_a + 1j * self.iq_a

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
    """log(1 + x) of real values, or of values with a complex step in them.

    Parameters
    ----------
    value
        [n], real, or complex with a tiny imaginary part.

    Returns
    -------
    array [n]
        To first order in the imaginary part, which is all that a complex step needs, and ten times
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
    """Recorded signals that sensor hooks may correct, on one clock.

    Attributes
    ----------
    i_a
        Complex dq current [n, A].
    torque_nm
        Shaft torque [n].
    eps_rad, omega_e_rad_s
        Electrical angle and speed [n].
    ts_s
        Sample period.
    inverter
        Whether a drive fed and logged the machine.
    instrument
        `drive` or `bench`.
    phase
        Line (0, 1, 2) whose current a two-terminal test recorded.
    ahead
        Changes of current, torque and electrical angle within a delay [s], from the whole log; None
        where these samples are all there is.

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
        """Current and torque as they are recorded some time later, and what the rotor turns until
        then.

        Parameters
        ----------
        delay_s
            How much later; may be a fraction of a sample.

        Returns
        -------
        tuple of array [n]
            Complex current [A], torque [N·m], electrical angle [rad].

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

    Parameters
    ----------
    signal
        Samples [N], real or complex.
    at
        Places [n] in samples from the first; clipped to the record.

    Returns
    -------
    array [n]
        Through two samples by a cubic whose slopes there are the central differences.

    References
    ----------
    Catmull and Rom, A class of local interpolating splines, in Computer Aided Geometric Design,
    Academic Press, 1974.

    """
    place = np.clip(at, 0.0, signal.size - 1.0)
    first = np.minimum(place.astype(np.int64), max(signal.size - 2, 0))
    part = place - first
    points = [signal[np.clip(first + k, 0, signal.size - 1)] for k in (-1, 0, 1, 2)]
    before, left, right, after = points
    bend = 2.0 * before - 5.0 * left + 4.0 * right - after
    twist = 3.0 * (left - right) + after - before
    return left + 0.5 * part * (right - before + part * (bend + part * twist))


Values = Mapping[str, float]
Signals = Mapping[str, Array]


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
    good: NDArray[np.bool_]
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
    of it, with sizes in braces (`criticism.library.headline`); name and parameters without one.
    `touches`: constants of a datasheet that mean something else where it acts, and what.
    `in_friction`: whether tests without voltages or d current count its drag as friction.
    """

    words: str
    signature: str
    reference: str
    headline: str = ""
    touches: Mapping[str, str] = field(default_factory=dict)
    in_friction: bool = False


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What shows an effect: `signals` are the capture columns without which it cannot be seen,
    `tests` those that excite it, the best first, and `experiment` the one to record.

    `alternatives`: other effects, each with the test or calibration that discriminates it from
    this.
    """

    tests: tuple[str, ...]
    experiment: str
    signals: tuple[str, ...] = ()
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

    def gone_through(self, machine: Machine) -> bool:
        """Whether some capture goes through a whole period of a wave of the effect over the angle.

        Parameters
        ----------
        machine
            Holds how far the shaft turns.

        Returns
        -------
        bool
            True for an effect without such waves.

        """
        orders = [p.order for p in self.parameters_of(machine) if p.order]
        return not orders or max(orders) * machine.travel_turns >= 1.0

    def dof(self, machine: Machine) -> int:
        """How many parameters are fitted.

        Parameters
        ----------
        machine
            Determines how many there are.

        """
        return sum(not p.choice for p in self.parameters_of(machine))
