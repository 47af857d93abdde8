"""Constants of judgement of `design`: further experiments, and what they would discriminate."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Experiments that are suggested, and the tests whose outcome is predicted.

    Attributes
    ----------
    false_alarm : 1
        probability of a false alarm of the test whose power is reported
        chosen: the usual level of a test that somebody records captures for
    repeats : 1
        recordings of a test when it is repeated
        chosen: they halve its noise
    calibrated_u : 1
        standard uncertainty of a calibrated instrument, as a share
        chosen: an instrument of class 0.2
    most_experiments : 1
        experiments that are reported at the most
        chosen: a longer list is not read
    least_power : 1
        power that an experiment must add to be reported
        chosen: less decides nothing
    map_speeds : 1
        speeds of a planned torque map, as shares of the largest
        chosen: as benches run it
    map_id : 1
        d currents of a planned torque map, as shares of the largest
        chosen: as benches run it
    map_iq : 1
        q currents of a planned torque map, as shares of the largest
        chosen: as benches run it
    map_samples : samples
        length of a level of a planned torque map
        chosen: as benches run it; the reported power grows with it
    slow_rad_s : rad/s
        speed of a planned slow turn
        chosen: as benches run it
    samples_an_order : samples a wave
        samples of a planned slow turn, of its highest order
        chosen: as benches run it; the reported power grows with it
    coast_samples : samples
        length of a planned spin-down
        chosen: as benches run it; the reported power grows with it
    noise_current : machine scales
        noise of a current sensor that the captures do not show
        chosen: a sensor of eleven bits over its range
    noise_voltage : machine scales
        noise of a voltage that the captures do not show
        chosen: a sensor of eleven bits over its range
    noise_torque : machine scales
        noise of a torque transducer that the captures do not show
        chosen: a transducer of class 0.1
    noise_angle_rad : rad
        noise of an encoder that the captures do not show
        chosen: rounding of an encoder of 17 bits is 1.4e-5

    """

    false_alarm: float = 0.01
    repeats: int = 4
    calibrated_u: float = 2e-3
    most_experiments: int = 3
    least_power: float = 0.02
    map_speeds: tuple[float, ...] = (0.3, 0.8, -0.3, -0.8)
    map_id: tuple[float, ...] = (-0.4, 0.0)
    map_iq: tuple[float, ...] = (-0.9, -0.45, 0.0, 0.45, 0.9)
    map_samples: int = 800
    slow_rad_s: float = 2.0
    samples_an_order: int = 24
    coast_samples: int = 1200
    noise_current: float = 5e-4
    noise_voltage: float = 5e-4
    noise_torque: float = 1e-3
    noise_angle_rad: float = 2e-5
