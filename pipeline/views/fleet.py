"""All motors beside each other: key constants on one scale each, and every reason stated once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from pipeline.physics.notation import Reading, Scale, reading, scale_for
from pipeline.records.current_status import CurrentStatus, current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import MODEL_REASON, number
from pipeline.views.constants import KEY_CONSTANTS, PARTIAL_CONSTANTS, constant_words, symbol
from pipeline.views.model_words import ModelWords, model_words
from pipeline.views.names import in_words, quantity_words
from pipeline.views.reasons import Reason, shared_reasons
from pipeline.views.status_text import status_lines

STATUS_ORDER = ("refused", "revoked", "provisional", "released")


@dataclass(frozen=True, slots=True)
class Column:
    """One constant across all motors, on one scale."""

    name: str
    symbol: tuple[str, str]
    words: str
    scale: Scale

    @property
    def unit(self) -> str:
        """The unit that all its numbers are shown in."""
        return self.scale.unit


@dataclass(frozen=True, slots=True)
class Cell:
    """One constant of one motor; `reading` is None where it has no value."""

    reading: Reading | None
    sort: str


@dataclass(frozen=True, slots=True)
class MotorRow:
    """One line of the table; `why` are the motor's own reasons, `shared` numbers of the others."""

    sheet: Datasheet
    current: CurrentStatus
    why: str
    shared: tuple[int, ...]
    failed: tuple[tuple[str, str], ...]
    model: ModelWords
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class FleetView:
    """Motors in order of their ids; `reasons` that more than one has, the commonest first."""

    columns: tuple[Column, ...]
    rows: tuple[MotorRow, ...]
    reasons: tuple[Reason, ...]
    counts: tuple[tuple[str, int], ...]


def fleet_view(
    datasheets: Sequence[Datasheet], statuses: Mapping[str, CurrentStatus] | None = None
) -> FleetView:
    """The view of all motors, whatever order they come in.

    Parameters
    ----------
    datasheets
        The datasheets of the batch.
    statuses
        Current status of each motor; None for what each datasheet states of itself.

    """
    sheets = sorted(datasheets, key=lambda sheet: sheet.motor_id)
    now = [(statuses or {}).get(sheet.motor_id, current_status(sheet)) for sheet in sheets]
    columns = _columns(KEY_CONSTANTS, sheets) or _columns(PARTIAL_CONSTANTS, sheets)
    reasons = shared_reasons(
        (sheet.motor_id, kind_of_reason(sheet, reason))
        for sheet, current in zip(sheets, now, strict=True)
        for reason in current.why
    )
    counts: Counter[str] = Counter(current.status for current in now)
    return FleetView(
        columns,
        tuple(_row(*one, columns, reasons) for one in zip(sheets, now, strict=True)),
        reasons,
        tuple((status, counts[status]) for status in STATUS_ORDER if counts[status]),
    )


def _columns(names: Sequence[str], sheets: Sequence[Datasheet]) -> tuple[Column, ...]:
    """A column for each of some constants that any motor has."""
    return tuple(
        Column(name, symbol(name), constant_words(name), scale)
        for name in names
        if (scale := _scale(name, sheets)) is not None
    )


def known_estimates(name: str, sheets: Sequence[Datasheet]) -> list[Estimate]:
    """The estimates of a constant that have a value.

    Parameters
    ----------
    name
        Name of the constant.
    sheets
        The datasheets.

    """
    estimates = (sheet.constants.get(name) for sheet in sheets)
    return [estimate for estimate in estimates if estimate is not None and estimate.known]


def _scale(name: str, sheets: Sequence[Datasheet]) -> Scale | None:
    """One power of ten for a constant of all motors; None where no motor has it."""
    known = known_estimates(name, sheets)
    if not known:
        return None
    return scale_for(median(abs(estimate.number) for estimate in known), known[0].unit)


def _row(
    sheet: Datasheet, current: CurrentStatus, columns: Sequence[Column], reasons: Sequence[Reason]
) -> MotorRow:
    failed = tuple((c.name, c.status) for c in sheet.checks if c.status in ("fail", "marginal"))
    common = {reason.text: number for number, reason in enumerate(reasons, 1)}
    kinds = [(reason, kind_of_reason(sheet, reason)) for reason in current.why]
    own = [in_words(_less_badge(reason, failed)) for reason, kind in kinds if kind not in common]
    return MotorRow(
        sheet,
        current,
        "; ".join((*status_lines(current), *own)),
        tuple(sorted({common[kind] for _, kind in kinds if kind in common})),
        failed,
        model_words(sheet.model, sheet.motor_id),
        tuple(_cell(sheet.constants.get(column.name), column.scale) for column in columns),
    )


def _less_badge(reason: str, failed: Sequence[tuple[str, str]]) -> str:
    """A failed check's reason without the name that the check's badge shows beside it."""
    for name, _ in failed:
        reason = reason.removeprefix(f"check {name} failed: ")
    return reason


def _cell(estimate: Estimate | None, scale: Scale) -> Cell:
    if estimate is None or not estimate.known:
        return Cell(None, "")
    shown = reading(estimate.number, estimate.u, estimate.unit, scale)
    return Cell(shown, repr(estimate.number))


def kind_of_reason(sheet: Datasheet, reason: str) -> str:
    """The reason less what is the motor's own: the capture and the size of what a model misses.

    Parameters
    ----------
    sheet
        The datasheet.
    reason
        The reason, as the datasheet has it.

    """
    model = sheet.model
    if not reason.startswith(MODEL_REASON) or model is None or model.worst is None:
        return reason
    if model.missing:
        names = " and ".join(name.replace("_", " ") for name in model.missing)
        return f"{model.name} lacks {names}"
    order = f", {model.worst.order:g} a turn" if model.worst.order else ""
    return f"{model.name} misses {quantity_words(model.worst.signal)}{order}"


def lacking_alike(datasheets: Sequence[Datasheet]) -> list[list[Datasheet]]:
    """The motors whose model was tested and not passed, by what it lacks; the largest group first,
    in it the motor with the largest error.

    Parameters
    ----------
    datasheets
        The datasheets of the batch.

    """
    groups: dict[str, list[Datasheet]] = {}
    for sheet in datasheets:
        model = sheet.model
        if model is not None and model.tested and not model.passed:
            kind = kind_of_reason(sheet, f"{MODEL_REASON}{model.headline()}")
            groups.setdefault(kind, []).append(sheet)
    ordered = sorted(groups.values(), key=lambda group: -len(group))
    return [sorted(group, key=_error, reverse=True) for group in ordered]


def _error(sheet: Datasheet) -> float:
    return 0.0 if sheet.model is None else sheet.model.held_out or sheet.model.residual or 0.0


def floors_of(reason: Reason, rows: Sequence[MotorRow]) -> str:
    """The error of models that lack the same effects, or how far the same signal is over its floor;
    empty for a reason that is not a model's.

    Parameters
    ----------
    reason
        The reason with its motors.
    rows
        Rows of the table of motors.

    """
    own = [row for row in rows if row.sheet.motor_id in reason.members]
    models = [
        row.sheet.model
        for row in own
        if row.sheet.model is not None and reason.text.startswith(row.sheet.model.name)
    ]
    named = all(model.missing for model in models)
    sizes = [
        model.held_out if named else model.worst.floors if model.worst else None for model in models
    ]
    known = [number(size) for size in sorted(size for size in sizes if size is not None)]
    if not own or len(known) < len(own):
        return ""
    span = " to ".join(dict.fromkeys((known[0], known[-1])))
    return f"{'with an error of' if named else 'by'} {span} noise floors"
