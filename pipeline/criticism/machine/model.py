"""The machine's equations: a base of constants and any set of effects.

    v = R i + drops + dψ/dt + j ω_e ψ,       ψ = ∂W/∂i,
    T = 1.5 p [Im(ψ* i) + ∂W/∂ε],            T_shaft = T − drags − J dω/dt,

with W the co-energy over 1.5 of magnet, inductances and every flux effect, so that flux, torque
and reciprocity come from one function.

References: [1] Vas, Sensorless Vector and Direct Torque Control (1998), ch. 2 (frame); [2]
Woodson & Melcher, Electromechanical Dynamics (1968), ch. 3 (torque from co-energy).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.coenergy import (
    air_gap_torque,
    base_flux,
    effect_flux,
    flux_of,
    unsampled_voltage,
)
from pipeline.criticism.machine.sample_period import mean_current
from pipeline.criticism.operating import Array, Complex, Noted, Operating, Values
from pipeline.criticism.parameter import BENDING, THERMOMETER, WARMING, Machine, Parameter
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.policy.priors import Priors


@dataclass(frozen=True, slots=True)
class Constant:
    """A parameter of the base model: unit, and the centre of a nuisance's prior; its standard
    uncertainty (`policy.priors`) is in multiples of a scale of the machine.

    Attributes
    ----------
    name, unit, words
        Name, unit and meaning.
    center
        Centre of a nuisance's prior [unit].
    hook
        Where it enters: `log` of a nuisance of the segments that have it in `fixed`.
    scale
        What its standard uncertainty is in multiples of.
    prior
        Field of `policy.priors` with its standard uncertainty; the one of its own name without it.
    curved
        Whether it moves the true state or its time, so that no residual is linear along it.

    """

    name: str
    unit: str
    words: str
    center: float = 0.0
    hook: str = "drop"
    scale: str = "1"
    prior: str = ""
    curved: bool = False

    def u(self, priors: Priors) -> float | None:
        """Its standard uncertainty by the policy, in multiples of `scale`; None without a prior.

        Parameters
        ----------
        priors
            Of the policy.

        """
        return getattr(priors, self.prior or self.name, None)


_of_log = partial(Constant, hook="log")
"""A nuisance of some logs: its equation, or the cut of segments, has it in `fixed`."""
_unlogged = partial(_of_log, unit="K", prior="unlogged_k", curved=True)
_gain = partial(Constant, unit="1", hook="gain", prior="gain")
BASE: tuple[Constant, ...] = (
    Constant("r_ohm", "ohm", "phase resistance at 25 °C", hook="drop"),
    Constant("ld_h", "H", "d inductance near zero current", hook="flux"),
    Constant("lq_h", "H", "q inductance near zero current", hook="flux"),
    Constant("psi_wb", "Wb", "magnet flux at 25 °C", hook="flux"),
    Constant("j_kgm2", "kg·m²", "inertia that the shaft torque does not see", hook="motion"),
    Constant("b_nm_s_rad", "N·m·s/rad", "viscous friction", hook="torque"),
    Constant("ripple_slope", "1", "T_s, mean current before the sample", hook="hold"),
    Constant("ripple_mean", "1", "(ω_e T_s)² ψ/L, ripple of the current", 0.02, hook="hold"),
    Constant("ripple_edge", "1", "(ω_e T_s)² of the voltage, what a mean misses", hook="hold"),
    Constant("ripple_shift", "1", "T_s dω_e/dt ψ, angle against voltage", hook="hold"),
    Constant("frame_lag_s", "s", "lag of the speed that a drive turns its voltage by", hook="hold"),
    Constant(
        "command_lead", "1", "PWM periods from a voltage's command to its middle", hook="hold"
    ),
    Constant("ripple_torque", "1", "T_s di/dt of the current in the torque", hook="hold"),
    Constant("ripple_held", "1", "(ω_e T_s)², ripple in a held shaft's torque", hook="hold"),
    Constant("ripple_sampled", "s", "from a pulse's sample to its mean", hook="hold"),
    Constant("bench_angle_rad", "rad", "electrical zero of the bench's encoder", hook="bench"),
    Constant("lead_ohm", "ohm", "resistance of inverter and leads"),
    Constant("zero_alpha_a", "A", "α offset of the shunts", 0.0, "state", "current_a", "zero_a"),
    Constant("zero_beta_a", "A", "β offset of the shunts", 0.0, "state", "current_a", "zero_a"),
    Constant("zero_angle_rad", "rad", "electrical zero of the drive's encoder", hook="state"),
    Constant("late_angle_s", "s", "drive's encoder behind its currents", 0.0, "state", "period_s"),
    Constant("bend_angle_s2", "s²", "drive's frame behind the shaft by acceleration", hook="state"),
    _gain("gain_current", words="gain of the drive's current sensors"),
    _gain("gain_current_bench", words="gain of the bench's ammeter"),
    _gain("gain_voltage", words="gain of the bench's voltmeters"),
    _gain("gain_commanded", words="gain of a drive's own voltage"),
    _gain("gain_torque", words="gain of the torque transducer"),
    Constant("late_torque_s", "s", "lag of the torque transducer", 0.0, "gain", "period_s"),
    _gain("gain_lcr", words="gain of the LCR meter"),
    Constant("phase_lcr_rad", "rad", "phase of the LCR meter's impedance", hook="gain"),
    Constant("gain_clock", "1", "recorded time over true time, less one", hook="gain"),
    Constant("offset_temp_k", "K", "offset of the thermometers", hook="gain", curved=True),
    _of_log("unlogged_d_share", "1", "reluctance torque of an unlogged i_d"),
    _unlogged("unlogged_winding_k", words="unrecorded winding over ambient"),
    _unlogged("unlogged_magnet_k", words="unrecorded magnet over ambient"),
    _of_log("late_speed_s", "s", "lateness of a speed that no angle is beside", curved=True),
    _of_log("bend_speed_s2", "s²", "second order of that lateness", curved=True),
    _of_log("lag_speed_s", "s", "lag of that second order", prior="late_speed_s", curved=True),
    _of_log("late_voltage_s", "s", "by how much motion follows a voltage late", curved=True),
    _of_log("electrical_s", "s", "L/R of a winding whose current is not logged"),
    _of_log("unsampled_share", "1", "change of flux that samples of a voltage miss"),
    _of_log("coast_dry_share", "1", "dry drags of coasts over others, less one"),
    _of_log("coast_viscous_share", "1", "viscous drag of coasts over others, less one"),
    _of_log("open_flux_share", "1", "magnet of open windings over that of others, less one"),
    _unlogged("unlogged_rest_k", words="the same of a winding in tests at rest"),
)
EARLY_SHARES = ("early_dry_share", "early_viscous_share")
"""Shares of friction that a capture has more at its start than later, where they are left free."""
EARLY_S = "early_s"
"""Time constant by which they vanish."""
_EARLY = (
    *(_of_log(name, "1", "drag at the start of a capture over the later, less one",
              prior="coast_dry_share") for name in EARLY_SHARES),
    _of_log(EARLY_S, "s", "time constant of that", prior="coast_dry_share", curved=True),
)  # fmt: skip
UNLOGGED_AT_REST = "unlogged_rest_k"
"""That of the winding in tests at rest: they warm it little, and show nothing of one that turns."""
_NOTHING = 1e-6
"""Share of its usual size that a nuisance keeps beside an effect that names it."""
PHASE_LCR = "phase_lcr_rad"
"""Nuisance of an LCR meter, whose resistance it makes unsure by as much as Q times its gain."""
ENCODER_ZERO = "zero_angle_rad"
"""Nuisance of a drive's encoder, which another mount changes."""
LATE_TORQUE = "late_torque_s"
"""Nuisance of every transducer: its filter."""
LATE_SPEED = "late_speed_s"
"""Nuisance of a log whose motion is known by an observer's or a tachometer's speed alone."""
BEND_SPEED = "bend_speed_s2"
"""Its second order: a filter of first order has none, an observer half of a delay's."""
LAG_SPEED = "lag_speed_s"
"""Lag of that second order, of a tracking loop: 2 ζ over its bandwidth."""
LATENESS = (LATE_SPEED, BEND_SPEED, LAG_SPEED)
"""How a drive's own speed is behind that of the shaft."""
LATE_VOLTAGE = "late_voltage_s"
"""Nuisance of a log of voltage and motion that two computers, or a filter, put on one clock."""
ELECTRICAL = "electrical_s"
"""Nuisance of the same: the electrical time constant by which the current follows the voltage."""
UNSAMPLED = "unsampled_share"
"""Nuisance of a voltage that is logged at instants, of what happens within a row."""
COAST_SHARES = ("coast_dry_share", "coast_viscous_share")
"""Nuisances of a coast beside other tests with drags: friction repeats to some percent."""
OPEN_FLUX = "open_flux_share"
"""Nuisance of an open-circuit test beside other tests that turn: a magnet may have lost flux."""
CURVED = (*(c.name for c in (*BASE, *_EARLY) if c.curved), *WARMING.values(), *BENDING.values())
"""How the names of nuisances begin along which no residual is linear."""
OF_SIGNALS = frozenset(c.name for c in BASE if c.hook in ("gain", "log"))
"""Constants of sensors and logs: a segment observes them as its sensors and `fixed` say."""
STATE = tuple(constant.name for constant in BASE if constant.hook == "state")
PHYSICAL = ("r_ohm", "ld_h", "lq_h", "psi_wb", "j_kgm2", "b_nm_s_rad")
"""The base's constants of the station, and of the motor; the others are nuisances of a log."""


def _of_further_instrument(name: str) -> Constant:
    """The nuisance of an instrument beside the first of its kind."""
    if name.startswith(THERMOMETER):
        return replace(next(c for c in BASE if c.name == THERMOMETER), name=name)
    return _gain(name, words="gain of a further instrument")


def base_of(machine: Machine) -> tuple[Constant, ...]:
    """The constants of the base model, gains of further instruments that the station has, friction
    that changes with time where it is left free, and temperatures that single captures do not
    record.

    Parameters
    ----------
    machine
        Its `stated_u` names the gains, its `unlogged` the temperatures.

    """
    early = tuple(constant for constant in _EARLY if constant.name in machine.stated_u)
    known = {constant.name for constant in (*BASE, *early)}
    further = sorted(set(machine.stated_u) - known)
    gains = (_of_further_instrument(name) for name in further)
    warmth = (
        _unlogged(name, words=f"{column} of {path} over that of others, or its course there")
        for name, (column, path) in machine.unlogged.items()
    )
    return (*BASE, *early, *gains, *warmth)


@dataclass(frozen=True, slots=True)
class Model:
    """A machine, its base constants and effects; parameters are addressed `effect.parameter`.

    Attributes
    ----------
    machine
        Size and policy.
    effects
        In the order in which they are applied.

    """

    machine: Machine
    effects: tuple[Effect, ...]

    @property
    def policy(self) -> Policy:
        """What a fit of the model, and what is concluded from it, goes by."""
        return self.machine.policy

    def parameters(self) -> dict[str, tuple[Effect, Parameter]]:
        """Every effect parameter by its full name, in order."""
        return {
            name: (effect, parameter)
            for effect in self.effects
            for name, parameter in effect.named(self.machine).items()
        }

    def hooks(self, name: str, values: Values) -> Iterator[tuple[Any, Values]]:
        """One hook of every effect that has it, with the effect's parameters by short name.

        Parameters
        ----------
        name
            Of the hook (`effect.Hooks`).
        values
            Parameters by full name.

        """
        for effect in self.effects:
            hook = getattr(effect, name)
            if hook is not None:
                yield hook, values_of(effect, self.machine, values)

    def priors(self) -> dict[str, tuple[float, float]]:
        """Centre and standard uncertainty of every nuisance and stated parameter.

        Returns
        -------
        dict of tuple
            By name [unit of the parameter]: what the station states of its instruments, else the
            policy's value; what handbooks say of materials; and what is stated of this motor.

        """
        stated = self.machine.stated_u
        sizes = {"1": 1.0, **self.machine.scales}
        base = [(c, c.u(self.policy.priors)) for c in base_of(self.machine)]
        priors = {
            c.name: (c.center, stated.get(c.name, u * sizes[c.scale]))
            for c, u in base
            if u is not None
        }
        center, least = priors[ENCODER_ZERO]
        priors[ENCODER_ZERO] = center, max(least, self.policy.priors.zero_angle_rad)
        center, least = priors["lead_ohm"]
        switches = self.policy.priors.lead_share * sizes.get("impedance_ohm", 0.0)
        priors["lead_ohm"] = center, stated.get("lead_ohm", max(least, switches))
        for effect in self.effects:
            if effect.in_place_of is not None:
                nuisance, _ = effect.in_place_of
                center, u = priors[nuisance]
                priors[nuisance] = center, _NOTHING * u
        priors |= {n: p.usual for n, (_, p) in self.parameters().items() if p.usual is not None}
        return priors | self.stated()

    def stated(self) -> dict[str, tuple[float, float]]:
        """What is stated of the model's own parameters: value and standard uncertainty."""
        known = {*PHYSICAL, *self.parameters()}
        return {
            name: value_and_u for name, value_and_u in self.machine.stated.items() if name in known
        }

    def with_effects(self, *effects: Effect) -> Model:
        """This model and further effects.

        Parameters
        ----------
        *effects
            Added behind those there are.

        """
        return replace(self, effects=self.effects + effects)

    def without(self, *names: str) -> Model:
        """This model less some effects.

        Parameters
        ----------
        *names
            Names of effects.

        """
        return replace(self, effects=tuple(e for e in self.effects if e.name not in names))


def values_of(effect: Effect, machine: Machine, values: Values) -> Values:
    """The parameters of one effect by their short names.

    Parameters
    ----------
    effect
        An effect of the model.
    machine
        Determines which parameters there are.
    values
        Parameters by full name.

    Returns
    -------
    mapping of float
        In their units; 0 for those of optional terms that are left out. Of `Noted` values, one that
        notes in the same set.

    """
    noted = values if isinstance(values, Noted) else None
    known, stem = values if noted is None else noted.plain, f"{effect.name}."
    parameters = {p.name: known[stem + p.name] for p in effect.parameters_of(machine)}
    if effect.left_out:
        parameters = {p.name: 0.0 for p in effect.every(machine)} | parameters
    return parameters if noted is None else Noted(parameters, noted.read, stem)


def clock_gain(recorder: str | None, model: Model, values: Values) -> float:
    """Recorded time over true time, less one.

    Parameters
    ----------
    recorder
        One of `RECORDERS`; None for a table.
    model
        Effects of clocks.
    values
        Parameters by full name.

    Returns
    -------
    float
        Gain of the station's clock and of the effects together [1]; 0 for a table.

    """
    if recorder is None:
        return 0.0
    gains = [clock(recorder, q) for clock, q in model.hooks("clock", values)]
    return values["gain_clock"] + sum(gains)


@dataclass(slots=True)
class Pieces:
    """What the hooks give at each sample; the equations of the model are linear in these.

    Attributes
    ----------
    psi_wb
        Flux linkage, complex d + jq [n].
    slope_wb
        ∂W/∂ε, of which 1.5 p is a torque [n, Wb·A].
    drop_v
        Resistive and other drops, complex d + jq [n].
    drag_nm
        Torque that opposes positive rotation [n].

    """

    psi_wb: Complex
    slope_wb: Array
    drop_v: Complex
    drag_nm: Array

    def every(self, points: int) -> Pieces:
        """What the hooks give at the samples, of so many points each.

        Parameters
        ----------
        points
            Points a sample.

        """
        at = slice(None, None, points)
        return Pieces(self.psi_wb[at], self.slope_wb[at], self.drop_v[at], self.drag_nm[at])


HOOKS = frozenset({"flux", "drop", "torque"})
"""What an equation may have in it of a machine's hooks."""


def evaluate(model: Model, x: Operating, values: Values, hooks: frozenset[str] = HOOKS) -> Pieces:
    """Evaluates every hook of a model but those of sensors.

    Parameters
    ----------
    model
        Base and effects.
    x
        True state [n]; flux and air-gap torque are stored in it.
    values
        Parameters by full name.
    hooks
        What is asked for: without `drop` or `torque`, drops or drags are zero.

    Returns
    -------
    Pieces
        Flux, drops and drags [n].

    Notes
    -----
    Flux effects first, then the current that flows in parallel with the magnetising one, which
    lowers the flux; drops at the mean current of the sample period, drags at the samples.

    """
    flux, slope = base_flux(x, values), np.zeros(x.omega_rad_s.shape)
    for effect in model.effects:
        if effect.coenergy is not None:
            added, turn = effect_flux(effect, x, values_of(effect, model.machine, values))
            flux, slope = flux + added, slope + turn
    x.psi_wb = flux
    for parallel, q in model.hooks("parallel", values):
        flux = flux - flux_of(parallel(x, q), values)
    x.psi_wb = flux
    x.torque_em_nm = air_gap_torque(x, flux, slope)
    drop = _drops(model, x, values) if "drop" in hooks else np.zeros_like(flux)
    if "drop" in hooks and x.supply.hold_ends is not None:
        drop = drop + unsampled_voltage(lambda at: _flux(model, at, values), x)
    drag = _drags(model, x, values) if "torque" in hooks else np.zeros_like(slope)
    return Pieces(flux, slope, drop, drag)


def _flux(model: Model, x: Operating, values: Values) -> Complex:
    """Flux linkage [n, Wb] of the base and of every effect that has a co-energy."""
    flux = base_flux(x, values)
    for effect in model.effects:
        flux = flux + effect_flux(effect, x, values_of(effect, model.machine, values))[0]
    return flux


def _drops(model: Model, x: Operating, values: Values) -> Complex:
    """Voltage [n, V] of the resistance and of every effect that has a drop."""
    mean = mean_current(x, values)
    drop: Complex = (values["r_ohm"] + lead_ohm(x, values)) * mean.i_a
    for lost, q in model.hooks("drop", values):
        drop = drop + lost(mean, q)
    return drop


def lead_ohm(x: Operating, values: Values) -> float:
    """Resistance of inverter and leads in the voltage of a state.

    Parameters
    ----------
    x
        A state; a voltage that is measured, at a bench or a drive, holds nothing of them.
    values
        Constants of the base.

    """
    return values["lead_ohm"] if x.inverter and not x.supply.measured else 0.0


def _drags(model: Model, x: Operating, values: Values) -> Array:
    """Torque [n, N·m] of friction and of every effect that has a drag; those of couplings are by
    the others, which are stored in the state.
    """
    x.drag_nm = values["b_nm_s_rad"] * x.omega_rad_s + _torques(model, x, values, couplings=False)
    return x.drag_nm + _torques(model, x, values, couplings=True)


def _torques(model: Model, x: Operating, values: Values, *, couplings: bool) -> Array:
    """Torque [n, N·m] of the effects that are couplings, or of all others."""
    torque = np.zeros(x.omega_rad_s.shape)
    for effect in model.effects:
        if effect.torque is not None and effect.coupling is couplings:
            torque = torque + effect.torque(x, values_of(effect, model.machine, values))
    return torque


def passed_on_drag(model: Model, x: Operating, values: Values, change_nm: Array) -> Array:
    """A small change of the drags, with what the couplings of a model make of it.

    Parameters
    ----------
    model
        Base and effects.
    x
        True state [n] that was evaluated.
    values
        Parameters by full name.
    change_nm
        Of the drags of all effects but couplings [n, N·m].

    Returns
    -------
    array [n, N·m]

    """
    if not change_nm.any() or not any(effect.coupling for effect in model.effects):
        return change_nm
    moved = replace(x, drag_nm=x.drag_nm + change_nm)
    after, before = (_torques(model, at, values, couplings=True) for at in (moved, x))
    return change_nm + after - before


def zero(effect: Effect, model: Model, at: Iterable[tuple[str, float]] = ()) -> dict[str, float]:
    """Values of an effect that is absent.

    Parameters
    ----------
    effect
        The effect.
    model
        Its machine.
    at
        Values of shape parameters by short name.

    Returns
    -------
    dict of float
        By full name: amplitudes 0, shapes as in `at` or the first of their trial values.

    """
    shapes = dict(at)
    values = {}
    for name, p in effect.named(model.machine).items():
        scale = model.machine.scale(p)
        values[name] = 0.0 if p.amplitude else shapes.get(p.name, p.scan[0] * scale)
    return values
