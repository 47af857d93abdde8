"""What `diagnose` prints: what is missing with sizes, the ladder, and what else it could be."""

from __future__ import annotations

from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import ladder_view
from pipeline.views.notes import shown_and_folded


def ladder_text(result: Diagnosis) -> str:
    """Verdict, ladder and doubts in a few lines.

    Parameters
    ----------
    result
        The diagnosis.

    """
    view = ladder_view(result)
    missing = ", ".join(result.missing)
    text_lines = [f"{result.motor_id}: {result.verdict}" + (f": {missing}" if missing else "")]
    text_lines.append(f"  {view.headline}")
    for step in view.steps:
        change = f", {step.change}" if step.change else ""
        text_lines.append(f"  {step.title}: held-out error {step.held_out} noise floors{change}")
    for doubt in view.doubts:
        text_lines.append(f"  {doubt.effect} could as well be {doubt.alternatives}")
        text_lines += [f"    {test}" for test in doubt.tests]
    text_lines += [f"  {text}" for text in view.slight]
    if (unknown := result.unknown) is not None:
        text_lines.append(f"  left over in {unknown.signal}")
        if unknown.sketch:
            text_lines.append(f"  {unknown.expression}")
            text_lines.append(f"  an effect to start from: diagnosis/effects/{unknown.effect}.py")
    text_lines += [f"  {note}" for note in shown_and_folded(result)[0]]
    return "\n".join(text_lines)
