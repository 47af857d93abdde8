"""Other methods on the same captures: a method is a function from captures to names.

To enter one, write a function that takes a `Campaign` and gives the names of the effects that are
missing, () for none and None for "something, but no name of mine", and put it into `METHODS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.diagnosis import base_fit
from pipeline.criticism.library.registry import effects
from pipeline.criticism.selection.candidates import candidates, placed, widened
from pipeline.execution.tasks.start import start_constants
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from tests.benchmark.blind import Diagnose
from tests.benchmark.worlds.sindy import weak_sindy

Array = NDArray[np.float64]
Method = Callable[[Campaign], Sequence[str] | None]

MOST = 8
"""Effects that a method may name at the most."""


def stepwise_bic(campaign: Campaign) -> Sequence[str] | None:
    """Stepwise regression by the Bayesian information criterion, on the product's own dictionary.

    Parameters
    ----------
    campaign : Campaign
        Captures of one motor.

    Returns
    -------
    sequence of str or None
        Names of the effects; None where the base model cannot be fitted.

    Notes
    -----
    Rows are the weak samples over their noise, columns the derivatives by every parameter of every
    effect around the fitted base model. n ln(RSS/n) + k ln n is minimised one effect at a time,
    forwards, then backwards. Rows of one group are independent and of one variance, nothing is held
    out and nothing is refitted: what a textbook does with the same dictionary.

    References
    ----------
    Schwarz, Annals of Statistics 6(2), 1978, 461, doi:10.1214/aos/1176344136.

    """
    model = ModelSpec("standard")
    base = base_fit(campaign, model, start_constants(campaign))
    if isinstance(base, str):
        return None
    offered = candidates(effects(model.effects_path), base.system.fit.model)
    wide = widened(base.system.fit, offered, base.system)
    blocks: dict[str, list[NDArray[np.int64]]] = {}
    for candidate, places in placed(wide, offered):
        blocks.setdefault(candidate.effect.name, []).append(places)
    prior = np.diag(np.sqrt(wide.prior_precision))
    matrix = np.vstack([wide.matrix, prior])
    target = np.concatenate([-wide.residual, np.zeros(prior.shape[0])])
    scale = np.linalg.norm(matrix, axis=0)
    return _chosen(matrix / np.maximum(scale, 1e-300), target, wide.model_columns, blocks)


def _chosen(
    matrix: Array,
    target: Array,
    own: NDArray[np.int64],
    blocks: Mapping[str, Sequence[NDArray[np.int64]]],
) -> tuple[str, ...]:
    """Names of the blocks of columns that lower the criterion, the most helpful first."""
    normal, right = matrix.T @ matrix, matrix.T @ target
    n, power = target.size, float(target @ target)

    def criterion(found: Mapping[str, NDArray[np.int64]]) -> float:
        at = np.concatenate([own, *found.values()]).astype(np.int64)
        ridge = 1e-9 * np.eye(at.size)
        step = np.linalg.solve(normal[np.ix_(at, at)] + ridge, right[at])
        left = max(power - float(right[at] @ step), 1e-12 * power)
        return n * math.log(left / n) + math.log(n) * at.size

    found: dict[str, NDArray[np.int64]] = {}
    best = criterion(found)
    while len(found) < MOST:
        tried = [
            (criterion({**found, name: places}), name, places)
            for name, shapes in blocks.items()
            if name not in found
            for places in shapes
        ]
        least, name, places = min(tried, key=lambda one: one[0])
        if least >= best:
            break
        best, found = least, {**found, name: places}
        for other in [one for one in found if one != name]:
            without = {one: at for one, at in found.items() if one != other}
            if criterion(without) < best:
                best, found = criterion(without), without
    return tuple(found)


METHODS: Mapping[str, Method] = {"stepwise_bic": stepwise_bic, "pysindy": weak_sindy}


def judged_by(method: str) -> Diagnose:
    """A method as the benchmark calls it."""
    return partial(answer, method)


def answer(method: str, campaign: Campaign, _: str) -> dict[str, Any]:
    """What a method says of a campaign, in the keys of a diagnosis that a mark looks at."""
    names = METHODS[method](campaign)
    verdict = "unknown" if names is None else "missing" if names else "adequate"
    named = list(names or ())
    ranking = [{"effect": name, "confused_with": []} for name in named]
    return {"verdict": verdict, "missing": named, "ranking": ranking, "remainder": []}
