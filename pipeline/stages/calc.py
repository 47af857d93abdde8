"""`calc`: answers with their formula and convention, from the physics the datasheets use."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.calculators.coupling import GRIP, KE_KT, KV
from pipeline.calculators.impedance import COPPER, SALIENCY, WYE_DELTA
from pipeline.calculators.poles import POLE_PAIRS
from pipeline.calculators.quantities import Answer, Calculator, parse, render, usage
from pipeline.records.errors import UsageError, meant
from pipeline.records.outcome import Outcome
from pipeline.settings import CalcSettings

KINDS: dict[str, Calculator] = {
    "wye-delta": WYE_DELTA,
    "copper": COPPER,
    "ke-kt": KE_KT,
    "kv": KV,
    "grip": GRIP,
    "pole-pairs": POLE_PAIRS,
    "saliency": SALIENCY,
}


def main(settings: CalcSettings) -> Outcome:
    """Prints one calculator's answer with its formula.

    Parameters
    ----------
    settings
        The keys of `calc`.

    """
    text, answer = answered(settings.kind, settings.values)
    return Outcome(text=text, result=answer)


def answered(kind: str, mapping: Mapping[str, str]) -> tuple[str, Answer | None]:
    """The printed answer of one calculator for the keys as typed, and the answer itself.

    Without a kind, the kinds; without keys, what the kind can be given.

    Parameters
    ----------
    kind
        Name of the calculator; empty for a list of all.
    mapping
        The keys as typed.

    Raises
    ------
    UsageError
        An unknown kind or key, keys that do not suffice or contradict each other, and values
        without sense or of another unit.

    """
    if not kind:
        return usage(KINDS), None
    calculator = KINDS.get(kind)
    if calculator is None:
        raise UsageError(f"calc: no kind {kind!r}", meant(kind, KINDS))
    if not mapping:
        return usage(KINDS, kind), None
    given = parse(kind, calculator, mapping)
    answer = calculator.answer(given)
    if answer is None:
        ways = "; or ".join(calculator.ways)
        raise UsageError(
            f"calc {kind}: nothing to work out of {', '.join(mapping)}", f"give {ways}"
        )
    return render(kind, calculator, given, answer), answer
