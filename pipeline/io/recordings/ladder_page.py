"""What a step adds, as a markdown page inside the ladder's recording."""

from __future__ import annotations

from pipeline.io.recordings.datasheet_page import plain
from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import LadderView, ladder_view


def step_markdown(result: Diagnosis, place: int) -> str:
    """One step of the search as a page: what was added, its parameters, all errors so far.

    Parameters
    ----------
    result
        The diagnosis.
    place
        Number of the step; the last one has the verdict too.

    """
    view = ladder_view(result)
    step = view.steps[place]
    lines = [f"# Step {place}: {plain(step.title)}", ""]
    for text in (*step.headlines, *step.explanations):
        lines += [plain(text), ""]
    lines += [f"Held-out error **{step.held_out}** (1 is the noise floor)", ""]
    if step.parameters:
        lines += ["| parameter | value ± U (k = 2) |", "| --- | --- |"]
        lines += [f"| {plain(name)} | {text} |" for name, text in step.parameters] + [""]
    lines += _table(view, place)
    if place == len(view.steps) - 1:
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
        [*lines, "", "Drag the time cursor (timeline `rung`) to go from step to step.", ""]
    )


def _table(view: LadderView, place: int) -> list[str]:
    """The steps so far, the latest first, of the signals whose noise floor is known."""
    columns = [n for n, cell in enumerate(view.steps[0].errors) if cell is not None and cell.floor]
    names = [cell.signal for cell in view.steps[0].errors if cell is not None and cell.floor]
    lines = ["| step | model | held out | " + " | ".join(map(plain, names)) + " |"]
    lines.append("| --- | --- | --- |" + " --- |" * len(names))
    floors = [cell.floor if (cell := view.steps[place].errors[n]) else "" for n in columns]
    lines.append("|  | noise floor | 1 | " + " | ".join(floors) + " |")
    for step in reversed(view.steps[: place + 1]):
        cells = [cell.rmse if (cell := step.errors[n]) else "" for n in columns]
        last = "**" if step.number == place else ""
        change = f" ({step.change})" if step.change else ""
        lines.append(
            f"| {last}{step.number}{last} | {plain(step.title)} | {step.held_out}{change} | "
            + " | ".join(cells)
            + " |"
        )
    return lines
