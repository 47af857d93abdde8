"""Whether an effect is confirmed by more than the one capture that supports it.

A capture held out in turn is predicted by an effect that the others have fitted. One capture may
gain so much that the sum gains, while every other that the effect moves is predicted worse or as
before: such an effect takes up what that capture alone has.

Reference: Stone, J. R. Stat. Soc. B 36 (1974) 111, doi:10.1111/j.2517-6161.1974.tb00994.x
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.criticism.operating import Array
from pipeline.criticism.regression.cross_validation import HeldOut, predicted_chi2
from pipeline.criticism.regression.linear_system import LinearSystem


def rests_on(systems: Sequence[LinearSystem], held_out: Sequence[HeldOut]) -> str | None:
    """`only_capture` of the step from the first of two fits to the second.

    Parameters
    ----------
    systems
        The fits before and after the step.
    held_out
        Their held-out residuals.

    Returns
    -------
    str or None
        Path of the capture.

    """
    without, after = (predicted_chi2(s, h) for s, h in zip(systems, held_out, strict=True))
    return only_capture(systems[-1], without, after)


def only_capture(tried: LinearSystem, before: Array, after: Array) -> str | None:
    """The only capture that supports the newest effect, though others could show it.

    Parameters
    ----------
    tried
        Around the fit with the effect.
    before, after
        χ²/n [G] of captures predicted from the others, without and with it.

    Returns
    -------
    str or None
        Its path, if of the captures that the effect moves by more than a `tie` of deviance those
        beside the one that gains most do not gain in sum, in the groups that it acts on. An effect
        that moves no other capture cannot be confirmed there: None. One that it does
        not act on, which other parameters alone move with it, can show nothing of it.

    Notes
    -----
    What an effect moves is its part of the residual that the other parameters do not absorb, in
    units of what is left there without it. So a capture that the effect explains wholly shows at
    most its number of windows of it, and none beside the nuisance that the effect stands for. Less
    than a share `form_error` of what the effect does there may be what the tangent is wrong by. A
    capture whose own deviance falls by more than a `tie` where the effect acts is moved by it, too.

    """
    fit = tried.fit
    name = f"{fit.model.effects[-1].name}."
    known = fit.model.parameters()
    columns = [n for n, c in enumerate(tried.columns) if c.name.startswith(name)]
    columns = [n for n in columns if known[tried.columns[n].name][1].amplitude]
    others = np.setdiff1d(tried.model_columns, columns)
    size = np.array([fit.values[tried.columns[n].name] for n in columns])
    weight = np.sqrt(tried.weights(np.maximum(before, after)))
    whole = weight * (tried.matrix[:, columns] @ size)
    beside = tried.matrix[:, others] * weight[:, None]
    scale = np.maximum(np.sqrt((beside**2).sum(axis=0)), 1e-300)
    moved = whole - beside / scale @ np.linalg.lstsq(beside / scale, whole, rcond=1e-9)[0]
    paths = [segment.capture for segment in tried.segments]
    names = list(dict.fromkeys(paths))
    of_group = np.array([names.index(paths[number]) for number, _, _ in tried.labels])
    was, now = (
        tried.counts * (np.log(np.maximum(q, 1.0)) + np.minimum(q, 1.0)) for q in (before, after)
    )
    acts = np.bincount(tried.group, np.any(tried.matrix[:, columns], axis=1), len(tried.labels)) > 0
    moved[~acts[tried.group]] = 0.0
    power, of_whole = (
        np.bincount(of_group[tried.group], one**2, len(names)) for one in (moved, whole)
    )
    share = fit.policy.selection.form_error
    gain = np.bincount(of_group[acts], (was - now)[acts], len(names))
    tie = fit.policy.selection.tie
    could = ((power > tie) & (power > share**2 * of_whole)) | (gain > tie)
    most = int(np.argmax(gain))
    could[most] = False
    alone = bool(could.any()) and float(gain[could].sum()) <= 0.0
    return names[most] if alone else None
