"""What the machine does at each sample: what the hooks of effects are evaluated on."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.parameter import Machine

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
Made = TypeVar("Made")
_NEIGHBOURS = 2


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
    measured
        Whether the voltage is stated to be measured, so that nothing of the inverter is in it.
    hold_ends
        Of a log of snapshots from one of which to the next the rotor turns far: where the vector
        of a sample begins and ends, behind the sample [s], and by what the current exceeds the
        sample's there [n, A]; None for any other log.

    """

    pwm_s: float = 0.0
    vdc_v: float = 0.0
    volts_v: Complex | None = None
    q_alone: bool = False
    hold_s: float = 0.0
    measured: bool = False
    hold_ends: tuple[tuple[float, Complex], tuple[float, Complex]] | None = None


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
    age_s
        Time since the capture began [n], where friction may change with it.

    """

    held: bool = False
    stator: bool = False
    alone: bool = False
    finer: int = 1
    run: Indices | None = None
    runs_rad: Array | None = None
    behind_nm: Array | None = None
    age_s: Array | None = None


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


_COLUMNS = tuple(one.name for one in fields(Samples))
_MOTION = {"eps_rad", "theta_rad", "omega_rad_s"}
"""Columns of the motion."""


@dataclass(slots=True, kw_only=True)
class Operating(Samples):
    """Where the machine is at each sample; what hooks are evaluated on.

    `base` holds r_ohm, ld_h, lq_h, psi_wb of the fit, `ts_s` is the sample period. `inverter`: the
    machine is fed and logged by a drive, so that inverter and drive-sensor effects apply; `supply`
    says how. `psi_wb` [n] (complex, d + jq) and `torque_em_nm` [n] are there for drop and torque
    hooks, `drag_nm` [n] of all other effects for a coupling. `cache` is what `once` made.
    """

    machine: Machine
    base: Mapping[str, float]
    ts_s: float
    inverter: bool
    supply: Supply = Supply()
    shaft: ShaftState = ShaftState()
    psi_wb: Complex | None = None
    torque_em_nm: Array | None = None
    drag_nm: Array | float = 0.0
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
            for name in _COLUMNS
            if (ours := getattr(self, name)) is (theirs := getattr(other, name))
            or np.array_equal(ours, theirs)
        }
        same = columns.keys() >= _MOTION and self.ts_s == other.ts_s
        return replace(self, **columns, cache=dict(other.cache)) if same else self

    def like(self, other: Operating) -> bool:
        """Whether all columns of the state, and the voltage of its supply, are those of another.

        Parameters
        ----------
        other
            State that this one is `beside`.

        """
        volts, theirs = self.supply.volts_v, other.supply.volts_v
        same_volts = volts is theirs or (
            volts is not None and theirs is not None and np.array_equal(volts, theirs)
        )
        return same_volts and all(getattr(self, n) is getattr(other, n) for n in _COLUMNS)

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
        return known[1]

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

    def at(self, rows: Indices) -> Operating:
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
        samples = {name: getattr(self, name)[rows] for name in _COLUMNS}
        run = None if self.shaft.run is None else self.shaft.run[rows]
        behind = None if self.shaft.behind_nm is None else self.shaft.behind_nm[rows]
        age_s = None if self.shaft.age_s is None else self.shaft.age_s[rows]
        return replace(
            self,
            **samples,
            shaft=replace(self.shaft, run=run, behind_nm=behind, age_s=age_s, finer=1),
            supply=replace(self.supply, volts_v=None),
            psi_wb=None,
            torque_em_nm=None,
            drag_nm=0.0,
            cache={},
        )

    def sampled(self) -> Operating:
        """The state at the samples [n] where it has more points than these; else itself."""
        points = self.shaft.finer
        return self if points == 1 else self.at(np.arange(0, self.theta_rad.size, points))

    @property
    def point_s(self) -> float:
        """Time from point to point [s]."""
        return self.ts_s / self.shaft.finer

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
    analysed
        Whether the voltages beside it are measured, so that an analyser may have recorded all of
        them with sensors of its own.

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
    analysed: bool = False

    def by_drive(self, q: Values) -> bool:
        """Whether an error of a drive's own sensors is in these currents.

        Parameters
        ----------
        q
            Of the effect; with `alone` the currents beside measured voltages are an analyser's.

        """
        return self.inverter and not (self.analysed and q["alone"])

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
        Samples [N], real or complex; or several such signals [..., N].
    at
        Places [n] in samples from the first; clipped to the record.

    Returns
    -------
    array [n] or [..., n]
        Through two samples by a cubic whose slopes there are the central differences.

    References
    ----------
    Catmull and Rom, A class of local interpolating splines, in Computer Aided Geometric Design,
    Academic Press, 1974.

    """
    last = signal.shape[-1] - 1
    place = np.clip(at, 0.0, float(last))
    first = np.minimum(place.astype(np.int64), max(last - 1, 0))
    part = place - first
    points = [signal.take(first + k, axis=-1, mode="clip") for k in (-1, 0, 1, 2)]
    before, left, right, after = points
    bend = 2.0 * before - 5.0 * left + 4.0 * right - after
    twist = 3.0 * (left - right) + after - before
    return left + 0.5 * part * (right - before + part * (bend + part * twist))


Values = Mapping[str, float]
Signals = Mapping[str, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Noted(Mapping[str, float]):
    """Values that note which of them are read.

    Attributes
    ----------
    plain
        The values.
    read
        Names that were read, each after the `stem`.
    stem
        What goes before the names: of the short names of an effect, `effect.`.

    """

    plain: Values
    read: set[str]
    stem: str = ""

    def __getitem__(self, name: str) -> float:
        """The value of a name, which counts as read."""
        self.read.add(self.stem + name)
        return self.plain[name]

    def __iter__(self) -> Iterator[str]:
        """The names."""
        return iter(self.plain)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.plain)
