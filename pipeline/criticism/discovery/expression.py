"""An expression of terms with fitted amplitudes: its value and its standard uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.discovery.dictionary import Term
from pipeline.criticism.operating import Array


@dataclass(frozen=True, slots=True)
class Expression:
    """Terms with their amplitudes, and the covariance of amplitudes and scales.

    Attributes
    ----------
    terms, amplitudes
        Terms, and their amplitudes [unit of the input].
    directions
        (term, `amplitude` or a field of the term) of each row of the covariance.
    covariance
        Of amplitudes and scales, in that order.
    gain
        Fall of −2 log likelihood.
    residual
        Residual with everything refitted [R].

    """

    terms: tuple[Term, ...]
    amplitudes: Array
    directions: tuple[tuple[int, str], ...]
    covariance: Array
    gain: float
    residual: Array

    def value(self, v: Array, carrier: int = 0) -> Array:
        """The expression on one carrier.

        Parameters
        ----------
        v
            Values of its variable [n].
        carrier
            Number of the carrier.

        Returns
        -------
        array [n]
            In the unit of the input.

        """
        total = np.zeros(np.shape(v))
        for term, amplitude in zip(self.terms, self.amplitudes, strict=True):
            if term.carrier == carrier:
                total = total + amplitude * term.value(v)
        return total

    def spread(self, v: Array, carrier: int = 0) -> Array:
        """Standard uncertainty of the expression on one carrier.

        Parameters
        ----------
        v
            Values of its variable [n].
        carrier
            Number of the carrier.

        Returns
        -------
        array [n]
            In the unit of the input.

        """
        rows = [
            _direction(self.terms[n], self.amplitudes[n], name, v)
            if self.terms[n].carrier == carrier
            else np.zeros(np.shape(v))
            for n, name in self.directions
        ]
        if not rows:
            return np.zeros(np.shape(v))
        slope = np.stack(rows)
        variance = np.einsum("iv,ij,jv->v", slope, self.covariance, slope)
        return np.sqrt(np.maximum(variance, 0.0))

    def u(self, term: int, name: str) -> float:
        """Standard uncertainty of an amplitude or scale of a term.

        Parameters
        ----------
        term
            Number of the term.
        name
            `amplitude` or a field of the term.

        """
        place = self.directions.index((term, name))
        return math.sqrt(max(float(self.covariance[place, place]), 0.0))


def _direction(term: Term, amplitude: float, name: str, v: Array) -> Array:
    if name == "amplitude":
        return term.value(v)
    step = 1e-4 * (term.scale if name == "scale" else 1.0)
    moved = replace(term, **{name: getattr(term, name) + step})
    return amplitude * (moved.value(v) - term.value(v)) / step
