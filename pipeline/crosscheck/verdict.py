"""Whether a datasheet is released, provisional or refused, and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pipeline.records.datasheet import AWAITS_APPROVAL, CaptureReference, Check, DatasheetStatus
from pipeline.records.estimate import Estimate


def verdict(
    constants: Mapping[str, Estimate],
    checks: Sequence[Check],
    captures: Iterable[CaptureReference],
    required: Sequence[str],
    release: str,
    lacking: str | None,
) -> tuple[DatasheetStatus, tuple[str, ...]]:
    """Whether a datasheet is released, provisional or refused, and why.

    Parameters
    ----------
    constants
        The chosen estimate of each constant by name.
    checks
        All cross-checks.
    captures
        What the datasheet rests on, with the integrity of each file.
    required
        Constants that the limits file wants measured.
    release
        `auto`, or `manual`: then a person approves in the registry, and the datasheet stays
        provisional.
    lacking
        What the model of the motor lacks, in words: it misses its captures by more than their
        noise, or was not held against them. None where it lacks nothing.

    Returns
    -------
    status, reasons
        `refused` where a check failed, with the failures alone; `provisional` with all that keeps
        it back; or `released` without a reason.

    Notes
    -----
    A constant that came out where no motor is keeps any datasheet back, required or not: what is
    wrong with its captures is in what else rests on them. So does what is lacking in the model.

    """
    failed = [check for check in checks if check.status == "fail"]
    if failed:
        return "refused", tuple(_failure(check) for check in failed)
    why = [f"unverified: {ref.path}" for ref in captures if ref.integrity != "verified"]
    for name in required:
        estimate = constants.get(name)
        if estimate is None or not estimate.known:
            reason = "no capture of it" if estimate is None else estimate.note
            why.append(f"missing: {name} ({reason})")
        elif estimate.status in ("assumed", "stated"):
            why.append(f"{estimate.status}, not measured: {name}")
        elif estimate.at_bound:
            why.append(f"at its bound: {name}")
    why += [
        f"impossible: {name} ({estimate.note})"
        for name, estimate in sorted(constants.items())
        if estimate.impossible and name not in required
    ]
    if lacking is not None:
        why.append(lacking)
    if release != "auto":
        why.append(AWAITS_APPROVAL)
    return ("provisional", tuple(why)) if why else ("released", ())


def _failure(check: Check) -> str:
    suspect = f"; suspect: {check.suspect}" if check.suspect else ""
    return f"check {check.name} failed: {check.meaning}{suspect}"
