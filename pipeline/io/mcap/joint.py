"""sensor_msgs/JointState: one joint's position, velocity and effort out of many."""

from __future__ import annotations

import numpy as np

from pipeline.io.mcap.leaf import Leaf
from pipeline.io.mcap.messages import Batch
from pipeline.io.mcap.walk import Integers
from pipeline.records.errors import CaptureError

JOINT_STATE = frozenset({"sensor_msgs/msg/JointState", "sensor_msgs/JointState"})
QUANTITIES = ("position", "velocity", "effort")


def pick_joint(batch: Batch, leaves: dict[str, Leaf], joint: str | None) -> dict[str, Leaf]:
    """The quantities of one joint of joint states.

    Parameters
    ----------
    batch
        Messages of the type sensor_msgs/JointState.
    leaves
        Their decoded fields.
    joint
        Name of the joint; None means the only one.

    Returns
    -------
    dict
        Leaves by name: position, velocity and effort [messages] of the joint, a quantity that no
        message holds left out, and the fields that are no arrays.

    Raises
    ------
    CaptureError
        The joint is not stated and several are there, it is missing from a message, or a message
        has another number of values than of names (`joint`).

    References
    ----------
    ROS 2, sensor_msgs/msg/JointState.

    """
    found = {name: leaf for name, leaf in leaves.items() if leaf.counts is None}
    names = leaves.get("name")
    if names is None or names.counts is None:
        raise _bad("a joint state has no list of names")
    counts = names.counts
    at = _place(batch, names, counts, joint)
    for quantity in QUANTITIES:
        leaf = leaves.get(quantity)
        if leaf is None or leaf.counts is None or not leaf.counts.any():
            continue
        if np.any((leaf.counts != 0) & (leaf.counts != counts)):
            raise _bad(f"a joint state has another number of {quantity} values than of joints")
        first = np.cumsum(leaf.counts) - leaf.counts
        values = np.full(counts.size, np.nan)
        there = leaf.counts > 0
        values[there] = leaf.values.reshape(-1)[(first + at)[there]]
        found[quantity] = Leaf(values)
    return found


def _bad(message: str) -> CaptureError:
    return CaptureError(
        "joint", message, "name the joint as `joint` in the metadata or the source map"
    )


def _place(batch: Batch, names: Leaf, counts: Integers, joint: str | None) -> Integers:
    """Place of the joint within each message [messages]."""
    if counts.size == 0 or counts.min() == 0:
        raise _bad("a joint state names no joint")
    start, length = names.values[:, 0], names.values[:, 1]
    if joint is None:
        if counts.max() > 1:
            raise _bad(f"the joint states name {int(counts.max())} joints, none is chosen")
        return np.zeros(counts.size, np.int64)
    target = joint.encode() + b"\0"
    raw = np.frombuffer(batch.buffer, np.uint8)
    same = length == len(target)
    for offset, byte in enumerate(target):
        same &= raw[np.minimum(start + offset, raw.size - 1)] == byte
    whose = np.repeat(np.arange(counts.size), counts)
    place = np.arange(whose.size) - np.repeat(np.cumsum(counts) - counts, counts)
    hits = np.bincount(whose[same], minlength=counts.size)
    if np.any(hits != 1):
        row = int(np.argmax(hits != 1))
        raise CaptureError(
            "joint",
            f"the joint {joint!r} is not there exactly once",
            "check the joint's name with `inspect`",
            (row, row),
        )
    chosen: Integers = place[same].astype(np.int64)
    return chosen
