"""`export`: one controller's configuration from a released datasheet."""

from __future__ import annotations

import shlex

from pipeline.criticism.library.effect_tables import effect_tables
from pipeline.estimation.registry import estimator_terms
from pipeline.export.protocol import Exporter, Source
from pipeline.export.registry import exporters
from pipeline.io.registry.store import Registry, one_of
from pipeline.io.storage.publish import output_folder, write_whole
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import Datasheet
from pipeline.records.effect_table import EffectTables
from pipeline.records.errors import UsageError, meant
from pipeline.records.ledger import Selection, Version, in_force
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Outcome
from pipeline.settings import ExportSettings
from pipeline.stages.steps.registry import history_of, naming, opened, revision_number
from pipeline.views.status_text import exported, not_exported

MOST_LINES = 200
"""Lines of a configuration that are printed; tables of effects run to thousands."""
BASE = {"r_ohm": "r_phase_ohm", "ld_h": "ld_h", "lq_h": "lq_h", "psi_wb": "psi_pm_wb"}


def main(settings: ExportSettings) -> Outcome:
    """Writes the configuration to `export/` of output, and prints it unless it is long.

    Parameters
    ----------
    settings
        The keys of `export`.

    Raises
    ------
    UsageError
        An unknown format or motor, a datasheet that is not released, and a constant that is not
        measured or whose convention is unknown.

    """
    exporter = _exporter(settings)
    options = {name: str(value) for name, value in settings.options.items()}
    for name in options:
        if name not in exporter.options:
            has = ", ".join(exporter.options) or "none"
            raise UsageError(f"options.{name}: {exporter.name} has no such option", f"it has {has}")
    registry = opened(settings)
    version, notes = _version(registry, settings)
    (sheet,) = registry.datasheets([version])
    source = Source(sheet, version.revision, estimator_terms() | CONSTANTS, _effects(sheet))
    text = exporter.render(source, options)
    ending = dict.fromkeys((exporter.name, exporter.extension))
    name = ".".join((file_stem(version.motor_id), *ending))
    path = output_folder(settings.output) / "export" / name
    write_whole(path, text.encode())
    which = f"note: {exported(version)}"
    left = tuple(f"note: not in {exporter.name}: {line}" for line in exporter.omits(source))
    lines = text.count("\n")
    return Outcome(
        text=text if lines <= MOST_LINES else f"{lines} lines",
        errors=(which, *notes, *left),
        result={"path": path, "content": text},
        wrote=path.as_posix(),
        next=_next(version, settings),
        is_content=lines <= MOST_LINES,
    )


def _next(version: Version, settings: ExportSettings) -> str:
    """What was handed out gets a name, by which a later lot is held against it."""
    which = f"{shlex.quote(version.motor_id)} revision={version.revision}"
    return f"registry tag {which} tag=in-use by=NAME{naming(settings)}"


def _effects(sheet: Datasheet) -> EffectTables:
    """What the effects known of a motor add to it; none where its own constants are not known."""
    estimates = {name: sheet.constants.get(own) for name, own in BASE.items()}
    base = {name: one.number for name, one in estimates.items() if one is not None and one.known}
    poles = sheet.constants.get("pole_pairs")
    if len(base) < len(BASE) or poles is None or not poles.known:
        return EffectTables()
    return effect_tables(sheet.model, base, round(poles.number))


def _exporter(settings: ExportSettings) -> Exporter:
    known = exporters()
    if settings.format not in known:
        problem = f"no format {settings.format!r}" if settings.format else "format= is missing"
        raise UsageError(f"export: {problem}", meant(settings.format, known))
    if not settings.motor.strip():
        raise UsageError("export: motor= is missing", "name the motor by its serial number")
    return known[settings.format]


def _version(registry: Registry, settings: ExportSettings) -> tuple[Version, tuple[str, ...]]:
    """The requested version, or the newest released one; raises UsageError for none released."""
    history = history_of(registry, settings.motor)
    if settings.revision is None and settings.version is None:
        in_force_now, last = in_force(history), history[-1]
        if in_force_now is None:
            raise _unreleased(last, settings)
        newer = f"note: {not_exported(last)}"
        return in_force_now, (newer,) * (last.revision > in_force_now.revision)
    number = None if settings.revision is None else revision_number(settings.revision)
    wanted = Selection(settings.motor, revision=number, version=settings.version)
    version = one_of([v for v in history if wanted.takes(v)], wanted, registry.place)
    if version.status != "released":
        raise _unreleased(version, settings)
    return version, ()


def _unreleased(version: Version, settings: ExportSettings) -> UsageError:
    name = f"motor {version.motor_id!r} revision {version.revision}"
    points = "; ".join(version.open_points[:3])
    approve = f"registry approve {shlex.quote(version.motor_id)} revision={version.revision} "
    approve += f"by=NAME why=REASON{naming(settings)}"
    remedy = "complete it first" if points else f"`{approve}` releases it"
    why = f": {points}" if points else ""
    return UsageError(f"{name} is {version.status}, not released{why}", remedy)
