"""The command that a run's user would sensibly give next."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from pipeline.records.current_status import CurrentStatus
from pipeline.records.datasheet import Datasheet, left_to_a_person
from pipeline.views.fleet import lacking_alike


def next_command(
    datasheets: Sequence[Datasheet],
    folder: str,
    output: str,
    statuses: Mapping[str, CurrentStatus] | None = None,
) -> str:
    """What most motors need: missing effects added, a diagnosis, an approval, an export.

    Effects that half of the motors lack are the design's; of fewer, one motor is looked at closely.
    Where no constant is determined by itself, `compare` says which combinations are.

    Parameters
    ----------
    datasheets
        Of the run.
    folder
        Where the captures lie.
    output
        Of the run.
    statuses
        The current ones by motor; what a datasheet says of itself without.

    Returns
    -------
    str
        Command and keys without the program; empty where no datasheet came out.

    """
    where = f" output={shlex.quote(output)}"
    states = {
        sheet.motor_id: sheet.status
        if statuses is None or sheet.motor_id not in statuses
        else statuses[sheet.motor_id].status
        for sheet in datasheets
    }
    if datasheets and not any(
        one.known for sheet in datasheets for one in sheet.constants.values()
    ):
        return f"compare input={shlex.quote(folder)}{where}"
    # a motor that awaits nothing but a person goes before one that a check has refused
    for group in lacking_alike(datasheets):
        useful = [sheet for sheet in group if states[sheet.motor_id] != "refused"]
        if useful and (model := useful[0].model) is not None:
            adding = model.adding(folder) if 2 * len(group) >= len(datasheets) else ""
            return (adding or model.command(useful[0].motor_id, folder)) + where
    incomplete = {s.motor_id for s in datasheets if not all(map(left_to_a_person, s.why))}
    for status, command in (("provisional", "registry show {}"), ("released", "export json {}")):
        for motor_id, state in states.items():
            if state == status and motor_id not in incomplete:
                return command.format(shlex.quote(motor_id)) + where
    for motor_id in states:
        return f"plan motor={shlex.quote(motor_id)}{where}"
    return ""
