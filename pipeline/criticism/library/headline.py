"""What a person says of an effect, with its size: `encoder disc off-centre by 9.0 ± 0.1 mrad`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from pipeline.criticism.effect import Effect
from pipeline.physics.notation import number_text
from pipeline.records.diagnosis import ReportedParameter

UNKNOWN_SIZE = "unknown size"
_SIZE = re.compile(r"\{([^{}]+)\}")
_WAVE = re.compile(r"(?:sin|cos)_(\d+)_\w+")


def headline(effect: Effect, parameters: Mapping[str, ReportedParameter]) -> str:
    """The effect in words, each size in braces filled in.

    Parameters
    ----------
    effect : Effect
        `headline` may name in braces a parameter `{a}`, the length of a vector `{a & b}`, a share
        in percent `{a %}`, what three phases differ by at most `{phases a & b %}`, or `{largest}`,
        the wave of the largest amplitude. Of several headlines the one is said whose size is over
        its uncertainty the furthest.
    parameters : mapping of str to (value, u, unit)
        What was fitted, by name.

    Returns
    -------
    str
        `name (parameter value ± U, ...)` for an effect without words of its own.

    """
    if not effect.headline:
        sizes = ", ".join(f"{name} {number_text(*one)}" for name, one in parameters.items())
        return f"{effect.name} ({sizes})" if sizes else effect.name
    known = (effect.headline,) if isinstance(effect.headline, str) else effect.headline
    said = max(known, key=lambda words: _clearness(words, parameters))
    return _SIZE.sub(lambda match: _text(match[1], parameters), said)


def _clearness(words: str, parameters: Mapping[str, ReportedParameter]) -> float:
    """How many standard uncertainties the first size of a headline is; 0 where it is not known."""
    first = _SIZE.search(words)
    value, u, _ = _size(first[1], parameters) if first else (None, None, "1")
    return abs(value) / max(u or 0.0, 1e-300) if value is not None else 0.0


def _text(parameter: str, parameters: Mapping[str, ReportedParameter]) -> str:
    """A size in braces as a reading."""
    if parameter == "largest":
        return _largest(parameters)
    value, u, unit = _size(parameter, parameters)
    if value is None or u is None:
        return UNKNOWN_SIZE
    if parameter.endswith("%"):
        return number_text(100.0 * value, 100.0 * u, "%")
    return number_text(value, u, unit)


def _size(parameter: str, parameters: Mapping[str, ReportedParameter]) -> ReportedParameter:
    names = parameter.removesuffix("%")
    nothing = ReportedParameter(None, None, "1")
    of_phases = names.startswith("phases ")
    parts = [
        parameters.get(name.strip(), nothing) for name in names.removeprefix("phases ").split("&")
    ]
    return largest_difference(*parts) if of_phases else amplitude(parts)


def amplitude(parts: Sequence[ReportedParameter]) -> ReportedParameter:
    """Length of a vector of parameters, with its standard uncertainty to first order.

    Parameters
    ----------
    parts
        Components in one unit; one alone keeps its sign.

    Returns
    -------
    ReportedParameter
        Without a value where a component has none.

    """
    values = [(value, u or 0.0) for value, u, _ in parts if value is not None]
    if len(values) < len(parts):
        return ReportedParameter(None, None, parts[0].unit)
    if len(parts) == 1:
        return parts[0]
    length = math.hypot(*(value for value, _ in values))
    spread = math.hypot(*(value * u for value, u in values))
    return ReportedParameter(length, spread / length if length > 0 else 0.0, parts[0].unit)


def largest_difference(cosine: ReportedParameter, sine: ReportedParameter) -> ReportedParameter:
    """Largest less smallest of the three 2 Re(γ e^{−j4πk/3}), γ = cosine + j sine, to first order.

    Parameters
    ----------
    cosine, sine
        Parts of the negative-sequence component γ [1].

    Returns
    -------
    ReportedParameter
        Without a value where a part has none.

    """
    if cosine.value is None or sine.value is None:
        return ReportedParameter(None, None, cosine.unit)
    angles = [4.0 * math.pi * k / 3.0 for k in range(3)]
    phases = [2.0 * (cosine.value * math.cos(a) + sine.value * math.sin(a)) for a in angles]
    top, bottom = (angles[phases.index(one)] for one in (max(phases), min(phases)))
    slopes = 2.0 * (math.cos(top) - math.cos(bottom)), 2.0 * (math.sin(top) - math.sin(bottom))
    u = math.hypot(slopes[0] * (cosine.u or 0.0), slopes[1] * (sine.u or 0.0))
    return ReportedParameter(max(phases) - min(phases), u, cosine.unit)


def _largest(parameters: Mapping[str, ReportedParameter]) -> str:
    """The largest of the waves `sin_ORDER_nm` and `cos_ORDER_nm`, with its order."""
    waves: dict[str, list[ReportedParameter]] = {}
    for name, one in parameters.items():
        if match := _WAVE.fullmatch(name):
            waves.setdefault(match[1], []).append(one)
    sizes = {order: amplitude(parts) for order, parts in waves.items()}
    known = {order: one for order, one in sizes.items() if one.value is not None}
    if not known:
        return UNKNOWN_SIZE
    order = max(known, key=lambda name: known[name].value or 0.0)
    return f"{number_text(*known[order])}, {order} a turn"
