"""What constants of a station cost is evidence of an effect where the captures are explained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection.acceptance import _improves_held_out
from tests.unit.criticism.machines import fitted, log

VOLTAGES, TORQUE = ("vd_v", "vq_v"), ("torque_shaft_nm",)


def missed(segment: Segment, signals: tuple[str, ...]) -> Segment:
    """The log with a wave in time that no model has, of some signals."""
    wave = np.sin(300.0 * np.arange(segment.recorded["vd_v"].size) * segment.ts_s)
    waved = {name: segment.recorded[name] + 0.3 * wave for name in signals}
    return replace(segment, recorded={**segment.recorded, **waved})


@pytest.mark.parametrize(
    ("signals", "counts"), [((), True), (TORQUE, True), (VOLTAGES + TORQUE, False)]
)
def test_a_gain_of_six_usual_ones_is_evidence_where_a_signal_is_explained(
    signals: tuple[str, ...], counts: bool
) -> None:
    """A sensor that compresses disagrees with another one, and is no scale: nothing fits."""
    fit = fitted([missed(log(noise=1.0), signals)])
    scale, gain = effects()["current_scale"], 6.0 * fit.model.priors()["gain_current"][1]
    strained = replace(fit, values={**fit.values, "gain_current": gain})
    own = {f"current_scale.{p.name}": 0.0 for p in scale.parameters_of(fit.machine)}
    own["current_scale.of_drive"] = 1.0
    model = fit.model.with_effects(scale)
    wide, tried = (
        linear_system(one) for one in (strained, replace(fit, model=model, values=fit.values | own))
    )
    chi2, same = tried.reduced_chi2(tried.residual), np.ones(len(tried.labels))
    least = 10.0, 1e9
    assert _improves_held_out(wide, chi2, tried, chi2, least, (same, same)) == counts
