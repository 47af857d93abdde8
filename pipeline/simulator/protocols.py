"""How each test is done: one frozen dataclass a test, levels relative to the motor's ratings.

None means that the test chooses from the motor's time constants, so that any size works.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Resistance:
    """DC plateaus through one pair from a current source; levels in rated currents."""

    pair: str = "ab"
    levels: tuple[float, ...] = (0.0, 0.12, 0.24, 0.06, -0.06, -0.24, -0.12)
    dwell_s: float = 0.2
    rate_hz: float = 1000.0
    rise_s: float = 2e-3
    temp_degc: float | None = None


@dataclass(frozen=True, slots=True)
class CurrentStep:
    """Voltage step on one pair, rotor locked; `level` is the final current in rated currents.

    Times are in electrical time constants. The edges fall on sampling instants unless
    `random_edges` puts each anywhere between two of them or `rise_s` gives the supply a ramp;
    `source_share` is the supply's resistance over the pair's. The rotor is `theta_off_deg` from
    where it is stated to be.
    """

    pair: str = "ab"
    theta_elec_deg: float = -30.0
    level: float = 0.3
    before_tau: float = 0.5
    on_tau: float = 9.0
    off_tau: float = 5.0
    samples_tau: float = 140.0
    rate_hz: float | None = None
    rise_s: float = 0.0
    random_edges: bool = False
    source_share: float = 0.0
    theta_off_deg: float = 0.0
    temp_degc: float | None = None


@dataclass(frozen=True, slots=True)
class Lcr:
    """LCR meter across pairs over one electrical turn."""

    pairs: tuple[str, ...] = ("ab",)
    angles: int = 24
    freq_hz: float = 1000.0
    temp_degc: float | None = None


@dataclass(frozen=True, slots=True)
class OpenCircuit:
    """Shaft driven at several speeds, in rated speeds; negative is the other sense."""

    levels: tuple[float, ...] = (0.15, 0.35, 0.55, 0.75, 0.95)
    dwell_s: float | None = None
    rate_hz: float | None = None
    temp_magnet_degc: float | None = None
    phases: bool = False
    voltage_timing: str = "instant"


@dataclass(frozen=True, slots=True)
class HandTurn:
    """One mechanical turn by hand in about `duration_s`."""

    duration_s: float = 1.2
    rate_hz: float = 2000.0
    direction: int = 1
    with_angle: bool = True


@dataclass(frozen=True, slots=True)
class Cogging:
    """Slow steady turn at zero current; samples a turn None is 48 a cogging period."""

    direction: int = 1
    turns: float = 1.25
    speed_rad_s: float | None = None
    samples_turn: int | None = None
    theta_rad: float = 0.2


@dataclass(frozen=True, slots=True)
class TorqueMap:
    """Dynamometer holds `speed` (rated speeds); a grid of d and q levels (rated currents)."""

    speed: float = 0.3
    id_levels: tuple[float, ...] = (-0.5, -0.25, 0.0, 0.25)
    iq_levels: tuple[float, ...] = (-1.0, -0.6, -0.2, 0.2, 0.6, 1.0)
    dwell_s: float | None = None
    pwm_hz: float | None = None
    voltage_timing: str = "centred"
    temp_winding_degc: float | None = None
    temp_magnet_degc: float | None = None


@dataclass(frozen=True, slots=True)
class SpinDown:
    """Coast from `level` rated speeds with open terminals down to `end` of it."""

    level: float = 0.95
    direction: int = 1
    rate_hz: float | None = None
    samples: int = 1800
    end: float = 0.01
    temp_magnet_degc: float | None = None


@dataclass(frozen=True, slots=True)
class HeatRun:
    """d current on a locked rotor for `duration_tau` winding time constants.

    `level` None is what warms the winding by `rise_k` in the end, rated current at most.
    """

    level: float | None = None
    rise_k: float = 60.0
    duration_tau: float = 1.6
    samples: int = 3000
    theta_elec_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class HoldingCurrent:
    """Rotor held at many angles of one turn, arriving forwards, then backwards."""

    angles: int = 360
    dwell_s: float = 0.02
    samples: int = 4


@dataclass(frozen=True, slots=True)
class FluxMap:
    """Table of flux over a grid of currents (rated currents)."""

    id_levels: tuple[float, ...] = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5)
    iq_levels: tuple[float, ...] = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, slots=True)
class TorqueTable:
    """Shaft clamped to a transducer: q current stepped up and down (rated currents) at angles.

    `angles` are spread evenly over one electrical cycle; seven cancel ripple of orders 6 and 12,
    six would not. `friction` is the share of Coulomb's
    torque that the bearings hold back from the transducer, against the sense of the last step.
    """

    levels: tuple[float, ...] = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)
    angles: int = 7
    friction: float = 0.3
    with_angle: bool = True


@dataclass(frozen=True, slots=True)
class Drive:
    """Closed-loop everyday log: random speed references with reversals, load and d steps."""

    segments: int = 10
    segment_s: float | None = None
    speed: float = 0.8
    load: float = 0.35
    id_level: float = 0.3
    pwm_hz: float | None = None
    voltage_timing: str = "centred"
    temp_winding_degc: float | None = None
    temp_magnet_degc: float | None = None
