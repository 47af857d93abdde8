"""Every plot shows what was read, in its unit and place, and a fit that lies on it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.estimation.test_scales import PLANS, campaign, plain_fit


def read(name: str, column: str) -> np.ndarray:
    """All values of a column in the captures of an estimator."""
    found = [
        t[column].to_numpy()
        for c in campaign(name).captures
        for t in c.tables
        if column in t.columns
    ]
    values = np.concatenate(found) if found else np.zeros(0)
    return values[np.isfinite(values)]


# What is told by an angle within a turn, or from the start of a coast.
OTHER_ZERO = {"theta_mech_rad"}


@pytest.mark.parametrize("name", PLANS)
def test_plots_show_what_was_read(name: str) -> None:
    """Within the range of the column that an axis names; means never reach beyond their samples."""
    for plot in plain_fit(name).evidence:
        for series in plot.series:
            assert series.x.size == series.measured.size
            for axis, values in ((plot.x_name, series.x), (plot.y_name, series.measured)):
                column = read(name, axis)
                if not column.size or axis in OTHER_ZERO:
                    continue
                room = 0.02 * float(np.ptp(column)) + 1e-9
                assert values.min() >= column.min() - room, (plot.title, axis)
                assert values.max() <= column.max() + room, (plot.title, axis)
            if plot.x_name == "t_s":
                assert np.all(np.diff(series.x) > 0.0), plot.title


# Of the spread of what is shown, that a fit may leave: friction has no order, noise little room.
LEFT = {"holding_current": 0.15, "cogging": 0.07}


@pytest.mark.parametrize("name", PLANS)
def test_fits_lie_on_what_they_are_drawn_over(name: str) -> None:
    for plot in plain_fit(name).evidence:
        for series in plot.series:
            if series.fitted.size == 0:
                continue
            assert series.fitted.size == series.measured.size
            left = float(np.sqrt(np.mean((series.measured - series.fitted) ** 2)))
            room = LEFT.get(name, 0.02) * float(np.std(series.measured))
            # Levels that do not spread: a flux at each speed, an inductance of each step.
            assert left < max(room, 2e-3 * abs(float(np.mean(series.measured)))), plot.title
