"""The policy of estimation: every number of judgement by which constants are found.

A fit runs `under` one policy, as numpy's computations run under one `errstate`; what is in force
is asked for by `policy()`. Overrides, `fit.policy.SECTION.FIELD=number`, are among an estimator's
options as well, so that a cached fit depends on them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from pipeline.estimation.policy.electrical import (
    Aligned,
    AtSpeed,
    BackEmf,
    FluxPairs,
    Inverter,
    MeterTable,
    Points,
    PolePairs,
    SelfHeating,
    Steps,
)
from pipeline.estimation.policy.mechanical import (
    CoastDown,
    Cogging,
    Drag,
    DragOverTime,
    Ripple,
    RippleTorque,
    ShaftRows,
    TorqueMap,
    TorqueSlope,
)
from pipeline.estimation.policy.shared import (
    Agreement,
    CaptureSpread,
    Evidence,
    HeatRecord,
    Magnet,
    Regimes,
)
from pipeline.records.policy import Overrides, overrides, section, with_overrides


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """Numbers of judgement by what they judge; `entries` lists them with unit and origin."""

    evidence: Evidence = section(Evidence)
    agreement: Agreement = section(Agreement)
    regimes: Regimes = section(Regimes)
    capture_spread: CaptureSpread = section(CaptureSpread)
    back_emf: BackEmf = section(BackEmf)
    steps: Steps = section(Steps)
    points: Points = section(Points)
    flux_pairs: FluxPairs = section(FluxPairs)
    pole_pairs: PolePairs = section(PolePairs)
    at_speed: AtSpeed = section(AtSpeed)
    self_heating: SelfHeating = section(SelfHeating)
    meter_table: MeterTable = section(MeterTable)
    inverter: Inverter = section(Inverter)
    aligned: Aligned = section(Aligned)
    shaft_rows: ShaftRows = section(ShaftRows)
    drag: Drag = section(Drag)
    coast_down: CoastDown = section(CoastDown)
    drag_over_time: DragOverTime = section(DragOverTime)
    torque_map: TorqueMap = section(TorqueMap)
    torque_slope: TorqueSlope = section(TorqueSlope)
    ripple: Ripple = section(Ripple)
    ripple_torque: RippleTorque = section(RippleTorque)
    cogging: Cogging = section(Cogging)
    heat_record: HeatRecord = section(HeatRecord)
    magnet: Magnet = section(Magnet)


DEFAULT = Policy()
_IN_FORCE: ContextVar[Policy] = ContextVar("policy of estimation", default=DEFAULT)


def policy() -> Policy:
    """The policy that the present fit runs under."""
    return _IN_FORCE.get()


def changed(options: Mapping[str, Any]) -> Overrides:
    """What `policy` among the options of `fit` replaces, by section and field.

    Raises UsageError for what is no field or number.
    """
    return overrides(DEFAULT, options.get("policy", {}))


@contextmanager
def under(changes: Overrides) -> Iterator[Mapping[str, Any]]:
    """Puts the default policy with these changes in force; gives them as options of a fit."""
    token = _IN_FORCE.set(with_overrides(DEFAULT, changes))
    try:
        yield {f"policy.{name}": value for name, value in changes}
    finally:
        _IN_FORCE.reset(token)
