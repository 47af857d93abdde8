"""Python source of an effect file: the expression found, as a form for the user to edit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pipeline.criticism.discovery.dictionary import CENTRED, POWER, Term
from pipeline.criticism.discovery.expression import Expression
from pipeline.criticism.discovery.residual_inputs import Port
from pipeline.criticism.policy.discovery import Discovery

_SUFFIX = {"torque": "nm", "drop": "v", "flux": "wb", "angle": "rad"}
_KINDS = {"torque": "Array", "drop": "Complex", "flux": "Any", "angle": "Array"}
_TESTS = {"torque": "torque_map", "drop": "torque_map", "flux": "torque_map", "angle": "drive"}
_HEAD = '''"""{title}

Written by `diagnose` as a start: no effect of the library explains what this does.
{shape}.

The form below is a fit, not physics. Once you know the cause:
- put the formula of that cause into `_value`;
- name its parameters and give each its unit, its typical size and bounds;
- rename the effect and fill in words, signature, experiment and reference.

    compare "model.effects=['{name}']" effects_path=<this folder>
"""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import {imports}


'''


def effect_source(
    port: Port, expression: Expression, name: str, shape: str, current_a: float, policy: Discovery
) -> str:
    """Source of an effect file that `compare` can use as it stands.

    Parameters
    ----------
    port
        Where the structure acts.
    expression
        Its expression.
    name
        Name of the effect.
    shape
        The dependence in words.
    current_a
        Current that monomials are relative to.
    policy
        Bounds of the parameters.

    Returns
    -------
    str
        One `EFFECT`; amplitudes start at zero and scales at what was found, as in every effect.

    """
    lines = [
        *_body(port, expression, current_a),
        "",
        "",
        *_effect(port, expression, name, shape, policy),
    ]
    kinds = _KINDS[port.hook]
    listed = ["Effect", "Operating", "Parameter", "Values"]
    head = _HEAD
    if kinds == "Any":
        head = head.replace("import numpy", "from typing import Any\n\nimport numpy")
    else:
        listed.append(kinds)
    title = f"{port.effect.words[0].upper()}{port.effect.words[1:]}."
    imports = ", ".join(sorted(listed))
    return (
        head.format(title=title, shape=_wrapped(shape), name=name, imports=imports)
        + "\n".join(lines)
        + "\n"
    )


def _wrapped(text: str) -> str:
    import textwrap

    return textwrap.fill(text[0].upper() + text[1:], 96, break_on_hyphens=False)


def _body(port: Port, expression: Expression, current_a: float) -> Iterator[str]:
    kind = _KINDS[port.hook]
    yield f"def _value(x: Operating, q: Values) -> {kind}:"
    if port.variable is None:
        yield f"    d, i = x.id_a / {current_a:.6g}, x.iq_a / {current_a:.6g}"
    else:
        yield f"    v = {port.variable.code}"
    yield f"    total: {kind} = np.zeros(np.shape(x.omega_rad_s))"
    for n, term in enumerate(expression.terms):
        yield f"    total = total + {_summand(port, n, term, current_a)}"
    if port.hook in ("drop", "angle"):
        yield "    # a drive's own log only: what the motor has itself needs no factor"
        yield "    return total * (1.0 if x.inverter else 0.0)"
    else:
        yield "    return total"


def _summand(port: Port, n: int, term: Term, current_a: float) -> str:
    amplitude = f'q["{_amplitude(port, n)}"]'
    if term.kind == POWER or port.variable is None:
        d, q = port.monomials[term.monomial]
        return f"{amplitude} * {current_a:.6g} * d**{d} * i**{q}"
    scale = f'q["{_scale(port, n)}"]' if "scale" in term.free else f"{term.scale:.6g}"
    centre = f'q["{_centre(port, n)}"]'
    carrier = port.carriers[term.carrier].code
    times = "" if carrier == "1.0" else f" * ({carrier})"
    return f"{amplitude}{times} * {term.code(scale, centre)}"


def _amplitude(port: Port, n: int) -> str:
    return f"size{n + 1}_{_SUFFIX[port.hook]}"


def _scale(port: Port, n: int) -> str:
    unit = "" if port.variable is None else port.variable.unit
    return f"scale{n + 1}_{unit.replace('/', '_').lower()}"


def _centre(port: Port, n: int) -> str:
    unit = "rad" if port.variable is None else port.variable.unit
    return f"centre{n + 1}_{unit.replace('/', '_').lower()}"


def _effect(
    port: Port, expression: Expression, name: str, shape: str, policy: Discovery
) -> Iterator[str]:
    yield "EFFECT = Effect("
    yield f"    name={_quoted(name)},"
    yield f"    words={_quoted(port.effect.words)},"
    yield f"    signature={_quoted(shape)},  # noqa: E501"
    yield f"    tests=({_quoted(_TESTS[port.hook])},),"
    yield '    experiment="edit: the test in which it shows best",'
    yield '    reference="edit: where the formula comes from",'
    yield "    parameters=("
    for n, term in enumerate(expression.terms):
        yield from _parameters(port, n, term, float(expression.amplitudes[n]), policy)
    yield "    ),"
    hook = {"flux": "coenergy"}.get(port.hook, port.hook)
    yield f"    {hook}=_value,"
    yield ")"


def _parameters(
    port: Port, n: int, term: Term, amplitude: float, policy: Discovery
) -> Iterator[str]:
    size = abs(amplitude)
    reach = policy.bounds_factor * size
    yield (
        f"        Parameter({_quoted(_amplitude(port, n))}, {_quoted(port.unit)}, {size:.4g}, "
        f"{policy.negligible_share * size:.4g}, low=-{reach:.4g}, high={reach:.4g}),"
    )
    if "centre" in term.free:
        turning = term.kind not in CENTRED
        start = term.centre % (2 * math.pi) if turning else term.centre
        least = 0.001 if turning else 0.0
        low, high = (-7.0, 14.0) if turning else (0.0, policy.bounds_factor * start)
        unit = "rad" if port.variable is None else port.variable.unit
        yield (
            f"        Parameter({_quoted(_centre(port, n))}, {_quoted(unit)}, 1.0, {least:g}, "
            f"low={low:.4g}, high={high:.4g}, scan=({start:.6g},)),"
        )
    if "scale" in term.free and port.variable is not None:
        low, high = term.scale / policy.bounds_factor, term.scale * policy.bounds_factor
        yield (
            f"        Parameter({_quoted(_scale(port, n))}, {_quoted(port.variable.unit)}, "
            f"{term.scale:.4g}, 0.0, low={low:.4g}, high={high:.4g}, scan=({term.scale:.6g},)),"
        )


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
