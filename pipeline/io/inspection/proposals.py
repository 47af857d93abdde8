"""What every field of a table probably is, from its name and its numbers, and what must be asked.

A unit that neither the name nor the numbers give is asked for and never assumed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.io.inspection.evidence import Evidence, gather
from pipeline.io.inspection.labels import Label, known_unit, read_label, words_of
from pipeline.io.inspection.parts import PartSeen
from pipeline.io.inspection.vocabulary import ROW_NUMBERS
from pipeline.io.maps.columns import JOINT_COLUMNS
from pipeline.io.maps.units import COUNTS, FOREIGN_UNITS, normal_unit
from pipeline.io.tables.raw_table import RawTable
from pipeline.physics.glossary import COLUMNS
from pipeline.records.errors import UsageError
from pipeline.records.parse import number

ROWS_LOOKED_AT = 100_000
NONE = "none"
_WITHIN = 0.02
_MOST_CLOCK_JITTER = 0.5
_ELECTRICAL = frozenset({"erpm", "elec", "el", "electrical", "elektrisch"})
_ANGLES = ("theta_mech_rad", "theta_elec_rad", "theta_elec_deg")


@dataclass(frozen=True, slots=True)
class FieldSeen:
    """One field: its name, a first value, and the column it is or probably is.

    `unit` is None where the column's own unit is stated by the name, or nothing is known;
    `question` says what must be asked before the field can be used. `why` is the evidence.
    """

    name: str
    first: float | None
    column: str | None = None
    unit: str | None = None
    certain: bool = False
    wraps: float | None = None
    scale: float | None = None
    times: str | None = None
    per_pole_pair: bool = False
    question: tuple[str, str] | None = None
    why: str = ""


@dataclass(frozen=True, slots=True)
class StreamSeen:
    """One table or topic: rows, rate [Hz] (None without a clock), its fields, the `parts` of a log
    that holds several tests, and whether its clock are the stamps of its messages.
    """

    name: str
    encoding: str
    rows: int
    rate_hz: float | None
    fields: tuple[FieldSeen, ...]
    clock: str = ""
    parts: tuple[PartSeen, ...] = ()
    stamped: bool = False

    @property
    def pace(self) -> str:
        """Rate and clock behind a number of rows, as far as they are known."""
        rate = "" if self.rate_hz is None else f", {self.rate_hz:.6g} Hz"
        return f"{rate} ({self.clock})" if self.clock else rate


def answer_key(name: str) -> str:
    """The name of a field as it is written in an answer, such as `unit.Motor_Strom=A`.

    Parameters
    ----------
    name
        Name of the field.

    """
    return re.sub(r"\W+", "_", name).strip("_")


def propose(table: RawTable, answers: Mapping[str, str]) -> tuple[FieldSeen, ...]:
    """The fields of a table, each with the column that it probably is or what must be asked.

    Parameters
    ----------
    table
        The table; its first rows are examined.
    answers
        `column.NAME` and `unit.NAME`.

    Returns
    -------
    tuple of FieldSeen
        One a numeric field.

    Raises
    ------
    UsageError
        An answer cannot be meant.

    """
    rows = {name: values[:ROWS_LOOKED_AT] for name, values in table.fields.items()}
    numeric = {name: values for name, values in rows.items() if values.dtype.kind in "fiub"}
    labels = {name: _label(table, name) for name in numeric}
    times = [name for name, label in labels.items() if label.columns[:1] == ("t_s",)]
    evidence = gather(numeric, times[0] if times else None)
    columns = _columns(
        labels, evidence, answers, logged=table.log_ns is not None and not table.blocks
    )
    proposed = [_seen(name, numeric, labels, columns, evidence, answers) for name in numeric]
    return tuple(_with_units(proposed, labels, evidence, answers))


def _label(table: RawTable, name: str) -> Label:
    """What a field is by its name, without the group that all fields of the table are in."""
    if table.joint_state:
        known = JOINT_COLUMNS.get(name, name if name in COLUMNS else None)
        return Label((known,), exact=True) if known else Label()
    bare = {field: re.split(r"[\[({]", field)[0] for field in table.fields}
    groups = Counter(text.rpartition("/")[0] for text in bare.values() if "/" in text)
    single = next(iter(groups)) + "/" if len(groups) == 1 and max(groups.values()) > 1 else ""
    of = {field: field.removeprefix(single) for field in table.fields}
    return read_label(of[name], dict(table.units).get(name), of.values())


def _columns(
    labels: Mapping[str, Label], evidence: Evidence, answers: Mapping[str, str], *, logged: bool
) -> dict[str, tuple[str, ...]]:
    """Columns that each field may be, after the answers and the evidence.

    `logged`: the file has a clock beside its fields, so that none of them has to be one.
    """
    clocks = {clock.field: clock for clock in evidence.clocks}
    columns: dict[str, tuple[str, ...]] = {}
    for name, label in labels.items():
        answer = answers.get(f"column.{answer_key(name)}")
        if answer is not None:
            if answer != NONE and answer not in COLUMNS:
                remedy = f"write {NONE} or one of {', '.join(COLUMNS)}"
                raise UsageError(f"column.{answer_key(name)}={answer} is no column", remedy)
            columns[name] = () if answer == NONE else (answer,)
        elif len(label.columns) > 1 and name not in clocks:
            columns[name] = tuple(one for one in label.columns if one != "t_s")
        else:
            columns[name] = label.columns
    if not logged and not any(one[:1] == ("t_s",) for one in columns.values()):
        clear = [c for c in evidence.clocks if c.jitter < _MOST_CLOCK_JITTER]
        rows = frozenset(ROW_NUMBERS.split())
        clear = [c for c in clear if rows.isdisjoint(words_of(c.field))]
        free = [c for c in clear if not columns[c.field] and not _is_answered(c.field, answers)]
        if free:
            columns[min(free, key=lambda clock: clock.jitter).field] = ("t_s",)
    answered = frozenset(name for name in columns if _is_answered(name, answers))
    return _from_relations(_of_meter(columns, answered), evidence, answered)


def _of_meter(
    columns: dict[str, tuple[str, ...]], answered: frozenset[str]
) -> dict[str, tuple[str, ...]]:
    """An LCR meter's table has the electrical angle that the rotor is locked at, in degrees."""
    if not any(one[:1] in (("lab_h",), ("rab_ohm",)) for one in columns.values()):
        return columns
    locked = {name for name, one in columns.items() if one[:1] == ("theta_elec_rad",)}
    return columns | dict.fromkeys(locked - answered, ("theta_elec_deg",))


def _is_answered(name: str, answers: Mapping[str, str]) -> bool:
    return f"column.{answer_key(name)}" in answers


def _from_relations(
    columns: dict[str, tuple[str, ...]], evidence: Evidence, answered: frozenset[str]
) -> dict[str, tuple[str, ...]]:
    """Fields of no known name that integrate to an angle, or that a speed integrates to."""
    angle, speed = ("theta_mech_rad",), ("omega_mech_rad_s",)
    used = {one[0] for one in columns.values() if len(one) == 1}
    for relation in evidence.relations:
        if not relation.integral:
            continue
        one, other = columns[relation.field], columns[relation.other]
        if {relation.field, relation.other} & answered:
            continue
        if one == angle and not other and speed[0] not in used:
            columns[relation.other] = speed
            used.add(speed[0])
        elif other == speed and not one and angle[0] not in used:
            columns[relation.field] = angle
            used.add(angle[0])
    return columns


def _seen(
    name: str,
    numeric: Mapping[str, np.ndarray],
    labels: Mapping[str, Label],
    columns: Mapping[str, tuple[str, ...]],
    evidence: Evidence,
    answers: Mapping[str, str],
) -> FieldSeen:
    """A field before its unit is settled."""
    label, options, values = labels[name], columns[name], numeric[name]
    first = float(values[0]) if values.size else None
    seen = FieldSeen(name, first, why=_why(name, evidence, options))
    if not options:
        return seen
    if len(options) > 1:
        text = f"which column {name!r} is: {', '.join(options)}, or {NONE}"
        return replace(seen, question=(f"column.{answer_key(name)}", text))
    electrical = bool(_ELECTRICAL & set(words_of(name))) and options[0] == "omega_mech_rad_s"
    wraps = dict(evidence.wraps).get(name) if options[0] in ("t_s", *_ANGLES) else None
    answered = _is_answered(name, answers)
    return replace(
        seen,
        column=options[0],
        certain=(label.exact or answered) and options[0] in (label.columns or options),
        wraps=wraps,
        per_pole_pair=electrical,
    )


def _why(name: str, evidence: Evidence, options: Sequence[str]) -> str:
    """What the numbers of a field show, in words; only a clock or an angle starts again."""
    may_wrap = not options or options[0] in ("t_s", *_ANGLES)
    wraps = evidence.wraps if may_wrap else ()
    reasons = [f"starts again after {span:g}" for field, span in wraps if field == name]
    for relation in evidence.relations:
        if relation.field == name:
            kind = "the integral of " if relation.integral else ""
            reasons.append(f"is {relation.factor:.6g} times {kind}{relation.other!r}")
    return "; ".join(reasons)


def _with_units(
    seen: list[FieldSeen],
    labels: Mapping[str, Label],
    evidence: Evidence,
    answers: Mapping[str, str],
) -> list[FieldSeen]:
    """The fields with their units: answered, written, or seen in the numbers; else a question."""
    finished: dict[str, FieldSeen] = {}
    used: set[str] = set()
    for field in sorted(seen, key=lambda one: not one.certain):
        if field.column in used:
            words = f"{field.column} is another field already"
            finished[field.name] = replace(field, column=None, why=_joined(field.why, words))
            continue
        if field.column is not None:
            used.add(field.column)
        finished[field.name] = _stated(field, labels[field.name], answers)
    for field in seen:
        one = finished[field.name]
        if one.column is None or one.unit is not None or labels[one.name].exact:
            continue
        factor = _factor_seen(one, finished, evidence, labels)
        unit = None if factor is None else _unit_of(factor, one.column)
        if unit is None and one.column == "t_s":
            unit = _since_1970(one.first)
        question = None if unit else _ask_unit(one, factor)
        finished[one.name] = replace(one, unit=unit, question=question)
    return [finished[field.name] for field in seen]


def _joined(one: str, other: str) -> str:
    return f"{one}; {other}" if one else other


def _stated(field: FieldSeen, label: Label, answers: Mapping[str, str]) -> FieldSeen:
    """The field with the unit that is answered or written."""
    if field.column is None:
        return field
    key = f"unit.{answer_key(field.name)}"
    text = answers.get(key, label.unit_text)
    unit = known_unit(COLUMNS[field.column].unit, text) if text else label.unit
    scale = number(answers.get(f"scale.{answer_key(field.name)}", ""))
    if text and normal_unit(text) == COUNTS and scale:
        return replace(field, unit=COUNTS, scale=scale)
    if key in answers and unit is None:
        known = ", ".join(FOREIGN_UNITS[COLUMNS[field.column].unit])
        raise UsageError(f"{key}={text} is no unit of {field.column}", f"use one of {known}")
    times = answers.get(f"times.{answer_key(field.name)}")
    return replace(field, unit=unit, times=times, scale=scale if times is not None else None)


def _ask_unit(field: FieldSeen, factor: float | None) -> tuple[str, str]:
    target = COLUMNS[field.column or ""].unit
    text = f"the unit of {field.name!r} ({field.column}): {', '.join(FOREIGN_UNITS[target])}"
    if factor is not None:
        text += f"; by the other fields 1 is about {factor:.3g} {target}"
    counts = f", or {COUNTS} with scale.{answer_key(field.name)}= what one is [{target}]"
    return f"unit.{answer_key(field.name)}", text + counts


def _size(field: FieldSeen | None, labels: Mapping[str, Label]) -> float | None:
    """What 1 of a field is in its column's unit, where that is known."""
    if field is None or field.column is None or field.per_pole_pair:
        return None
    if field.unit is None:
        return 1.0 if labels[field.name].exact else None
    if field.scale is not None:
        return field.scale
    return FOREIGN_UNITS[COLUMNS[field.column].unit][field.unit].factor


def _factor_seen(
    field: FieldSeen,
    done: Mapping[str, FieldSeen],
    evidence: Evidence,
    labels: Mapping[str, Label],
) -> float | None:
    """What 1 of a field is by its relation to fields whose unit is known, or None."""
    clock = _size(next((f for f in done.values() if f.column == "t_s"), None), labels)
    for relation in evidence.relations:
        angle, speed = done[relation.field], done[relation.other]
        columns = (angle.column, speed.column)
        if not relation.integral or columns != ("theta_mech_rad", "omega_mech_rad_s"):
            continue
        one, two = _size(angle, labels), _size(speed, labels)
        if field is speed and one and clock:
            return relation.factor * one / clock
        if field is angle and two and clock:
            return two * clock / relation.factor
        if field.column == "t_s" and one and two:
            return relation.factor * one / two
    return None


def _since_1970(first: float | None) -> str | None:
    """The unit of a clock that counts from 1970, by which it shows a year from 2001 to 2065."""
    units = {unit: scale.factor for unit, scale in FOREIGN_UNITS["s"].items() if scale.factor <= 1}
    return next((u for u, s in units.items() if first and 1e9 <= first * s < 3e9), None)


def _unit_of(factor: float, column: str) -> str | None:
    """The unit of a column's dimension of this size, where there is one and one alone."""
    fitting = {
        scale.factor: name
        for name, scale in reversed(FOREIGN_UNITS[COLUMNS[column].unit].items())
        if abs(factor - scale.factor) <= _WITHIN * scale.factor
    }
    return next(iter(fitting.values())) if len(fitting) == 1 else None
