"""What a lot is held to: nominal, tolerance, guard band, decision rule, margin of sameness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from pipeline.records.errors import UsageError

Per = Literal["unit", "nominal", "sd", "U"]
RuleName = Literal["four_way", "guarded", "simple"]
RULES: dict[RuleName, str] = {
    "four_way": "pass, conditional pass, conditional fail, fail (ILAC-G8, 4.2.3)",
    "guarded": "pass within the acceptance limits, else fail (ILAC-G8, 4.2.2)",
    "simple": "pass within the tolerance, no guard band (ILAC-G8, 4.2.1)",
}


@dataclass(frozen=True, slots=True)
class Amount:
    """A size: in the constant's unit, or as a share of nominal, motor sd or U.

    Attributes
    ----------
    value
        In what `per` says.
    per
        `unit` for the constant's unit, `nominal` for a share of the nominal value, `sd` for
        standard deviations between motors, `U` for expanded uncertainties.

    """

    value: float
    per: Per

    def in_unit(self, nominal: float, sd: float | None, expanded_u: float | None) -> float | None:
        """The size in the constant's unit.

        Parameters
        ----------
        nominal
            Nominal value [unit].
        sd
            Standard deviation between motors [unit], None where it is not known.
        expanded_u
            Expanded uncertainty U of a value [unit], None where it is not known.

        Returns
        -------
        float or None
            None where what the size counts in is not known or not finite.

        """
        scale = {"unit": 1.0, "nominal": abs(nominal), "sd": sd, "U": expanded_u}[self.per]
        return None if scale is None or not math.isfinite(scale) else self.value * scale


@dataclass(frozen=True, slots=True)
class ConstantLimits:
    """The limits of one constant; what is None is not limited.

    Attributes
    ----------
    name
        Name of the constant.
    nominal
        Nominal value [unit]; None stands for the mean of the baseline.
    tolerance
        What the design allows on either side of nominal.
    minimum, maximum
        Test limits [unit]; each replaces the tolerance on its side.
    guard_band
        Distance of the acceptance limit from the tolerance limit.
    rule
        Decision rule of ILAC-G8.
    margins
        The largest that can be evaluated is the margin of equivalence.
    decides
        Whether the lot does not pass while this constant is undecided.
    tolerate
        Whether a significant change that is shown to lie within the margin is marginal and no
        failure.

    """

    name: str
    nominal: float | None = None
    tolerance: Amount | None = None
    minimum: float | None = None
    maximum: float | None = None
    guard_band: Amount = Amount(0.822, "U")
    rule: RuleName = "four_way"
    margins: tuple[Amount, ...] = ()
    decides: bool = True
    tolerate: bool = False


@dataclass(frozen=True, slots=True)
class Limits:
    """A limits file. `alpha` holds for each family of tests, `k` is the coverage factor of U.

    A cogging order counts as new from `order_share` of the leading amplitude on. For versions of
    the code, a change is negligible below `code_negligible` u and fails above `code_limit` u.

    Attributes
    ----------
    name, sha256
        Of the file.
    required
        Constants that a released datasheet must hold.
    constants
        Limits of the constants that are compared.
    golden
        Motors that are measured on several stations.
    alpha
        Significance level of each family of tests.
    min_lots
        Fewest baseline lots for the lot-level test.
    k
        Coverage factor of U.
    order_share
        A cogging order counts as new from this share of the leading amplitude on.
    code_negligible, code_limit
        A change between versions of the code is negligible below the first and fails above the
        second [standard uncertainties].

    """

    name: str
    sha256: str
    required: tuple[str, ...]
    constants: tuple[ConstantLimits, ...] = ()
    golden: tuple[str, ...] = ()
    alpha: float = 0.05
    min_lots: int = 8
    k: float = 2.0
    order_share: float = 0.1
    code_negligible: float = 1.0 / 3.0
    code_limit: float = 1.0

    def family(self) -> tuple[ConstantLimits, ...]:
        """What is compared: `constants`, or without any the required ones, unlimited."""
        return self.constants or tuple(ConstantLimits(name) for name in self.required)


def amount_from(text: str) -> Amount:
    """A size as a limits file writes it.

    Parameters
    ----------
    text
        `3 %` (of nominal), `1.5 sd` (of motors), `0.822 U`, or a number in the constant's unit.

    Returns
    -------
    Amount
        Per cent as a share [1].

    Raises
    ------
    UsageError
        It is other text.

    Examples
    --------
    >>> amount_from("3 %")
    Amount(value=0.03, per='nominal')

    """
    words = text.strip()
    per: Per = "unit"
    for ending, kind in (("%", "nominal"), ("sd", "sd"), ("U", "U")):
        if words.endswith(ending):
            words, per = words[: -len(ending)].strip(), kind  # type: ignore[assignment]
            break
    value = number_from(words or "1")
    return Amount(value / 100.0 if per == "nominal" else value, per)


def number_from(text: str) -> float:
    """A finite number; raises UsageError otherwise.

    Parameters
    ----------
    text
        Such as `0.0071`.

    Returns
    -------
    float
        Finite.

    Raises
    ------
    UsageError
        The text is no finite number.

    """
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(f"{text!r} is no number", "write 0.0071, 3 %, 1.5 sd or 0.822 U")
    return value
