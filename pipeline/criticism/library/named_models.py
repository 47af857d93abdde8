"""Named models: ideal, standard, and what the user adds or takes away."""

from __future__ import annotations

from dataclasses import replace

from pipeline.criticism.library.registry import chosen
from pipeline.criticism.machine.model import Model
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.policy import policy_of
from pipeline.records.comparison import ModelSpec
from pipeline.records.errors import UsageError

MODELS: dict[str, tuple[str, ...]] = {
    "ideal": (),
    "standard": ("copper_temperature", "magnet_temperature", "coulomb_friction"),
}


def model_of(spec: ModelSpec, machine: Machine) -> Model:
    """The model that a specification asks for.

    Parameters
    ----------
    spec
        Its name, effects and policy.
    machine
        Size of the motor.

    Returns
    -------
    Model
        Effects in the order of the named model, then of the request.

    Raises
    ------
    UsageError
        There is no such model or effect.

    """
    if spec.name not in MODELS:
        raise UsageError(f"unknown model {spec.name}", f"known are {', '.join(MODELS)}")
    removed = {name[1:] for name in spec.effects if name.startswith("-")}
    extra = [name for name in spec.effects if not name.startswith("-")]
    names = [name for name in dict.fromkeys([*MODELS[spec.name], *extra]) if name not in removed]
    added = tuple(chosen(tuple(names), spec.effects_path).values())
    return Model(replace(machine, policy=policy_of(spec.policy)), added)
