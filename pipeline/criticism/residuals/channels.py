"""The channels of a segment: their size, their unit, and their name in outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Machine, Values
from pipeline.criticism.equation import Channel
from pipeline.criticism.library.equations import equation_of


def channel_of(segment: Segment, name: str) -> Channel:
    """What the equation of a segment says of one of its channels."""
    return equation_of(segment).channel(name)


def reported_signal(segment: Segment, channel: str) -> str:
    """A channel as outputs name it: of a coasting shaft the equation gives an acceleration."""
    return channel_of(segment, channel).reported or channel


def of_acceleration(segment: Segment, channel: str) -> bool:
    """Whether an equation is one of accelerations [rad/s²]: of a shaft that runs free."""
    return channel_of(segment, channel).acceleration


def reported_unit(segment: Segment, values: Values) -> float:
    """The channel's own unit a unit of the residual: a free shaft's is an acceleration [rad/s²]."""
    as_torque = any(channel_of(segment, name).as_torque for name in segment.channels)
    return values["j_kgm2"] if as_torque else 1.0


def channel_scale(segment: Segment, channel: str, machine: Machine, values: Values) -> float:
    """The machine's own size in a channel's unit; of a bench meter its largest reading."""
    one = channel_of(segment, channel)
    if not one.scale:
        # an axis that stands still has the scale of the other one
        return largest_reading(segment, one.beside or (channel,))
    scale = machine.scales[one.scale]
    return scale / values["j_kgm2"] if one.acceleration and not one.as_torque else scale


def largest_reading(segment: Segment, names: Sequence[str]) -> float:
    """Largest magnitude of any of these recorded signals."""
    return max(float(np.abs(segment.recorded[name]).max()) for name in names)
