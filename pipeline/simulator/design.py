"""What is simulated: a motor's truths, a bench's instruments, and effects by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Size = float | Mapping[str, float]
Effects = Mapping[str, Size]

EXTRA_SIGNALS = ("torque", "vd", "vq")
EXTRA_VARIABLES = (
    "one",
    "omega_mech_rad_s",
    "theta_mech_rad",
    "theta_elec_rad",
    "id_a",
    "iq_a",
    "i_a",
    "temp_winding_degc",
    "temp_magnet_degc",
)


@dataclass(frozen=True, slots=True)
class Extra:
    """A term that is in no library: `signal += table(variable) * times`.

    `x`, `y` [n each] tabulate the term, linear between points and constant outside; an angle is
    taken modulo one turn. `signal` is `torque` [N·m] on the rotor, or `vd`, `vq` [V] taken from
    the motor's terminals. `times` is a second variable that multiplies, `one` for none.
    """

    signal: str
    variable: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    times: str = "one"

    def __post_init__(self) -> None:
        if self.signal not in EXTRA_SIGNALS:
            raise ValueError(f"an extra enters {', '.join(EXTRA_SIGNALS)}, not {self.signal}")
        for name in (self.variable, self.times):
            if name not in EXTRA_VARIABLES:
                raise ValueError(f"an extra depends on {', '.join(EXTRA_VARIABLES)}, not {name}")
        if len(self.x) != len(self.y) or len(self.x) < 2 or np.any(np.diff(self.x) <= 0):
            raise ValueError("an extra needs two or more increasing x and as many y")


@dataclass(frozen=True, slots=True)
class Motor:
    """One motor: wye-equivalent phase constants at 25 degC, ratings, thermal network, effects.

    Currents and fluxes are phase peaks. `speed_rated_rad_s` is mechanical. `rth_*` [K/W] and
    `cth_*` [J/K] are winding to ambient (wa), winding to magnet (wm) and magnet to ambient (ma).
    `effects` are those of `contract/effects.md` on top of copper, magnet and Coulomb friction,
    which are here because every motor has them. `nameplate` overrides what the metadata claims.
    `thermometer_share` below 1 is a winding thermometer that partly reads the magnet.
    """

    motor_type: str
    pole_pairs: int
    slots: int
    r_phase_ohm: float
    ld_h: float
    lq_h: float
    psi_pm_wb: float
    j_rotor_kgm2: float
    b_visc_nm_s_rad: float
    torque_coulomb_nm: float
    current_rated_a: float
    speed_rated_rad_s: float
    vdc_v: float
    rth_wa_k_w: float
    rth_wm_k_w: float
    rth_ma_k_w: float
    cth_winding_j_k: float
    cth_magnet_j_k: float
    temp_coeff_copper_1_k: float = 0.003854
    temp_coeff_magnet_1_k: float = -0.0011
    winding: str = "wye"
    ambient_degc: float = 25.0
    motor_id: str = "sim-0001"
    lot: str = "A"
    nameplate: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    effects: Effects = field(default_factory=lambda: MappingProxyType({}))
    extras: tuple[Extra, ...] = ()
    thermometer_share: float = 1.0

    def __post_init__(self) -> None:
        positive = (
            "pole_pairs slots r_phase_ohm ld_h lq_h j_rotor_kgm2 current_rated_a "
            "speed_rated_rad_s vdc_v rth_wa_k_w rth_wm_k_w rth_ma_k_w cth_winding_j_k "
            "cth_magnet_j_k"
        )
        for name in positive.split():
            if not getattr(self, name) > 0:
                raise ValueError(f"{self.motor_type}: {name} must be positive")
        for name in ("psi_pm_wb", "b_visc_nm_s_rad", "torque_coulomb_nm"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{self.motor_type}: {name} must not be negative")
        if self.winding not in {"wye", "delta"}:
            raise ValueError(f"{self.motor_type}: winding is wye or delta, not {self.winding}")

    def having(self, **effects: Size) -> Motor:
        """This motor with further effects; `name=size` or `name={parameter: value}`.

        Parameters
        ----------
        **effects
            Size of each effect in the unit of its `Form`, or its parameters.

        """
        return replace(self, effects=MappingProxyType({**self.effects, **effects}))

    @property
    def torque_rated_nm(self) -> float:
        """Magnet torque at rated current, 1.5 p psi I [N·m]."""
        return 1.5 * self.pole_pairs * self.psi_pm_wb * self.current_rated_a

    @property
    def tau_elec_s(self) -> float:
        """Slower electrical time constant, max(Ld, Lq) / R [s]."""
        return max(self.ld_h, self.lq_h) / self.r_phase_ohm


@dataclass(frozen=True, slots=True)
class Instruments:
    """The gains and offsets one station really has: common to all its samples.

    Offsets of clamp and probe are shares of half the scope's range.
    """

    current: float = 1.0
    voltage: float = 1.0
    voltage_commanded: float = 1.0
    torque: float = 1.0
    lcr: float = 1.0
    clock: float = 1.0
    temperature_degc: float = 0.0
    clamp: float = 1.0
    probe: float = 1.0
    clamp_offset: float = 0.0
    probe_offset: float = 0.0


EXACT = Instruments()


@dataclass(frozen=True, slots=True)
class Scope:
    """An oscilloscope with a current clamp and a voltage probe, each with a gain of its own.

    `noise_steps` is the noise before the converter in its steps. Offsets are drawn with a standard
    deviation of `offset_rel` of half the range.
    """

    bits: int = 12
    noise_steps: float = 0.7
    u_rel_clamp: float = 2e-3
    u_rel_probe: float = 1e-3
    offset_rel: float = 2e-3


@dataclass(frozen=True, slots=True)
class Bench:
    """One test station: rates, noise, resolution and stated uncertainties.

    Noise and resolution are relative to the motor's ratings (rated current, DC link, rated
    torque, rated speed), so that one bench suits any size. `instruments` None draws the gains
    from the stated uncertainties; `EXACT` is a perfect station. `drift_rel`, `hum_rel` are the
    size of a random walk at the end of a capture and of a mains pick-up, in units of the
    channel's noise. `jitter_s` scatters the time stamps only. `temperature_hz` puts thermometers
    of fast captures on a clock of their own. `scope` records the current steps in place of the
    station's own sensors. Hidden faults of the recorder: its clock is fast or slow by the share
    `clock_rel` beyond what `u_rel_clock` states (stated where above 0), while the speed that the
    bench reports goes by a clock of its own; torque and logged dq currents come `late_torque_s` and
    `late_current_s` late; the drive's encoder is read `late_angle_s` behind its currents, and its
    coupling has a play of `encoder_play_rad`; at rated torque the transducer reads
    `torque_bend_rel` of it too much, by a cubic, and `torque_hysteresis_rel` more on the way down
    than up. `dyno_hz` is the bandwidth of the dynamometer's speed loop, whose transducer then shows
    the reaction torque of its stator; 0 holds the shaft's far end at its speed, with the transducer
    in the coupling. With `torque_in_coupling` the transducer of every log stands between the two
    masses, with `torque_at_stator` it holds the motor's stator.
    """

    station: str = "sim-1"
    operator: str = "simulator"
    started_at: str = "2026-01-05T08:00:00Z"
    pwm_hz: float = 10_000.0
    current_noise_rel: float = 4e-4
    voltage_noise_rel: float = 2e-4
    torque_noise_rel: float = 6e-4
    speed_noise_rel: float = 1.5e-4
    temperature_noise_degc: float = 0.04
    lcr_noise_rel: float = 2e-3
    flux_noise_rel: float = 5e-4
    adc_bits: int = 16
    encoder_bits: int = 17
    encoder_noise_rad: float = 0.0
    speed_lag_s: float = 1e-3
    u_rel_current: float = 2e-3
    u_rel_voltage: float = 1e-3
    u_rel_torque: float = 2e-3
    u_rel_lcr: float = 2e-3
    u_temp_degc: float = 0.5
    u_rel_clock: float = 0.0
    noise_scale: float = 1.0
    drift_rel: float = 0.0
    hum_rel: float = 0.0
    hum_hz: float = 50.0
    jitter_s: float = 0.0
    temperature_hz: float | None = None
    scope: Scope | None = None
    clock_rel: float = 0.0
    late_torque_s: float = 0.0
    late_current_s: float = 0.0
    late_angle_s: float = 0.0
    encoder_play_rad: float = 0.0
    torque_bend_rel: float = 0.0
    torque_hysteresis_rel: float = 0.0
    dyno_hz: float = 0.0
    torque_in_coupling: bool = False
    torque_at_stator: bool = False
    instruments: Instruments | None = None

    def drawn(self, rng: np.random.Generator) -> Instruments:
        """The instruments of this station, drawn once from the stated uncertainties.

        Parameters
        ----------
        rng
            Source of random numbers.

        """
        if self.instruments is not None:
            return self.instruments
        draw = rng.standard_normal(6)
        # of a stream of its own: what else is drawn stays as it was without a clock
        clock = rng.spawn(1)[0].standard_normal()
        station = Instruments(
            current=1.0 + self.u_rel_current * float(draw[0]),
            voltage=1.0 + self.u_rel_voltage * float(draw[1]),
            voltage_commanded=1.0 + self.u_rel_voltage * float(draw[2]),
            torque=1.0 + self.u_rel_torque * float(draw[3]),
            lcr=1.0 + self.u_rel_lcr * float(draw[4]),
            clock=1.0 + self.u_rel_clock * float(clock),
            temperature_degc=self.u_temp_degc * float(draw[5]),
        )
        if self.scope is None:
            return station
        draw = rng.standard_normal(4)
        return replace(
            station,
            clamp=1.0 + self.scope.u_rel_clamp * float(draw[0]),
            probe=1.0 + self.scope.u_rel_probe * float(draw[1]),
            clamp_offset=self.scope.offset_rel * float(draw[2]),
            probe_offset=self.scope.offset_rel * float(draw[3]),
        )


@dataclass(frozen=True, slots=True)
class Recording:
    """One capture before it is written: a file stem, metadata, and tables of one clock each."""

    stem: str
    meta: Mapping[str, str]
    tables: tuple[dict[str, NDArray[np.float64]], ...]
