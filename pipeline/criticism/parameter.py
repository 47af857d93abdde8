"""A parameter of an effect, and the machine whose sizes it is measured by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.criticism.policy.policy import DEFAULT, Policy

SCALES = ("current_a", "voltage_v", "speed_rad_s", "freq_hz", "torque_nm", "period_s", "flux_wb")
"""What `Machine.scales` holds, and a parameter's `scale` may name."""


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
        absent. An amplitude for which it is 0 goes with the others: alone it is no such effect.
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
    rare_below
        Value [scales] below which benches seldom have it: of two effects that tie the other one is
        named.

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
    rare_below: float = -math.inf

    @property
    def amplitude(self) -> bool:
        """Whether the effect vanishes with this parameter."""
        return not self.scan

    @property
    def refines(self) -> bool:
        """Whether it refines a form that is looked for without it: a shape of one trial value."""
        return len(self.scan) == 1 and not self.choice and self.negligible == 0.0


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


def alone() -> Parameter:
    """Whether the sensors of a drive recorded the currents beside measured voltages too."""
    words = "1: of the logs of a drive's own voltages alone, 0: of those with measured ones as well"
    return choice("alone", (0.0, 1.0), words)


UNLOGGED = {"temp_winding_degc": "unlogged_winding_k", "temp_magnet_degc": "unlogged_magnet_k"}
"""Nuisance that stands for a temperature where a test that warms the machine did not record it."""
TRANSDUCER = "gain_torque"
"""Nuisance of a torque transducer: its gain. A station has one."""
THERMOMETER = "offset_temp_k"
"""Nuisance of the thermometers of a station: their common offset."""
WARMING = {"temp_winding_degc": "warming_winding_k", "temp_magnet_degc": "warming_magnet_k"}
"""Nuisance of what such a temperature rises by from the begin to the end of one capture."""
BENDING = {"temp_winding_degc": "bending_winding_k"}
"""Nuisance of how far it is above its mean in the middle of one: a winding comes to rest within a
minute, a magnet does not.
"""


@dataclass(frozen=True, slots=True)
class Machine:
    """What the captures say of the size of the motor, before any fit.

    Attributes
    ----------
    pole_pairs, slots
        Counted or stated; `slots` of the nameplate.
    scales
        Largest current, speed, torque and voltage, the sample period, and what follows from them
        [unit of the name's suffix]; `impedance_ohm` only where current and voltage are on record.
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
    rotor_angles
        Known angles of the rotor at which its winding was recorded, within a sixth of an electrical
        turn; infinite where one is logged as it turns.
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
    rotor_angles: float = math.inf
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

    @property
    def electrical_orders(self) -> tuple[float, ...]:
        """Orders [1/turn] at which electrical effects show, sorted: 1, 2, p, 2p, 6p, 12p and those
        that logs under load show.
        """
        p = self.pole_pairs
        return tuple(sorted({1, 2, p, 2 * p, 6 * p, 12 * p, *self.load_orders}))

    @property
    def ripple_orders(self) -> tuple[float, ...]:
        """Orders [1/turn] of waves that may turn far from row to row of a log, sorted: 6p, 12p and
        the cogging order.
        """
        p, cogging = self.pole_pairs, self.cogging_order
        return tuple(sorted({6 * p, 12 * p, *([cogging] if cogging else [])}))

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
