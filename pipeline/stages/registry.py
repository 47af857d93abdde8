"""`registry`: what was published, what changed, what was valid when, who approved what."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, time
from functools import partial
from typing import Literal

from pipeline.execution.outputs.statuses import show_decision
from pipeline.io.registry.store import Registry, one_of
from pipeline.lots.selector import OF_CONTENT, known, parse_selector
from pipeline.records.current_status import status_of
from pipeline.records.difference import changes
from pipeline.records.errors import PipelineError, UsageError, meant
from pipeline.records.ledger import Selection, Version, histories, in_force, newest, select
from pipeline.records.naming import counted
from pipeline.records.outcome import Outcome
from pipeline.report.text.registry_text import (
    datasheet_text,
    difference_text,
    in_force_table,
    versions_table,
)
from pipeline.settings import RegistrySettings
from pipeline.stages.steps.registry import (
    history_of,
    naming,
    opened,
    revision_number,
    unknown_motor,
)
from pipeline.views.status_text import decision, when
from pipeline.views.table_text import safe

PREFIX = re.compile("[0-9a-f]{4,64}")
TAG = re.compile("[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def main(settings: RegistrySettings) -> Outcome:
    """Does one action.

    Parameters
    ----------
    settings
        The keys of `registry`.

    Raises
    ------
    UsageError
        An action or a key that is missing or wrong.

    """
    if settings.action not in ACTIONS:
        problem = f"no action {settings.action!r}" if settings.action else "the action is missing"
        raise UsageError(f"registry: {problem}", meant(settings.action, ACTIONS))
    return ACTIONS[settings.action](opened(settings), settings)


def _list(registry: Registry, settings: RegistrySettings) -> Outcome:
    events = registry.events()
    selected = select(events, Selection(motor_id=settings.motor))
    if settings.motor is not None and not selected:
        raise unknown_motor(registry, settings.motor)
    motors = len({version.motor_id for version in selected})
    lines = [versions_table(selected), ""] if selected else []
    count = f"{counted(motors, 'motor')}, {counted(len(selected), 'version')}"
    next_ = (
        f"registry show {shlex.quote(selected[0].motor_id)}{naming(settings)}" if selected else ""
    )
    return Outcome(text="\n".join([*lines, count]), result=selected, next=next_)


def _show(registry: Registry, settings: RegistrySettings) -> Outcome:
    version = _version(registry, settings, newest=True)
    (sheet,) = registry.datasheets([version])
    text = datasheet_text(version, sheet)
    return Outcome(text=text, result=sheet.document(), next=_next(version, settings))


def _next(version: Version, settings: RegistrySettings) -> str:
    """What a version is good for as it stands: to be exported, completed or approved."""
    motor = shlex.quote(version.motor_id)
    if version.status == "revoked":
        return f"registry list {motor}{naming(settings)}"
    if version.status == "released":
        return f"export json {motor} revision={version.revision}{naming(settings)}"
    if version.open_points:
        return f"plan motor={motor} output={shlex.quote(settings.output)}"
    return (
        f"registry approve {motor} revision={version.revision} by=NAME why=REASON{naming(settings)}"
    )


def _diff(registry: Registry, settings: RegistrySettings) -> Outcome:
    motor, *revisions = _needed(settings, "motor", "from", "to")
    history = history_of(registry, motor)
    pair = []
    for name, revision in zip(("from", "to"), revisions, strict=True):
        number = revision_number(revision, name)
        wanted = Selection(motor_id=motor, revision=number)
        pair.append(one_of([v for v in history if wanted.takes(v)], wanted, registry.place))
    one, other = registry.datasheets(pair)
    differences = changes(one.constants, other.constants)
    text = difference_text(pair[0], pair[1], differences)
    return Outcome(text=text, result=differences, next=_next(pair[1], settings))


def _at(registry: Registry, settings: RegistrySettings) -> Outcome:
    motor, date = settings.motor, settings.date
    if date is None:
        # `registry at DATE`: the second word is the date.
        motor, date = None, motor
    if date is None:
        raise UsageError("registry at: the date is missing", "registry at 2026-03-01")
    until = moment(date)
    motors = histories(registry.events(), until)
    if motor is not None:
        motors = {motor_id: history for motor_id, history in motors.items() if motor_id == motor}
    if not motors:
        return Outcome(text=f"nothing was published by {when(until)}")
    rows = [(motor_id, in_force(history), history[-1]) for motor_id, history in motors.items()]
    valid = sum(version is not None for _, version, _ in rows)
    text = f"{counted(len(rows), 'motor')}, {valid} with a released datasheet at {when(until)}"
    current = [{"motor_id": motor_id, "in_force": version} for motor_id, version, _ in rows]
    motor_id, version, last = next((row for row in rows if row[1] is not None), rows[0])
    shown = f"{shlex.quote(motor_id)} revision={(version or last).revision}"
    return Outcome(
        text="\n".join([in_force_table(rows), "", text]),
        result=current,
        next=f"registry show {shown}{naming(settings)}",
    )


def _verify(registry: Registry, settings: RegistrySettings) -> Outcome:
    broken = registry.verify()
    count = f"{counted(broken.versions, 'version')}, {counted(broken.decisions, 'decision')}"
    faults = counted(len(broken.faults), "mismatch")
    verdict = faults if broken.faults else "all of it as published"
    errors = (
        *(f"mismatch: {line}" for line in broken.faults),
        *(f"note: {n}" for n in broken.notes),
    )
    text = f"{registry.place}: {count}, {verdict}"
    next_ = f"registry list{naming(settings)}"
    return Outcome(1 if broken.faults else 0, text, errors, result=broken, next=next_)


def _decide(
    kind: Literal["approve", "revoke"], registry: Registry, settings: RegistrySettings
) -> Outcome:
    which = "revision" if settings.version is None else "version"
    _, _, by, why = _needed(settings, "motor", which, "by", "why")
    wanted = _wanted(settings)
    version, new = registry.decide(kind, wanted, by, why, datetime.now(UTC))
    already = "" if new else " (already so)"
    text = f"{safe(version.motor_id)} revision {version.revision} is {version.status}{already}: "
    lines = [text + decision(version.decisions[-1])]
    lines += [f"  stands: {safe(reason)}" for reason in status_of(version, None).why]
    try:
        lines += [f"  shown in {page}" for page in show_decision(registry, version.motor_id)]
    except PipelineError as error:
        failed = f"error: decided, but not shown: {error}; `run` again shows it"
        return Outcome(error.exit_code, "\n".join(lines), (failed,))
    return Outcome(text="\n".join(lines), result=version, next=_next(version, settings))


def _name(kind: Literal["tag", "untag"], registry: Registry, settings: RegistrySettings) -> Outcome:
    """Gives the newest version of each motor that `select` takes, or one motor's, a name."""
    tag, by = _needed(settings, "tag", "by")
    if not TAG.fullmatch(tag):
        raise UsageError(f"tag={tag} is no name", "letters, digits and - _ . up to 64")
    if settings.select is not None:
        versions = [v for history in histories(registry.events()).values() for v in history]
        query = parse_selector(settings.select, versions)
        if any(name in query.terms for name in OF_CONTENT):
            raise UsageError("registry tag: select by what a version's row says", "use `lot:...`")
        chosen = newest(v for v in versions if query.takes(v))
        if not chosen:
            raise UsageError(f"select={settings.select} selects nothing", known(versions))
    else:
        chosen = (_version(registry, settings, newest=True),)
    changed = registry.tag(kind, chosen, tag, by, datetime.now(UTC))
    one = "s" if len(chosen) == 1 else ""
    done = f"now bear{one}" if kind == "tag" else f"no longer bear{one}"
    use = f"regress baseline=tag:{tag} candidate=lot:LOT" if kind == "tag" else "registry list"
    return Outcome(
        text=f"{counted(len(chosen), 'version')} {done} the tag {tag}, {changed} of them changed",
        next=f"{use}{naming(settings)}",
    )


ACTIONS: Mapping[str, Callable[[Registry, RegistrySettings], Outcome]] = {
    "list": _list,
    "show": _show,
    "diff": _diff,
    "at": _at,
    "verify": _verify,
    "approve": partial(_decide, "approve"),
    "revoke": partial(_decide, "revoke"),
    "tag": partial(_name, "tag"),
    "untag": partial(_name, "untag"),
}


def moment(text: str) -> datetime:
    """The moment that ISO 8601 text names, in UTC where it says no zone; a date means its end.

    Parameters
    ----------
    text
        A date or a moment in ISO 8601.

    Raises
    ------
    UsageError
        Other text.

    """
    try:
        instant = datetime.fromisoformat(text)
        if len(text) <= len("2026-03-01"):
            instant = datetime.combine(instant.date(), time.max)
        return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).astimezone(UTC)
    except (ValueError, OverflowError) as error:
        remedy = "write 2026-03-01 or 2026-03-01T12:00Z"
        raise UsageError(f"date={text} is no date", remedy) from error


def _version(registry: Registry, settings: RegistrySettings, *, newest: bool) -> Version:
    """The version that `motor` and `revision` or `version` name, else the newest of the motor."""
    wanted = _wanted(settings)
    history = history_of(registry, wanted.motor_id or "")
    versions = [version for version in history if wanted.takes(version)]
    if newest and wanted.revision is None and wanted.version is None:
        versions = versions[-1:]
    return one_of(versions, wanted, registry.place)


def _wanted(settings: RegistrySettings) -> Selection:
    (motor,) = _needed(settings, "motor")
    revision, version = settings.revision, settings.version
    if version is not None and not PREFIX.fullmatch(version):
        raise UsageError(f"version={version} is no digest", "at least its first 4 hex digits")
    number = None if revision is None else revision_number(revision)
    return Selection(motor_id=motor, revision=number, version=version)


def _needed(settings: RegistrySettings, *names: str) -> tuple[str, ...]:
    """The texts of keys that the action needs.

    Raises UsageError that names all of them that are missing or blank.
    """
    stated = {name: getattr(settings, f"{name}_" if name == "from" else name) for name in names}
    missing = [name for name, text in stated.items() if text is None or not text.strip()]
    if missing:
        keys, verb = ", ".join(f"{name}=" for name in missing), "is" if missing[1:] == [] else "are"
        add = " ".join(f"{name}=..." for name in missing)
        raise UsageError(f"registry {settings.action}: {keys} {verb} missing", f"add {add}")
    return tuple(str(text) for text in stated.values())
