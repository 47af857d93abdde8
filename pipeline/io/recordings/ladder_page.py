"""What a rung adds, as a markdown page inside the ladder's recording."""

from __future__ import annotations

from pipeline.io.recordings.datasheet_page import plain
from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import LadderView, ladder_view


def rung_markdown(result: Diagnosis, place: int) -> str:
    """One step of the search as a page: what was added, its parameters, all errors so far.

    Parameters
    ----------
    result
        The diagnosis.
    place
        Number of the step; the last one has the verdict too.

    """
    view = ladder_view(result)
    rung = view.rungs[place]
    lines = [f"# Rung {place}: {plain(rung.title)}", ""]
    for text in (*rung.headlines, *rung.explanations):
        lines += [plain(text), ""]
    lines += [f"Held-out error **{rung.held_out}** (1 is the noise floor)", ""]
    if rung.parameters:
        lines += ["| parameter | value ± U (k = 2) |", "| --- | --- |"]
        lines += [f"| {plain(name)} | {text} |" for name, text in rung.parameters] + [""]
    lines += _table(view, place)
    if place == len(view.rungs) - 1:
        lines += ["", f"**{result.verdict}**: {plain(view.headline)}"]
        for doubt in view.doubts:
            alternatives = (
                f"{doubt.effect} could as well be {doubt.alternatives}: {'; '.join(doubt.tests)}"
            )
            lines += ["", plain(alternatives)]
        if result.unknown is not None:
            one = result.unknown
            lines += ["", f"Left over in {plain(one.signal)}: {plain(one.shape)}"]
        lines += [line for note in result.notes for line in ("", plain(note))]
    return "\n".join(
        [*lines, "", "Drag the time cursor (timeline `rung`) to climb the ladder.", ""]
    )


def _table(view: LadderView, place: int) -> list[str]:
    """The rungs so far, the latest first, of the signals whose noise floor is known."""
    columns = [n for n, cell in enumerate(view.rungs[0].errors) if cell is not None and cell.floor]
    names = [cell.signal for cell in view.rungs[0].errors if cell is not None and cell.floor]
    lines = ["| rung | model | held out | " + " | ".join(map(plain, names)) + " |"]
    lines.append("| --- | --- | --- |" + " --- |" * len(names))
    floors = [cell.floor if (cell := view.rungs[place].errors[n]) else "" for n in columns]
    lines.append("|  | noise floor | 1 | " + " | ".join(floors) + " |")
    for rung in reversed(view.rungs[: place + 1]):
        cells = [cell.rmse if (cell := rung.errors[n]) else "" for n in columns]
        last = "**" if rung.number == place else ""
        change = f" ({rung.change})" if rung.change else ""
        lines.append(
            f"| {last}{rung.number}{last} | {plain(rung.title)} | {rung.held_out}{change} | "
            + " | ".join(cells)
            + " |"
        )
    return lines
