"""The policy of criticism: every number by which a model is fitted, judged and named."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.criticism.policy.captures import Cutting, Tables
from pipeline.criticism.policy.design import Design
from pipeline.criticism.policy.discovery import Discovery
from pipeline.criticism.policy.machine import Ripple, Torsion
from pipeline.criticism.policy.priors import Priors
from pipeline.criticism.policy.regression import GaussNewton, Goodness, MainsHum, NoiseFloors
from pipeline.criticism.policy.selection import OrderScan, Selection
from pipeline.criticism.policy.sensors import SensorNoise
from pipeline.criticism.policy.validation import Validation
from pipeline.records.policy import Overrides, overrides, section, with_overrides


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """Constants of judgement by package; `docs/policy.md` lists them."""

    selection: Selection = section(Selection)
    order_scan: OrderScan = section(OrderScan)
    fit: GaussNewton = section(GaussNewton)
    noise_floors: NoiseFloors = section(NoiseFloors)
    goodness: Goodness = section(Goodness)
    mains_hum: MainsHum = section(MainsHum)
    discovery: Discovery = section(Discovery)
    validation: Validation = section(Validation)
    design: Design = section(Design)
    cutting: Cutting = section(Cutting)
    tables: Tables = section(Tables)
    priors: Priors = section(Priors)
    torsion: Torsion = section(Torsion)
    ripple: Ripple = section(Ripple)
    sensor_noise: SensorNoise = section(SensorNoise)


DEFAULT = Policy()


def policy_of(changes: Overrides) -> Policy:
    """The default policy with some of its numbers replaced."""
    return with_overrides(DEFAULT, changes) if changes else DEFAULT


def policy_changes(given: Mapping[str, Any]) -> Overrides:
    """What `conf/policy/NAME.yaml` replaces; raises UsageError for what is no field or number."""
    return overrides(DEFAULT, given)
