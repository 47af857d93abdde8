"""What an equation is: the physics that a kind of test is held against.

An equation takes the captures of its tests as segments, says what their sensors should have shown
by the machine's model, and what that shows of the model. It is one file in `equations/` with one
`EQUATION`; CONTRIBUTING.md shows how to add one, here or in a package of your own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.records.capture import Capture

Cut = Callable[[Capture, Machine], Segment | None]
State = Callable[[Segment, Signals, Model, Values], Operating]
Measured = Callable[[Segment, Signals, Model, Values], Array]
Predicted = Callable[[Segment, Operating, Pieces, Model, Values], Array]
Reading = Callable[[Segment, str, Model, Values], Array]
Begins = Callable[[Segment, Machine], Values]
Sensed = Callable[[Segment, Array, Model, Values], Signals]


@dataclass(frozen=True, slots=True)
class Channel:
    """One scalar equation of a segment: a signal that is predicted, and how large its errors are.

    Attributes
    ----------
    name
        The recorded signal.
    scale
        Entry of `Machine.scales` that is the machine's own size in it. Without one the signal is a
        bench meter's, and its size is the largest reading of it and of those `beside` it.
    beside
        Signals of the same size: an axis whose current is zero has the size of the other. With a
        `scale` as well, an error also matters that is large beside the readings.
    reported
        Name of the signal in outputs, if another.
    acceleration
        Whether the residual is one of a free shaft's acceleration [rad/s²].
    as_torque
        Whether it is reported times the inertia [N·m].
    offset
        What a sensor may be off by in a whole capture: a share of its noise, the zero of a bench's
        voltmeter or torque transducer as well, or nothing.
    counts
        Whether the motor answers for an error in it: not for one of a column that another overrules
        (contract: where the angle is there, the angle counts).

    """

    name: str
    scale: str = ""
    beside: tuple[str, ...] = ()
    reported: str = ""
    acceleration: bool = False
    as_torque: bool = False
    offset: Literal["noise", "voltmeter", "transducer", "none"] = "noise"
    counts: bool = True


@dataclass(frozen=True, slots=True)
class Observes:
    """What an equation contains, and so may observe.

    Attributes
    ----------
    constants
        Constants of the base model (`machine.model.BASE`).
    hooks
        Of effects: `flux`, `drop`, `torque`.
    sensors
        Whose errors are in it: `angle`, `current`, `voltage`, `load`, `clock`, `lcr`.
    torque_in
        The only channel that a drag is in, as that much torque; a segment without that channel does
        not observe it.
    form
        Whether the prediction is linear in what the hooks give, affine, or neither, so that columns
        must be found by differences.

    """

    constants: tuple[str, ...] = ()
    hooks: frozenset[str] = frozenset()
    sensors: frozenset[str] = frozenset()
    torque_in: str = ""
    form: Literal["linear", "affine", "neither"] = "linear"


@dataclass(frozen=True, slots=True)
class Sensing:
    """What the sensors add to an equation that no model predicts.

    Attributes
    ----------
    reading
        (segment, channel, model, values) -> what the linearity of a sensor is a share of [n, the
        channel's unit]; None for the recorded signal itself.
    errors
        Those of `voltage_jumps`, `unsampled`, `instants`, `current_jumps`, `torque_jumps`,
        `encoder_lines`, `standstill`, `pulses` and `late_speed` that an equation of a drive's log
        has.
    sensors
        Recorded signals that the channels are made of, where these are not the signals themselves.
    sensed
        (segment, residual, model, values) -> the residual of each of `sensors` [n].

    """

    reading: Reading | None = None
    errors: frozenset[str] = frozenset()
    sensors: tuple[str, ...] = ()
    sensed: Sensed | None = None


@dataclass(frozen=True, slots=True)
class NamedCombination:
    """A function of a model's parameters that an equation determines where it does not determine
    the parameters one by one.

    Attributes
    ----------
    expression
        Its name and what it is of the parameters, as it is reported.
    unit
        Its unit.
    of
        The parameters in it; it is reported where one of them is not determined alone.
    value
        (segment, model, values) -> the number, as it was in the first segment of the equation.

    """

    expression: str
    unit: str
    of: tuple[str, ...]
    value: Callable[[Segment, Model, Values], float]


@dataclass(frozen=True, slots=True)
class Use:
    """What segments of an equation serve for, beside the fit.

    Attributes
    ----------
    turns
        Whether the machine turns in it, if only in steps; a diagnosis needs such a test.
    warms
        Hooks whose effects grow in it with a temperature.
    at_rest
        Whether in it no drive warmed the winding.
    free_runs
        Tests in which the model is also simulated freely.
    currents
        State of such a simulation; a log with currents is searched for orders too.
    angle_maps
        Whether errors are mapped over the turn.
    whole_beside
        Equations beside whose segments one of this is held out as a whole, where these determine
        all that it does, and not in its blocks.
    combinations
        What it determines of parameters that it does not determine one by one.

    """

    turns: bool = False
    warms: frozenset[str] = frozenset()
    at_rest: bool = False
    free_runs: tuple[str, ...] = ()
    currents: tuple[str, ...] = ()
    angle_maps: bool = False
    whole_beside: tuple[str, ...] = ()
    combinations: tuple[NamedCombination, ...] = ()


@dataclass(frozen=True, slots=True)
class Equation:
    """The equation of a kind of test.

    Parameters
    ----------
    name : str
        Name of the equation, which its segments have as their `kind`.
    words : str
        The formula in a line.
    tests : tuple of str
        Tests whose captures it takes (`physics.glossary.TESTS`).
    columns : tuple of str
        Columns without which a capture is not taken; `cut` may ask for more.
    channels : tuple of Channel
        Every channel that its segments may have.
    cut : callable (capture, machine) -> Segment or None
        The signals of one capture on an even clock, with noise and windows.
    state : callable (segment, signals, model, values) -> Operating
        True currents, angle and speed [n], the errors of the sensors taken out.
    measured : callable (segment, signals, model, values) -> array [C, n]
        What the sensors recorded, in the units of the prediction.
    predicted : callable (segment, x, pieces, model, values) -> array [C, n]
        What they should have recorded, from flux, drop and drag at the true state.
    observes : Observes
        Constants, hooks and sensors that are in it.
    recorder : str or None
        Whose clock it goes by (`effect.RECORDERS`); None of a table.
    sensing, use : Sensing, Use
        What the sensors add, and what else such segments serve for.
    begins : callable (segment, machine) -> mapping, or None
        Values of constants that its signals show at once, where a fit from their usual ones might
        end elsewhere.
    rank : int
        Place among the segments of one capture, the lowest first; then by name.

    Notes
    -----
    `state`, `measured` and `predicted` get the segment on its true clock: the model's own clock
    error is taken out of `ts_s` before. The residual is `measured - predicted`. They are called
    with noise added to `signals`, so they read recorded signals from there alone.

    """

    name: str
    words: str
    tests: tuple[str, ...]
    columns: tuple[str, ...]
    channels: tuple[Channel, ...]
    cut: Cut
    state: State
    measured: Measured
    predicted: Predicted
    observes: Observes
    recorder: str | None = None
    sensing: Sensing = field(default_factory=Sensing)
    use: Use = field(default_factory=Use)
    begins: Begins | None = None
    rank: int = 0

    def channel(self, name: str) -> Channel:
        """The channel of a signal.

        Parameters
        ----------
        name
            The recorded signal.

        Returns
        -------
        Channel
            One with nothing but the name where the equation has no such channel.

        """
        return next((one for one in self.channels if one.name == name), Channel(name))
