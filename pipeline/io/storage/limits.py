"""Reading `conf/limits/*.yaml`: what a datasheet must hold, and what a lot is held to."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.io.storage.plain_yaml import load_plain
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.limits import RULES, Amount, ConstantLimits, Limits, amount_from, number_from
from pipeline.settings import named_file

KEYS = ("about", "required", "model_gates", "rules", "golden", "constants")
RULE_KEYS = ("alpha", "min_lots", "k", "order_share", "code_negligible", "code_limit")
CONSTANT_KEYS = (
    "nominal",
    "tolerance",
    "minimum",
    "maximum",
    "guard_band",
    "decision_rule",
    "equivalence_margin",
    "decides",
    "tolerate_within_margin",
)
WORDS = {"yes": True, "true": True, "no": False, "false": False}


def limits_file(name: str, config_dir: str | None = None) -> Path:
    """The limits file of a name, or at a path that ends in .yaml.

    Parameters
    ----------
    name
        As the user wrote it.
    config_dir
        Configuration folder that the user names.

    """
    if name.endswith((".yaml", ".yml")) and Path(name).is_file():
        return Path(name)
    return named_file("limits", name, config_dir)


def required_constants(path: Path) -> tuple[str, ...]:
    """The constants that a release must hold, measured.

    Parameters
    ----------
    path
        The limits file.

    """
    return _required(_document(path), path)


def release_conditions(path: Path) -> tuple[tuple[str, ...], bool]:
    """What a release of a datasheet depends on.

    Parameters
    ----------
    path
        The limits file.

    Returns
    -------
    tuple
        Constants that it must hold, and whether what the model leaves prevents it.

    Raises
    ------
    UsageError
        The file is wrong.

    """
    document = _document(path)
    word = str(document.get("model_gates", "yes")).lower()
    if word not in WORDS:
        raise UsageError(f"{path.name}: model_gates is {word!r}", "write yes or no")
    return _required(document, path), WORDS[word]


def _required(document: Mapping[str, Any], path: Path) -> tuple[str, ...]:
    names = document.get("required")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise UsageError(f"{path.name} needs `required:`, a list of constants", "add it")
    unknown = [name for name in names if name not in CONSTANTS]
    if unknown:
        raise UsageError(f"{path.name}: no constant {unknown[0]!r}", "see docs/glossary.md")
    return tuple(names)


def read_limits(path: Path) -> Limits:
    """A limits file as a record; raises UsageError for a key, a word or a number it cannot read.

    What the file means is judged by `lots.limits_lint`.

    Parameters
    ----------
    path
        The limits file.

    Returns
    -------
    Limits
        What it means is judged by `lots.limits_lint`.

    Raises
    ------
    UsageError
        A key, a word or a number cannot be read.

    """
    document = _document(path)
    _only(document, KEYS, path.name)
    rules = _map(document, "rules", path.name)
    _only(rules, RULE_KEYS, f"{path.name}: rules")
    constants = _map(document, "constants", path.name)
    golden = document.get("golden") or []
    if not isinstance(golden, list) or not all(isinstance(one, str) for one in golden):
        raise UsageError(f"{path.name}: golden is no list of motors", "write [GM-1, GM-2]")
    values: dict[str, Any] = {key: _number(rules, key, path.name) for key in rules}
    if "min_lots" in values:
        values["min_lots"] = int(values["min_lots"])
    return Limits(
        name=path.stem,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        required=required_constants(path),
        constants=tuple(_constant(path.name, name, given) for name, given in constants.items()),
        golden=tuple(golden),
        **values,
    )


def _document(path: Path) -> dict[str, Any]:
    try:
        document = load_plain(path.read_bytes(), path.name)
    except CaptureError as error:
        raise UsageError(error.message, error.remedy) from error
    if not isinstance(document, dict):
        raise UsageError(f"{path.name} holds no keys", "write `key: value` lines")
    return document


def _only(document: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in document:
        if key not in known:
            raise UsageError(f"{where}: no key {key!r}", f"known are {', '.join(known)}")


def _map(document: Mapping[str, Any], key: str, where: str) -> dict[str, Any]:
    value = document.get(key) or {}
    if not isinstance(value, dict):
        raise UsageError(f"{where}: {key} holds no keys", "write `key: value` lines below it")
    return value


def _number(document: Mapping[str, Any], key: str, where: str) -> float:
    try:
        return number_from(document[key])
    except UsageError as error:
        raise UsageError(f"{where}: {key}: {error.message}", error.remedy) from error


def _amount(text: Any, where: str) -> Amount:
    if not isinstance(text, str):
        raise UsageError(f"{where} is no size", "write 0.0071, 3 %, 1.5 sd or 0.822 U")
    try:
        return amount_from(text)
    except UsageError as error:
        raise UsageError(f"{where}: {error.message}", error.remedy) from error


def _constant(file: str, name: str, given: Any) -> ConstantLimits:
    where = f"{file}: {name}"
    given = given or {}
    if not isinstance(given, dict):
        raise UsageError(f"{where} holds no keys", "write {tolerance: 3 %} or lines below it")
    _only(given, CONSTANT_KEYS, where)
    values: dict[str, Any] = {}
    for key in ("nominal", "minimum", "maximum"):
        if key in given and not (key == "nominal" and given[key] == "baseline"):
            values[key] = _number(given, key, where)
    for key in ("tolerance", "guard_band"):
        if key in given:
            values[key] = _amount(given[key], f"{where}: {key}")
    margins = given.get("equivalence_margin", [])
    margins = margins if isinstance(margins, list) else [margins]
    values["margins"] = tuple(_amount(one, f"{where}: equivalence_margin") for one in margins)
    return ConstantLimits(name=name, **values, **_choices(given, where))


def _choices(given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The decision rule and what is answered by yes or no."""
    chosen: dict[str, Any] = {}
    if "decision_rule" in given:
        if given["decision_rule"] not in RULES:
            known = ", ".join(RULES)
            raise UsageError(
                f"{where}: no decision rule {given['decision_rule']!r}", f"known are {known}"
            )
        chosen["rule"] = given["decision_rule"]
    for key, field in (("decides", "decides"), ("tolerate_within_margin", "tolerate")):
        if key in given:
            if str(given[key]).lower() not in WORDS:
                raise UsageError(f"{where}: {key} is {given[key]!r}", "write yes or no")
            chosen[field] = WORDS[str(given[key]).lower()]
    return chosen
