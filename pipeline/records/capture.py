"""A capture: one test of one motor on one bench, as it came off the disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.records.parse import number

if TYPE_CHECKING:
    import polars as pl

Integrity = Literal["verified", "unverified"]
VoltageTiming = Literal["instant", "held", "centred"]
VoltageKind = Literal["measured", "commanded"]
Array = NDArray[np.float64]


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
    """The metadata of `contract/capture.md`, parsed; keys it does not know are in `extra`."""

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
    voltage_kind: VoltageKind = "measured"
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
        """Standard uncertainty of an instrument, a key of UNSTATED_U; its default if not stated."""
        stated: float | None = getattr(self, key)
        return UNSTATED_U[key] if stated is None else stated

    def stated_u_rel(self, key: str) -> float | None:
        """A relative standard uncertainty, 0 to 1, under a key of `extra`; None without one."""
        found = number(self.extra.get(key, ""))
        return found if found is not None and 0.0 <= found <= 1.0 else None


@dataclass(frozen=True, slots=True)
class Mask:
    """Rows of one table that a gate set aside: True is kept. Every mask is kept and counted."""

    gate: str
    table: int
    keep: NDArray[np.bool_]

    @property
    def dropped(self) -> int:
        """How many rows the gate set aside."""
        return int(self.keep.size - np.count_nonzero(self.keep))


@dataclass(frozen=True, slots=True)
class Capture:
    """Tables of one clock each, columns named by the glossary, float64, NaN where missing.

    `path` is relative to the input folder with forward slashes. Streams of different rates are
    different tables; `arrays` puts the columns asked for on one clock.
    """

    path: str
    sha256: str
    integrity: Integrity
    meta: CaptureMeta
    tables: tuple[pl.DataFrame, ...]
    masks: tuple[Mask, ...] = ()

    @property
    def columns(self) -> frozenset[str]:
        """Every column that some table holds."""
        return frozenset(name for table in self.tables for name in table.columns)

    def has(self, *names: str) -> bool:
        """Whether all the columns are there."""
        return self.columns.issuperset(names)

    def with_masks(self, *masks: Mask) -> Capture:
        """This capture with further masks."""
        return replace(self, masks=self.masks + masks)

    def kept(self, table: int) -> NDArray[np.bool_]:
        """Rows [n] of a table that every mask keeps."""
        keep = np.ones(self.tables[table].height, dtype=bool)
        for mask in self.masks:
            if mask.table == table:
                keep &= mask.keep
        return keep

    def table_of(self, *names: str) -> int:
        """Index of the table that holds most of `names`, the longest where several do.

        Raises KeyError where no table holds any.
        """
        counts = [len(set(names) & set(table.columns)) for table in self.tables]
        if not counts or max(counts) == 0:
            raise KeyError(f"{self.path} holds none of {', '.join(names)}")
        best = max(counts)
        heights = [t.height if c == best else -1 for t, c in zip(self.tables, counts, strict=True)]
        return int(np.argmax(heights))

    def arrays(self, *names: str, masked: bool = True) -> dict[str, Array]:
        """The columns on one clock [n each], masked rows removed unless `masked` is False.

        The clock is that of `table_of(*names)`; columns of other tables are interpolated
        linearly onto it and are NaN outside their own span. Raises KeyError for a column that
        no table holds.
        """
        home = self.table_of(*names)
        keep = self.kept(home) if masked else np.ones(self.tables[home].height, dtype=bool)
        out = {}
        for name in names:
            out[name] = self._on_clock(name, home)[keep]
        return out

    def _on_clock(self, name: str, home: int) -> Array:
        table = self.tables[home]
        if name in table.columns:
            column: Array = table[name].to_numpy().astype(np.float64, copy=False)
            return column
        for index, other in enumerate(self.tables):
            if name in other.columns and "t_s" in other.columns and "t_s" in table.columns:
                keep = self.kept(index) & np.isfinite(other[name].to_numpy())
                if not keep.any():
                    return np.full(table.height, np.nan)
                moved: Array = np.interp(
                    table["t_s"].to_numpy(),
                    other["t_s"].to_numpy()[keep],
                    other[name].to_numpy()[keep],
                    left=np.nan,
                    right=np.nan,
                )
                return moved
        raise KeyError(f"{self.path} holds no column {name}")


@dataclass(frozen=True, slots=True)
class Campaign:
    """All captures of one motor, of whatever day and bench, sorted by path.

    `stated` are constants that the configuration states, with `u_NAME` their uncertainties.
    """

    motor_id: str
    captures: tuple[Capture, ...]
    stated: Mapping[str, float] = field(default_factory=dict)

    def of(self, *tests: str) -> tuple[Capture, ...]:
        """The captures of these tests, in path order."""
        return tuple(c for c in self.captures if c.meta.test in tests)

    def nameplate(self, key: str) -> object | None:
        """The most frequent value of a metadata key (`pole_pairs`, ...), the first of equals.

        None where no capture states the key.
        """
        stated = [getattr(c.meta, key) for c in self.captures]
        counts = Counter(value for value in stated if value is not None)
        return max(counts, key=counts.__getitem__, default=None)

    def text(self, key: str) -> str | None:
        """What `nameplate` says of a key, as text."""
        stated = self.nameplate(key)
        return None if stated is None else str(stated)
