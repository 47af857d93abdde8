"""Options of plug-ins as the configuration gives them: refused where they cannot be meant."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from pipeline.physics.glossary import CONSTANTS
from pipeline.records.errors import UsageError
from pipeline.records.stated import may_be_stated, number_wanted
from pipeline.settings import RunSettings

KINDS = {"fit": "estimator", "gates": "gate", "crosscheck": "check"}
SHARES = ("share", "correlation")
CHANCES = ("level", "chance")
ABSOLUTE_ZERO_DEGC = -273.15

Known = Mapping[str, Mapping[str, float]]


def check_options(settings: RunSettings) -> None:
    """Refuses options of plug-ins and stated constants that do not exist or cannot be meant.

    Parameters
    ----------
    settings
        Options by the name of an estimator, a gate or a check, and stated constants [SI].

    Raises
    ------
    UsageError
        No such plug-in, option or constant, or a value that it cannot take; the remedy names the
        ones there are.

    """
    check_constants(settings.constants)
    if not (settings.fit or settings.gates or settings.crosscheck):
        return
    from pipeline.contracts.registry import gates
    from pipeline.crosscheck.registry import rules
    from pipeline.estimation.policy import changed
    from pipeline.estimation.registry import estimators

    changed(settings.fit)
    fits = {name: given for name, given in settings.fit.items() if name != "policy"}
    _check("fit", fits, {e.name: e.options for e in estimators()})
    _check("gates", settings.gates, {g.name: g.settings() for g in gates()})
    _check("crosscheck", settings.crosscheck, {r.name: r.options for r in rules()})


def names_of(effects: Sequence[str]) -> list[str]:
    """The names of effects that a caller gives.

    Parameters
    ----------
    effects
        Names of effects.

    Raises
    ------
    UsageError
        One text, which would be taken letter by letter.

    """
    if isinstance(effects, str):
        raise UsageError(f"effects={effects!r} is no list", f"write effects=[{effects!r}]")
    return list(effects)


def check_constants(stated: Mapping[str, Any]) -> None:
    """Refuses a stated constant that there is not, and a value that it cannot have.

    Parameters
    ----------
    stated
        Values [the constant's unit] by `NAME`, their standard uncertainties by `u_NAME`.

    Raises
    ------
    UsageError
        No such constant can be stated, a value is no number or out of the glossary's range, or an
        uncertainty is below 0 or of no stated constant.

    """
    for key, value in stated.items():
        name = key.removeprefix("u_")
        if not may_be_stated(name):
            near = get_close_matches(name, filter(may_be_stated, CONSTANTS), 3)
            hint = f"did you mean {', '.join(near)}?" if near else "docs/glossary.md lists them"
            raise UsageError(f"constants.{key}: no constant {name!r} can be stated", hint)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if words := number_wanted(key, value if number else None):
            raise UsageError(f"constants.{key}={value} is no {words}", "write one, or leave it out")
        if key != name and name not in stated:
            raise UsageError(f"constants.{key} is of no stated constant", f"state {name} as well")


def _check(group: str, given: Mapping[str, Any], known: Known) -> None:
    for name, options in given.items():
        if name not in known:
            raise UsageError(
                f"{group}.{name}: no such {KINDS[group]}", f"one of {', '.join(known)}"
            )
        has = ", ".join(known[name]) or "none"
        if not isinstance(options, Mapping):
            raise UsageError(
                f"{group}.{name}={options}: {name} is no option but has some",
                f"write {group}.{name}.OPTION=number; it has {has}",
            )
        for option, value in options.items():
            if option not in known[name]:
                raise UsageError(f"{group}.{name}.{option}: no such option", f"it has {has}")
            wanted = allowed(option, value, known[name][option])
            if wanted is not None:
                usual = f"{known[name][option]:g} is usual"
                raise UsageError(
                    f"{group}.{name}.{option}={value} is not {wanted}", f"give such a one; {usual}"
                )


def allowed(option: str, value: Any, default: float) -> str | None:
    """What values an option takes, in words; None where the given value is one of them.

    Parameters
    ----------
    option
        Name of the option. Its ending says what the number is: `share` and `correlation` lie from 0
        to 1, `level` and `chance` strictly between, `_degc` above absolute zero.
    value
        What the configuration gives.
    default
        The option's usual value [unit of the option]. Where it is not negative, no value may be: it
        is a size or a count.

    Returns
    -------
    str or None
        The rest of the sentence "is not ...", or None.

    """
    number = isinstance(value, (int, float)) and math.isfinite(value)
    if option == "enabled":
        return None if number and value in (0, 1) else "1 or 0"
    if not number or isinstance(value, bool):
        return "a number"
    if option.endswith(SHARES):
        return None if 0.0 <= value <= 1.0 else "a number from 0 to 1"
    if option.endswith(CHANCES):
        return None if 0.0 < value < 1.0 else "a number between 0 and 1"
    if option.endswith("_degc"):
        return None if value > ABSOLUTE_ZERO_DEGC else f"above {ABSOLUTE_ZERO_DEGC} degC"
    return None if default < 0.0 or value >= 0.0 else "a number of 0 or more"
