"""A capture: one test of one motor on one bench, as it came off the disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.records.parse import number
from pipeline.records.row_means import bridged, curve_between, row_means, slower_rows

if TYPE_CHECKING:
    import polars as pl

Integrity = Literal["verified", "unverified"]
VoltageTiming = Literal["instant", "held", "centred"]
VoltageKind = Literal["measured", "commanded"]
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

_DQ_CURRENTS = ("id_a", "iq_a")
_CONTINUOUS = ("drive", "torque_map", "spin_down", "heat_run")
"""Logs of signals that change little from row to row."""
_ALTERNATING = frozenset(
    name for line in ("a", "b", "c", "ab", "bc", "ca") for name in (f"v{line}_v", f"i{line}_a")
)
"""Columns that go through zero twice an electrical turn."""


U_ZERO = "u_zero_angle_rad"
"""Key of the standard uncertainty of a rotor frame's zero [rad] that voltages show."""
# Standard uncertainty (k=1) of an instrument that states none, by metadata key: a gain [1] of a
# percent, a thermometer [K] of two kelvin, a time base of 100 ppm: crystals are cut to 20 to 50 ppm
# at 25 degC and drift as much again over temperature and age (Vig, Quartz Crystal Resonators and
# Oscillators, SLCET-TR-88-1). What is stated counts as stated, 0 too.
UNSTATED_U: Mapping[str, float] = {
    "u_rel_current": 0.01,
    "u_rel_voltage": 0.01,
    "u_rel_torque": 0.01,
    "u_temp_degc": 2.0,
    "u_rel_clock": 1e-4,
}


@dataclass(frozen=True, slots=True)
class CaptureMeta:
    """The metadata of one capture, as `contract/capture.md` has it, parsed.

    Attributes
    ----------
    motor_id, motor_type, lot
        Serial number, design, and production lot.
    test
        One of the glossary's tests.
    station, operator, started_at
        Bench, person, and ISO 8601 time in UTC.
    winding
        `wye` or `delta`, as the nameplate says.
    pole_pairs, slots
        Of the nameplate [1].
    ambient_degc
        Ambient temperature [degC].
    pair
        `ab`, `bc` or `ca`: the terminals of a two-terminal test.
    theta_elec_deg
        Electrical angle at which the rotor is locked [deg].
    voltage_kind
        Whether voltages are `measured` or the inverter's `commanded` ones; None where not stated,
        which is not taken as measured.
    voltage_timing
        Whether a voltage sample is of its `instant`, `held` for the period that follows, or
        `centred` on it.
    pwm_hz
        Switching frequency [Hz].
    vdc_v
        Voltage of the DC link [V].
    u_rel_current, u_rel_voltage, u_rel_torque, u_rel_clock
        Relative standard uncertainty (k = 1) of a gain or the time base [1]; None where not stated.
    u_temp_degc
        Standard uncertainty of temperatures [K].
    pause_s
        The recorder paused where its clock steps by more [s].
    sha256_rows
        Digest and count of the rows of a CSV.
    extra
        Every other key of the file, as text.

    """

    motor_id: str
    test: str
    motor_type: str | None = None
    lot: str | None = None
    station: str | None = None
    operator: str | None = None
    started_at: str | None = None
    winding: str | None = None
    pole_pairs: int | None = None
    slots: int | None = None
    ambient_degc: float | None = None
    pair: str | None = None
    theta_elec_deg: float | None = None
    voltage_kind: VoltageKind | None = None
    voltage_timing: VoltageTiming = "instant"
    pwm_hz: float | None = None
    vdc_v: float | None = None
    u_rel_current: float | None = None
    u_rel_voltage: float | None = None
    u_rel_torque: float | None = None
    u_temp_degc: float | None = None
    u_rel_clock: float | None = None
    pause_s: float | None = None
    sha256_rows: str | None = None
    extra: Mapping[str, str] = field(default_factory=dict)

    def instrument_u(self, key: str) -> float:
        """Standard uncertainty of an instrument, its default where the capture states none.

        Parameters
        ----------
        key
            A key of `UNSTATED_U`.

        Returns
        -------
        float
            k = 1, relative [1] for gains and the time base, [K] for temperatures. What is stated
            counts as stated, 0 too.

        """
        stated: float | None = getattr(self, key)
        return UNSTATED_U[key] if stated is None else stated

    def stated_u_rel(self, key: str) -> float | None:
        """A relative standard uncertainty, 0 to 1, under a key of `extra`; None without one.

        Parameters
        ----------
        key
            A key of `extra`.

        Returns
        -------
        float or None
            From 0 to 1; None where there is no such key or its text is no such number.

        """
        stated = number(self.extra.get(key, ""))
        return stated if stated is not None and 0.0 <= stated <= 1.0 else None


@dataclass(frozen=True, slots=True)
class Mask:
    """Rows of one table that a gate set aside; every mask is kept and counted.

    Attributes
    ----------
    gate
        Name of the gate.
    table
        Index of the table in the capture.
    keep
        True [n] for a row that is kept.

    """

    gate: str
    table: int
    keep: NDArray[np.bool_]

    @property
    def dropped(self) -> int:
        """How many rows the gate set aside."""
        return int(self.keep.size - np.count_nonzero(self.keep))


@dataclass(frozen=True, slots=True)
class Capture:
    """One test of one motor: tables of one clock each, columns named by the glossary.

    Streams of different rates are different tables; `arrays` puts the columns asked for on one
    clock.

    Attributes
    ----------
    path
        Relative to the input folder, with forward slashes.
    sha256
        Digest of the file's bytes, in hexadecimal.
    integrity
        `verified` where the file carries a checksum that holds, else `unverified`.
    meta
        What the file says of the test.
    tables
        Columns in float64 and SI units, NaN where a value is missing.
    masks
        Rows that gates set aside.

    """

    path: str
    sha256: str = field(repr=False)
    integrity: Integrity
    meta: CaptureMeta
    tables: tuple[pl.DataFrame, ...] = field(repr=False)
    masks: tuple[Mask, ...] = field(default=(), repr=False)

    @property
    def columns(self) -> frozenset[str]:
        """Every column that some table holds."""
        return frozenset(name for table in self.tables for name in table.columns)

    @property
    def turning(self) -> bool:
        """Whether a speed is logged that is not zero."""
        speed = "omega_mech_rad_s"
        return self.has(speed) and bool(np.any(np.nan_to_num(self.arrays(speed)[speed])))

    def has(self, *names: str) -> bool:
        """Whether every one of some columns is in some table.

        Parameters
        ----------
        *names
            Names of the glossary.

        """
        return self.columns.issuperset(names)

    def with_masks(self, *masks: Mask) -> Capture:
        """This capture with further masks; its tables are shared, not copied.

        Parameters
        ----------
        *masks
            Each for one of the tables.

        """
        return replace(self, masks=self.masks + masks)

    def kept(self, table: int) -> Flags:
        """Rows of a table that every mask keeps.

        Parameters
        ----------
        table
            Index of the table.

        Returns
        -------
        array [n] of bool
            True for a row to use.

        """
        keep = np.ones(self.tables[table].height, dtype=bool)
        for mask in self.masks:
            if mask.table == table:
                keep &= mask.keep
        return keep

    def table_of(self, *names: str) -> int:
        """The table on whose clock some columns are best seen.

        Parameters
        ----------
        *names
            Names of the glossary.

        Returns
        -------
        int
            Index in `tables`: of the one that holds most of the columns that alternate, voltages
            and currents of lines and phases, then most of all; the longest where several do.
            Straight lines between samples take a part of a wave away, of an angle nothing.

        Raises
        ------
        KeyError
            No table holds any of them.

        """
        held = [set(names) & set(table.columns) for table in self.tables]
        if not any(held):
            raise KeyError(f"{self.path} holds none of {', '.join(names)}")
        ranks = [
            (len(columns & _ALTERNATING), len(columns), table.height)
            for columns, table in zip(held, self.tables, strict=True)
        ]
        return ranks.index(max(ranks))

    def arrays(self, *names: str, masked: bool = True) -> dict[str, Array]:
        """Columns on one clock, without the rows that were set aside.

        Parameters
        ----------
        masked
            Whether the rows that gates set aside are left out.
        *names
            Names of the glossary.

        Returns
        -------
        dict of array [n]
            Each column in its unit. The clock is that of `table_of`; columns of other tables are
            interpolated onto it, slower dq currents as `curve_between` does and others linearly,
            from their own unmasked, finite samples, and are NaN outside their own span. Beside
            slower rows that are means (`voltage_timing`) they are means over the row as well, but
            for angles, which have one value at an instant: an oscillation that the rows average out
            is no noise of the other column.

        Raises
        ------
        KeyError
            No table holds one of the columns, or none of them has a clock in common.

        """
        home = self.table_of(*names)
        keep = self.kept(home) if masked else np.ones(self.tables[home].height, dtype=bool)
        return {name: self._on_clock(name, home)[keep] for name in names}

    def on_rows_of(self, home: int) -> Capture:
        """The capture with what faster tables hold on the rows of one, and without these tables.

        Parameters
        ----------
        home
            Number of a table with a clock.

        Returns
        -------
        Capture
            Columns as `arrays` puts them on another clock. The same one where no table is faster.

        """
        import polars as pl

        row_s = self.tables[home]["t_s"].to_numpy()
        faster = [
            place
            for place, table in enumerate(self.tables)
            if "t_s" in table.columns and slower_rows(row_s, table["t_s"].to_numpy())
        ]
        if not faster:
            return self
        names = [name for place in faster for name in self.tables[place].columns if name != "t_s"]
        joined = [pl.Series(name, self._on_clock(name, home)) for name in names]
        tables = [self.tables[home].with_columns(joined)]
        kept = [place for place in range(len(self.tables)) if place not in (home, *faster)]
        places = {place: number for number, place in enumerate([home, *kept])}
        masks = (m for m in self.masks if m.table in places)
        return replace(
            self,
            tables=(*tables, *(self.tables[place] for place in kept)),
            masks=tuple(replace(m, table=places[m.table]) for m in masks),
        )

    def bridged_column(self, index: int, name: str) -> Array:
        """A column of a table, `bridged` in a log of continuous signals.

        Parameters
        ----------
        index
            Number of the table.
        name
            Of the column.

        Returns
        -------
        array [n]
            Waves of the phases, and columns without a clock, as they are.

        """
        table = self.tables[index]
        column = table[name].to_numpy().astype(np.float64, copy=False)
        if self.meta.test not in _CONTINUOUS or name in _ALTERNATING or "t_s" not in table.columns:
            return column
        return bridged(table["t_s"].to_numpy(), column)

    def finite(self, *names: str, needed: Collection[str] = ()) -> dict[str, Array]:
        """Columns on a common clock, in the rows in which they are finite.

        Parameters
        ----------
        needed
            Those that must be; empty for all.
        *names
            Names of the glossary.

        Returns
        -------
        dict of array [n]
            By name.

        """
        columns = self.arrays(*names)
        finite = np.all([np.isfinite(columns[name]) for name in needed or names], axis=0)
        return {name: column[finite] for name, column in columns.items()}

    def _on_clock(self, name: str, home: int) -> Array:
        table = self.tables[home]
        if name in table.columns:
            return self.bridged_column(home, name)
        for index, other in enumerate(self.tables):
            if name in other.columns and "t_s" in other.columns and "t_s" in table.columns:
                keep = self.kept(index) & np.isfinite(other[name].to_numpy())
                if not keep.any():
                    return np.full(table.height, np.nan)
                row_s, sample_s = table["t_s"].to_numpy(), other["t_s"].to_numpy()[keep]
                samples = other[name].to_numpy()[keep]
                means = self.meta.voltage_timing == "centred" and not name.startswith("theta_")
                if means and slower_rows(row_s, sample_s):
                    return row_means(row_s, sample_s, samples)
                if name in _DQ_CURRENTS:
                    return curve_between(row_s, sample_s, samples)
                return np.interp(row_s, sample_s, samples, left=np.nan, right=np.nan)
        raise KeyError(f"{self.path} holds no column {name}")


@dataclass(frozen=True, slots=True, repr=False)
class Campaign:
    """All captures of one motor, of whatever day and bench.

    Attributes
    ----------
    motor_id
        Serial number.
    captures
        Sorted by path.
    stated
        Constants [SI] that the configuration states, with `u_NAME` their standard uncertainties.

    """

    motor_id: str
    captures: tuple[Capture, ...]
    stated: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """The motor, and how many captures there are of each test."""
        tests = Counter(capture.meta.test for capture in self.captures)
        counts = ", ".join(f"{count} {test}" for test, count in sorted(tests.items()))
        return f"Campaign({self.motor_id!r}, captures: {counts or 'none'})"

    def of(self, *tests: str) -> tuple[Capture, ...]:
        """The captures of some tests, in the order of their paths.

        Parameters
        ----------
        *tests
            Names of tests.

        """
        return tuple(c for c in self.captures if c.meta.test in tests)

    def nameplate(self, key: str) -> object | None:
        """What most captures state under a metadata key.

        Parameters
        ----------
        key
            A field of `CaptureMeta`, such as `pole_pairs`.

        Returns
        -------
        object or None
            The most frequent value, the first of equals; None where no capture states the key.

        """
        stated = [getattr(c.meta, key) for c in self.captures]
        counts = Counter(value for value in stated if value is not None)
        return max(counts, key=counts.__getitem__, default=None)

    def text(self, key: str) -> str | None:
        """What `nameplate` gives for a key, as text; None where no capture states it.

        Parameters
        ----------
        key
            A field of `CaptureMeta`.

        """
        stated = self.nameplate(key)
        return None if stated is None else str(stated)
