"""What a rung adds, as a markdown page inside the ladder's recording."""

from __future__ import annotations

from pipeline.io.recordings.datasheet_page import plain
from pipeline.physics.notation import MINUS, number_text, quantity
from pipeline.records.diagnosis import Diagnosis

_VERDICTS = {
    "adequate": "nothing is missing",
    "missing": "known effects are missing",
    "unknown": "something is missing that no known effect explains",
    "insufficient": "the captures are too few to tell",
}


def rung_markdown(result: Diagnosis, place: int) -> str:
    """One rung: what came, its parameters, all errors so far; the verdict on the last one."""
    rung = result.ladder[place]
    came = added(result, place)
    title = plain(f"+ {', '.join(came)}") if came else plain(f"model {result.model}")
    lines = [f"# Rung {place}: {title}", ""]
    told = {one.effect: one for one in result.ranking}
    for name in came:
        lines += [plain(told[name].explanation), ""] if name in told else []
    lines += [f"Held-out error **{rung.held_out:.4g}** (1 is the noise floor)", ""]
    own = [n for n in rung.parameters if n.split(".")[0] in came]
    if own:
        lines += ["| parameter | value ± U (k = 2) |", "| --- | --- |"]
        lines += [f"| {plain(n)} | {number_text(*rung.parameters[n])} |" for n in own] + [""]
    lines += _table(result, place)
    if place == len(result.ladder) - 1:
        lines += ["", f"**{result.verdict}**: {_VERDICTS[result.verdict]}"]
        lines += _doubts(result)
    return "\n".join(
        [*lines, "", "Drag the time cursor (timeline `rung`) to climb the ladder.", ""]
    )


def added(result: Diagnosis, place: int) -> tuple[str, ...]:
    """Effects of a rung that the rung below did not have."""
    before = result.ladder[place - 1].effects if place else ()
    return tuple(name for name in result.ladder[place].effects if name not in before)


def _table(result: Diagnosis, place: int) -> list[str]:
    names = list(result.ladder[0].errors)
    lines = ["| rung | model | held out | " + " | ".join(plain(n) for n in names) + " |"]
    lines.append("| --- | --- | --- |" + " --- |" * len(names))
    for number, rung in enumerate(result.ladder[: place + 1]):
        came = ", ".join(f"+ {n}" for n in added(result, number)) or result.model
        cells = [
            quantity(rung.errors[n].rmse, rung.errors[n].unit, 3) if n in rung.errors else ""
            for n in names
        ]
        last = "**" if number == place else ""
        lines.append(
            f"| {last}{number}{last} | {plain(came)} | {_change(result, number)} | "
            + " | ".join(cells)
            + " |"
        )
    floor = [quantity(e.noise_floor, e.unit, 3) for e in result.ladder[place].errors.values()]
    lines.append("|  | noise floor | 1 | " + " | ".join(floor) + " |")
    return lines


def _change(result: Diagnosis, number: int) -> str:
    now = result.ladder[number].held_out
    if number == 0:
        return f"{now:.3g}"
    before = result.ladder[number - 1].held_out
    change = 100.0 * (now / before - 1.0) if before > 0 else 0.0
    return f"{now:.3g} ({change:+.0f} %)".replace("-", MINUS)


def _doubts(result: Diagnosis) -> list[str]:
    lines = []
    for one in result.ranking:
        if one.effect in result.missing and one.confused_with:
            others = plain(", ".join(one.confused_with))
            lines += ["", f"{plain(one.effect)} could as well be {others}: {plain(one.experiment)}"]
    if result.unknown is not None:
        lines += ["", f"Left over in {plain(result.unknown.signal)}: {plain(result.unknown.shape)}"]
    return lines + [line for note in result.notes for line in ("", plain(note))]
