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
    """The status of `contract/outputs.md` and every reason that keeps it from `released`.

    `required` are the constants that the limits file wants measured; `release` is `auto` or
    `manual` (then a person approves in the registry, and the file stays provisional). A constant
    that came out where no motor is keeps any datasheet back, required or not: what is wrong with
    its captures is in what else rests on them. So does what is `lacking` in the model: by more than
    the noise of the captures, or because it was not held against them.
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
