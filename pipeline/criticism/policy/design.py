"""Constants of judgement of `design`: further experiments, and what they would discriminate."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Experiments that are suggested, and the tests whose outcome is predicted."""

    false_alarm: float = chosen(
        0.01, "1", "probability of a false alarm of the test whose power is reported",
        why="the usual level of a test that somebody records captures for",
    )  # fmt: skip
    repeats: int = chosen(
        4, "1", "recordings of a test when it is repeated", why="they halve its noise"
    )
    calibrated_u: float = chosen(
        2e-3, "1", "standard uncertainty of a calibrated instrument, as a share",
        why="an instrument of class 0.2",
    )  # fmt: skip
    most_experiments: int = chosen(
        3, "1", "experiments that are reported at the most", why="a longer list is not read"
    )
    least_power: float = chosen(
        0.02, "1", "power that an experiment must add to be reported", why="less decides nothing"
    )
    map_speeds: tuple[float, ...] = chosen(
        (0.3, 0.8, -0.3, -0.8), "1", "speeds of a planned torque map, as shares of the largest",
        why="as benches run it",
    )  # fmt: skip
    map_id: tuple[float, ...] = chosen(
        (-0.4, 0.0), "1", "d currents of a planned torque map, as shares of the largest",
        why="as benches run it",
    )  # fmt: skip
    map_iq: tuple[float, ...] = chosen(
        (-0.9, -0.45, 0.0, 0.45, 0.9), "1",
        "q currents of a planned torque map, as shares of the largest",
        why="as benches run it",
    )  # fmt: skip
    map_samples: int = chosen(
        800, "samples", "length of a level of a planned torque map",
        why="as benches run it; the reported power grows with it",
    )  # fmt: skip
    slow_rad_s: float = chosen(
        2.0, "rad/s", "speed of a planned slow turn", why="as benches run it"
    )
    samples_an_order: int = chosen(
        24, "samples a wave", "samples of a planned slow turn, of its highest order",
        why="as benches run it; the reported power grows with it",
    )  # fmt: skip
    coast_samples: int = chosen(
        1200, "samples", "length of a planned spin-down",
        why="as benches run it; the reported power grows with it",
    )  # fmt: skip
    noise_current: float = chosen(
        5e-4, "machine scales", "noise of a current sensor that the captures do not show",
        why="a sensor of eleven bits over its range",
    )  # fmt: skip
    noise_voltage: float = chosen(
        5e-4, "machine scales", "noise of a voltage that the captures do not show",
        why="a sensor of eleven bits over its range",
    )  # fmt: skip
    noise_torque: float = chosen(
        1e-3, "machine scales", "noise of a torque transducer that the captures do not show",
        why="a transducer of class 0.1",
    )  # fmt: skip
    noise_angle_rad: float = chosen(
        2e-5, "rad", "noise of an encoder that the captures do not show",
        why="rounding of an encoder of 17 bits is 1.4e-5",
    )  # fmt: skip
