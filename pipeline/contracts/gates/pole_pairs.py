"""Wrong pole pairs: the back-EMF's cycles a turn against the nameplate."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.rotation import turning
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "pole_pairs_not_whole"
UNITS = {180.0 / math.pi: "the angle is in degrees", 30.0 / math.pi: "the speed is in rpm"}
REMEDY = "correct `pole_pairs`; until then the count from the data is used"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns where the count of cycles a turn is no whole number, or another than the nameplate's.

    Notes
    -----
    The count is that of `rotation.turning`, with its standard uncertainty u. Not looked at below
    `cycles` electrical cycles, or with u above `largest_u` [1]. No whole number is one that is off
    by more than `from_whole` + 2 u [1]; where degrees or rpm would make it whole, the capture is
    refused.

    """
    turned = turning(capture)
    if turned is None or turned.cycles < options["cycles"] or turned.u > options["largest_u"]:
        return Passed()
    count = abs(turned.cycles_per_turn)
    counted, stated = round(count), capture.meta.pole_pairs
    off = abs(count - counted)
    if counted == 0 or off > options["from_whole"] + 2.0 * turned.u:
        words = f"the back-EMF makes {count:.3f} cycles a turn of the shaft, no whole number"
        cause = _unit(count, turned.u, options["from_whole"], stated)
        if cause:
            raise CaptureError(CODE, f"{words}: {cause}", "map the unit in conf/source")
        remedy = "check the angle's unit, for slip of its coupling, and for a gear"
        return Passed(findings=(warning(capture, CODE, words, remedy),))
    if stated is not None and stated != counted:
        words = f"the back-EMF makes {count:.3f} cycles a turn; the nameplate says {stated}"
        if stated == 2 * counted:
            words = f"{words}, which is the number of poles"
        return Passed(findings=(warning(capture, "pole_pairs_nameplate", words, REMEDY),))
    return Passed()


def _unit(count: float, u: float, from_whole: float, stated: int | None) -> str:
    """The foreign units in which the count would be a whole number, in words, or an empty text.

    That number has to be the nameplate's, or the count below one half, which no motor has: a slip
    or a gear may meet a unit's factor by chance. Whatever is whole in rpm is so in degrees too, so
    the one that makes the nameplate's number goes first.
    """
    readings: list[tuple[bool, str]] = []
    for factor, words in UNITS.items():
        cycles = count * factor
        whole = round(cycles)
        close = abs(cycles - whole) <= from_whole + 2.0 * u * factor
        if close and u * factor < 0.1 and whole > 0 and (whole == stated or count < 0.5):
            readings.append((whole == stated, f"{words}, which makes {cycles:.3f}"))
    return ", or ".join(
        words for same, words in readings if same or not any(one for one, _ in readings)
    )


GATE = Gate(
    "pole_pairs",
    ("open_circuit", "hand_turn"),
    check,
    {
        # Fewer cycles do not separate neighbouring counts.
        "cycles": 3.0,
        # Five standard uncertainties within half a count; an angle this poor is not counted on.
        "largest_u": 0.1,
        # Physics: p = f_elec / f_mech within 0.02 of a whole number.
        "from_whole": 0.02,
    },
    follows=("stuck_channel", "wrapped_angle"),
)
