"""A capture in; the same capture with its masks, and the warnings, out; or a refusal."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.contracts.registry import gates
from pipeline.contracts.schemas import check_columns, check_metadata, check_tables, merged
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding


def validate(
    capture: Capture, options: Mapping[str, Mapping[str, float]]
) -> tuple[Capture, tuple[Finding, ...]]:
    """Holds a capture against its contract, then against every gate of its test.

    `options` are the configuration's `gates`. Gates look at the capture as recorded, none at
    another's masks, so that their order does not matter. Raises CaptureError that says every
    reason for the refusal at once.
    """
    check_metadata(capture.meta)
    check_columns(capture)
    check_tables(capture)
    masks: list[Mask] = []
    findings: list[Finding] = []
    refusals: list[CaptureError] = []
    for gate in gates():
        chosen = {**gate.settings(), **options.get(gate.name, {})}
        if capture.meta.test not in gate.tests or not chosen["enabled"]:
            continue
        try:
            passed = gate.check(capture, chosen)
        except CaptureError as refusal:
            refusals.append(refusal)
        else:
            masks.extend(passed.masks)
            findings.extend(passed.findings)
    if refusals:
        raise merged(refusals)
    return capture.with_masks(*masks), tuple(findings)
