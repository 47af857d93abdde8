"""What of a diagnosis counts between lots: the effects a motor shows, and how large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.records.diagnosis import Verdict


@dataclass(frozen=True, slots=True)
class DiagnosisSummary:
    """One motor's missing effects; `parameters` maps each to name → (value, unit)."""

    motor_id: str
    verdict: Verdict
    missing: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, tuple[float, str]]]
