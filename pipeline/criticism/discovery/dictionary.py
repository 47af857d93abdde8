"""The dictionary that an unknown curve is written in: dimensionless shapes, each with its scale.

A term is a shape of u = v/scale, a bump in a turn, or a wave of some order; it says itself in
words and in Python, and gives its value, so that sketch, expression and effect file agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.discovery.bases import Variable
from pipeline.criticism.operating import Array

WAVES = ("sin", "cos")
POWER = "power"
CENTRED = ("hump", "resonance")
_ABOVE_DEGC = 25.0
"""Temperature that curves count from [°C], as everything in the model."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A curve of a = |u|, by name; `code` computes it from `{a}`, `scaled` if its scale matters.

    Attributes
    ----------
    name
        Its name.
    even, odd
        Formula in u, for each parity.
    code
        Python with `{a}` for |u|.
    scaled
        Whether its scale matters.
    value
        The curve [n] of |u| [n].

    """

    name: str
    even: str
    odd: str
    code: str
    scaled: bool
    value: Callable[[Array], Array]


SHAPES = (
    Shape("step", "1", "sign(u)", "1.0", False, np.ones_like),
    Shape("line", "|u|", "u", "{a}", False, lambda a: a),
    Shape("square", "u²", "u|u|", "{a} ** 2", False, lambda a: a**2),
    Shape("cube", "|u|³", "u³", "{a} ** 3", False, lambda a: a**3),
    Shape("decay", "exp(-|u|)", "sign(u)·exp(-|u|)", "np.exp(-{a})", True, lambda a: np.exp(-a)),
    Shape(
        "bell",
        "exp(-u²)",
        "sign(u)·exp(-u²)",
        "np.exp(-({a} ** 2))",
        True,
        lambda a: np.exp(-a * a),
    ),
    Shape("tanh", "tanh|u|", "tanh u", "np.tanh({a})", True, np.tanh),
    Shape(
        "peak",
        "2|u|/(1 + u²)",
        "2u/(1 + u²)",
        "2 * {a} / (1 + {a} ** 2)",
        True,
        lambda a: 2 * a / (1 + a * a),
    ),
    Shape(
        "lorentz",
        "1/(1 + u²)",
        "sign(u)/(1 + u²)",
        "1 / (1 + {a} ** 2)",
        True,
        lambda a: 1 / (1 + a * a),
    ),
)


@dataclass(frozen=True, slots=True)
class Term:
    """One term of an expression, of unit amplitude, on one carrier.

    Attributes
    ----------
    kind
        Name of a shape; `sin` or `cos`; `bump` in a turn; `hump` or `resonance`, which are exp(−u²)
        and 1/(1 + u²) around a centre that is not zero; or `power`.
    carrier
        Number of the carrier.
    parity
        `even`, `odd` (times the sign of u), or `plain` (of u itself).
    scale
        Of the variable, or width of a bump.
    order
        Waves a turn.
    centre
        Of a bump, hump or resonance.
    monomial
        Number of the monomial, for `power`.

    """

    kind: str
    carrier: int = 0
    parity: str = "even"
    scale: float = 1.0
    order: float = 0
    centre: float = 0.0
    monomial: int = 0

    @property
    def shape(self) -> Shape:
        """Its shape in the dictionary; ValueError for waves and what has a centre."""
        for shape in SHAPES:
            if shape.name == self.kind:
                return shape
        raise ValueError(f"{self.kind} is no shape")

    @property
    def free(self) -> tuple[str, ...]:
        """The fields that are fitted beside the amplitude."""
        if self.kind in ("bump", *CENTRED):
            return ("centre", "scale")
        if self.kind in (*WAVES, POWER):
            return ()
        return ("scale",) if self.shape.scaled else ()

    def value(self, v: Array) -> Array:
        """The term at values of its variable.

        Parameters
        ----------
        v
            Values [n].

        Returns
        -------
        array [n]
            Of unit amplitude [1].

        """
        if self.kind in WAVES:
            return getattr(np, self.kind)(self.order * v)
        if self.kind == "bump":
            return np.exp((np.cos(v - self.centre) - 1.0) / self.scale**2)
        size = v if self.parity == "plain" else np.abs(v)
        if self.kind in CENTRED:
            u = (size - self.centre) / self.scale
            half: Array = np.exp(-u * u) if self.kind == "hump" else 1.0 / (1.0 + u * u)
        else:
            half = self.shape.value(size / self.scale)
        return np.sign(v) * half if self.parity == "odd" else half

    def words(self, variable: Variable) -> str:
        """The term as a formula, its scale with unit.

        Parameters
        ----------
        variable
            The variable that it is of.

        """
        name = variable.name
        if self.kind in WAVES:
            return (
                f"{self.kind}({self.order:g} {name})" if self.order > 1 else f"{self.kind}({name})"
            )
        if self.kind == "bump":
            return f"exp((cos({name} - {self.centre:.4g} rad) - 1)/({self.scale:.4g} rad)²)"
        shifted = f"({name} - {_ABOVE_DEGC:g} degC)" if variable.kind == "warm" else name
        if self.kind in CENTRED:
            shape = "exp(-u²)" if self.kind == "hump" else "1/(1 + u²)"
            sense = f"sign({name})·" if self.parity == "odd" else ""
            size = shifted if self.parity == "plain" else f"|{name}|"
            away = f"({size} - {self.centre:.4g} {variable.unit})"
            return f"{sense}{shape}, u = {away}/({self.scale:.4g} {variable.unit})"
        text = self.shape.odd if self.parity == "odd" else self.shape.even
        if self.parity == "plain":
            text = text.replace("|u|", "u")
        if text == "sign(u)":
            return f"sign({name})"
        return (
            text if "u" not in text else f"{text}, u = {shifted}/({self.scale:.4g} {variable.unit})"
        )

    def code(self, scale: str, centre: str) -> str:
        """The term as Python, of `v`.

        Parameters
        ----------
        scale
            How its scale is read.
        centre
            How its centre is read.

        """
        if self.kind in WAVES:
            return f"np.{self.kind}({self.order} * v)"
        if self.kind == "bump":
            return f"np.exp((np.cos(v - {centre}) - 1) / {scale} ** 2)"
        of = "v" if self.parity == "plain" else "np.abs(v)"
        if self.kind in CENTRED:
            shape = "np.exp(-({u} ** 2))" if self.kind == "hump" else "1 / (1 + {u} ** 2)"
            body = shape.format(u=f"(({of} - {centre}) / {scale})")
        else:
            body = self.shape.code.format(a=f"({of} / {scale})")
        return f"np.sign(v) * {body}" if self.parity == "odd" else body
