"""The channels of a segment: their size, their unit, and their name in outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.equation import Channel
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.operating import Values
from pipeline.criticism.parameter import Machine


def channel_of(segment: Segment, name: str) -> Channel:
    """The channel of a segment, as its equation declares it.

    Parameters
    ----------
    segment
        The segment.
    name
        Recorded signal of the channel.

    """
    return equation_of(segment).channel(name)


def reported_signal(segment: Segment, channel: str) -> str:
    """The name of a channel in outputs.

    Parameters
    ----------
    segment
        The segment.
    channel
        Recorded signal; of a coasting shaft the equation gives an acceleration.

    """
    return channel_of(segment, channel).reported or channel


def of_acceleration(segment: Segment, channel: str) -> bool:
    """Whether a residual is one of acceleration: of a shaft that runs free.

    Parameters
    ----------
    segment
        The segment.
    channel
        Recorded signal of the channel.

    """
    return channel_of(segment, channel).acceleration


def reported_unit(segment: Segment, values: Values) -> float:
    """What one unit of the residual is in the unit of the channel.

    Parameters
    ----------
    segment
        The segment.
    values
        Parameters by full name.

    Returns
    -------
    float
        J for a free shaft whose acceleration [rad/s²] is reported as a torque [N·m], else 1.

    """
    as_torque = any(channel_of(segment, name).as_torque for name in segment.channels)
    return values["j_kgm2"] if as_torque else 1.0


def channel_scale(segment: Segment, channel: str, machine: Machine, values: Values) -> float:
    """The machine's own size in the unit of a channel.

    Parameters
    ----------
    segment
        The segment.
    channel
        Recorded signal of the channel.
    machine
        Its scales.
    values
        Parameters by full name.

    Returns
    -------
    float
        Of a bench meter its largest reading, of an axis whose current is zero that of the other
        axis.

    """
    observed = channel_of(segment, channel)
    if not observed.scale:
        # an axis that stands still has the scale of the other one
        return largest_reading(segment, observed.beside or (channel,))
    scale = machine.scales[observed.scale]
    return scale / values["j_kgm2"] if observed.acceleration and not observed.as_torque else scale


def largest_reading(segment: Segment, names: Sequence[str]) -> float:
    """Largest magnitude of some recorded signals.

    Parameters
    ----------
    segment
        The segment.
    names
        Recorded signals.

    """
    return max(float(np.abs(segment.recorded[name]).max()) for name in names)
