"""The DC link of an inverter, as a capture shows it."""

from __future__ import annotations

import math

import numpy as np

from pipeline.records.capture import Capture


def link_voltage_v(capture: Capture) -> float:
    """The DC link's voltage: logged, stated, or what the phases need at least [V].

    Parameters
    ----------
    capture
        Of a drive.

    """
    stated = max(largest(capture, "vdc_v"), capture.meta.vdc_v or 0.0)
    return max(stated, math.sqrt(3.0) * largest(capture, "vq_v"))


def largest(capture: Capture, name: str) -> float:
    """The size that a column reaches, strays aside; 0 where it is not there.

    Parameters
    ----------
    capture
        Any capture.
    name
        Of the column, in whose unit the size is.

    """
    values = np.abs(capture.finite(name)[name]) if capture.has(name) else np.zeros(0)
    return float(np.percentile(values, 95.0)) if values.size else 0.0
