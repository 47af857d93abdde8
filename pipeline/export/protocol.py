"""What an exporter is, and what it may take from a datasheet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pipeline.physics.glossary import CONSTANTS, Term
from pipeline.records.datasheet import Datasheet
from pipeline.records.effect_table import EffectTable, EffectTables
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import Parameters

USABLE = ("measured", "derived")
Options = Mapping[str, str]
Values = dict[str, float]


@dataclass(frozen=True, slots=True)
class Source:
    """A released datasheet on its way out: what it says, its revision, constants' own terms, and
    what the effects that are known of the motor add to it, as tables.

    Attributes
    ----------
    sheet, revision
        The datasheet and its revision.
    terms
        Names of constants, those of further estimators too.
    effects
        What known effects of the motor add to it, as tables.

    """

    sheet: Datasheet
    revision: int
    terms: Mapping[str, Term] = field(default_factory=lambda: dict(CONSTANTS))
    effects: EffectTables = field(default_factory=EffectTables)

    def estimate(self, name: str) -> Estimate:
        """A constant that may be exported.

        Parameters
        ----------
        name
            Glossary name.

        Raises
        ------
        UsageError
            It is missing, assumed or not identifiable, or its convention is not known: not in the
            glossary, or in another unit.

        """
        constant = self.optional(name)
        if constant is None:
            estimate = self.sheet.constants.get(name)
            status = "missing" if estimate is None else estimate.status
            note = "" if estimate is None or not estimate.note else f" ({estimate.note})"
            raise UsageError(
                f"motor {self.sheet.motor_id!r}: {name} is {status}{note}",
                "an export holds measured and derived constants only",
            )
        return constant

    def optional(self, name: str) -> Estimate | None:
        """A constant where it may be exported, else None; raises UsageError as `estimate` does
        for an unknown convention.

        Parameters
        ----------
        name
            Glossary name.

        Returns
        -------
        Estimate or None
            None where it is missing, assumed or not identifiable.

        Raises
        ------
        UsageError
            Its convention is not known.

        """
        estimate = self.sheet.constants.get(name)
        if estimate is None:
            return None
        term = self.terms.get(name)
        if term is None or term.unit != estimate.unit:
            reason = "is not in the glossary" if term is None else f"is stated in {estimate.unit}"
            raise UsageError(
                f"motor {self.sheet.motor_id!r}: the convention of {name} is unknown, it {reason}",
                "rename it to a name of docs/glossary.md, which says peak or rms, phase or line",
            )
        return estimate if estimate.known and estimate.status in USABLE else None

    def value(self, name: str) -> float:
        """The value of a constant in the glossary's unit and convention.

        Parameters
        ----------
        name
            Glossary name; errors are those of `estimate`.

        """
        return self.estimate(name).number

    def all(self) -> list[Estimate]:
        """Every constant that may be exported, by name; raises as `optional` does."""
        estimates = (self.optional(name) for name in sorted(self.sheet.constants))
        return [estimate for estimate in estimates if estimate is not None]

    def sizes(self) -> Mapping[str, Parameters]:
        """Parameters of the effects that are known of the motor, asked for or found."""
        return {} if self.sheet.model is None else self.sheet.model.sizes

    def effect_parameters(self) -> list[tuple[str, float, float, str]]:
        """Every known parameter: effect and parameter joined by a low line, value, u and unit."""
        return [
            (f"{effect}_{name}", value, u or 0.0, unit)
            for effect, parameters in self.sizes().items()
            for name, (value, u, unit) in parameters.items()
            if value is not None
        ]

    def left_out(self, *held: str) -> tuple[str, ...]:
        """Effects that a format cannot hold, with the reason.

        Parameters
        ----------
        *held
            Effects that it does hold.

        """
        every = dict.fromkeys(self.sizes(), "the format has no place for it")
        every |= self.effects.without
        return tuple(f"{name}: {why}" for name, why in every.items() if name not in held)

    def tables(self, variable: str) -> list[EffectTable]:
        """Tables of the effects over one variable.

        Parameters
        ----------
        variable
            Glossary name.

        """
        return [one for one in self.effects.tables if variable in one.variables]

    def heading(self) -> list[str]:
        """Lines that say what this is, free of anything that would end a comment."""
        sheet = self.sheet
        own = (
            f"motor {sheet.motor_id}, type {sheet.motor_type or 'not stated'}",
            f"datasheet revision {self.revision}, version {sheet.version}, released",
            "resistance and magnet flux at 25 degC; not a calibration certificate",
        )
        return [plain(line) for line in own]


@dataclass(frozen=True, slots=True)
class Exporter:
    """One format.

    Attributes
    ----------
    name, extension, words
        Name, file extension and description.
    render
        Text of a datasheet.
    read
        The constants back out of such a text, in the glossary's names, units and conventions,
        whatever the receiver's are.
    options
        Options with their description.
    omits
        Effects of a datasheet that the format cannot hold.

    """

    name: str
    extension: str
    words: str
    render: Callable[[Source, Options], str]
    read: Callable[[str], Values]
    options: Mapping[str, str] = field(default_factory=dict)
    omits: Callable[[Source], tuple[str, ...]] = Source.left_out


def no_effect_omitted(source: Source) -> tuple[str, ...]:
    """Of a format that holds every parameter of every effect: nothing.

    Parameters
    ----------
    source
        The datasheet.

    """
    del source
    return ()


def plain(text: str) -> str:
    """The text as a comment may hold it in C, XML, shell or CSV: printable, no comment's end.

    Parameters
    ----------
    text
        Any text.

    """
    shown = "".join(char if char.isprintable() else " " for char in text)
    for ending in ("*/", "--", "\\"):
        shown = shown.replace(ending, " ")
    return shown.rstrip("-")


def number_option(options: Options, name: str) -> float | None:
    """An option as a positive number.

    Parameters
    ----------
    options
        Options as texts.
    name
        Name of the option.

    Returns
    -------
    float or None
        None where it is not given.

    Raises
    ------
    UsageError
        It is no positive number.

    """
    if name not in options:
        return None
    try:
        value = float(options[name])
    except ValueError:
        value = -1.0
    if not 0.0 < value < float("inf"):
        raise UsageError(f"options.{name}={options[name]} is no positive number", "correct it")
    return value
