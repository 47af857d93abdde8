"""What `diagnose` prints: what is missing with sizes, the ladder, and what to do next."""

from __future__ import annotations

from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import ladder_view
from pipeline.views.notes import told_and_folded


def ladder_text(result: Diagnosis, folder: str = "FOLDER") -> str:
    """Verdict, ladder and what to do next in a few lines; the captures lie in `folder`."""
    view = ladder_view(result, folder)
    missing = ", ".join(result.missing)
    told = [f"{result.motor_id}: {result.verdict}" + (f": {missing}" if missing else "")]
    told.append(f"  {view.headline}")
    for rung in view.rungs:
        change = f", {rung.change}" if rung.change else ""
        told.append(f"  {rung.title}: held-out error {rung.held_out} noise floors{change}")
    for doubt in view.doubts:
        told.append(f"  {doubt.effect} could as well be {doubt.rivals}")
        told += [f"    {test}" for test in doubt.tests]
    told += [f"  {text}" for text in view.slight]
    if (unknown := result.unknown) is not None:
        told.append(f"  left over in {unknown.signal}: {unknown.shape}")
        if unknown.sketch:
            told.append(f"  {unknown.expression}")
            told.append(f"  an effect to start from: diagnosis/effects/{unknown.effect}.py")
    told += [f"  {note}" for note in told_and_folded(result)[0]]
    if view.compare:
        told.append(f"next: {view.compare}")
    return "\n".join(told)
