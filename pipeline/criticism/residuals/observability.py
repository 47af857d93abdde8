"""What the equation of a segment observes of constants, hooks and sensors."""

from __future__ import annotations

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Hooks
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import LATE_TORQUE, OF_SIGNALS, PHASE_LCR
from pipeline.criticism.parameter import Machine


def observes_sensor(segment: Segment, sensor: str) -> bool:
    """Whether an error of a sensor is in the equation of a segment.

    Parameters
    ----------
    segment
        The segment.
    sensor
        `angle`, `current`, `voltage`, `load`, `clock` or `lcr`.

    """
    if sensor == "load" and "torque_shaft_nm" not in segment.channels:
        return False
    return sensor in equation_of(segment).observes.sensors


def observes(segment: Segment, effect: Hooks) -> bool:
    """Whether an effect is in the equation of a segment at all.

    Parameters
    ----------
    segment
        The segment.
    effect
        Its hooks.

    """
    if effect.hook == "sensor":
        return any(observes_sensor(segment, sensor) for sensor in _sensors_of(effect))
    observed = equation_of(segment).observes
    if effect.parallel is not None and {"flux", "drop"} <= observed.hooks:
        return True
    if effect.torque is not None and "torque" in hooks_in(segment):
        return True
    return effect.hook != "torque" and effect.hook in observed.hooks


def constants_in(segment: Segment, machine: Machine) -> frozenset[str]:
    """Constants of the base that are in the equation of a segment, gains of its sensors among them.

    Parameters
    ----------
    segment
        The segment.
    machine
        Determines which constants there are.

    """
    instrument = segment.instrument
    of_sensors = {
        instrument.transducer: observes_sensor(segment, "load"),
        LATE_TORQUE: observes_sensor(segment, "load"),
        "gain_lcr": observes_sensor(segment, "lcr"),
        PHASE_LCR: observes_sensor(segment, "lcr"),
        instrument.thermometer: any(name.startswith("temp_") for name in segment.recorded),
        "gain_clock": observes_sensor(segment, "clock"),
        instrument.meter: observes_sensor(segment, "voltage"),
        instrument.ammeter: observes_sensor(segment, "current"),
    }
    of_signals = {*OF_SIGNALS, *machine.stated_u, *machine.unlogged}
    observed = {name for name in of_signals if of_sensors.get(name, name in segment.fixed)}
    return frozenset(observed | (set(equation_of(segment).observes.constants) - OF_SIGNALS))


def hooks_in(segment: Segment) -> frozenset[str]:
    """Hooks of the machine that a segment's equation has in it: a drag only with its channel.

    Parameters
    ----------
    segment
        The segment.

    Returns
    -------
    frozenset of str
        Of `flux`, `drop` and `torque`.

    """
    observed = equation_of(segment).observes
    torque_in = observed.torque_in
    without = {"torque"} if torque_in and torque_in not in segment.channels else set()
    return observed.hooks - without


def _sensors_of(effect: Hooks) -> tuple[str, ...]:
    hooks = {
        "angle": (effect.angle,),
        "current": (effect.current,),
        "voltage": (effect.voltage,),
        "load": (effect.load, effect.shaft),
        "clock": (effect.clock,),
    }
    return tuple(name for name, any_of in hooks.items() if any(h is not None for h in any_of))
