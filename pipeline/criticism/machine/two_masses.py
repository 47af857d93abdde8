"""A shaft in two parts: motor and far inertia, with a twist between them.

The coupling passes S = T − drags − (1 − f) J θ″ on to the far part, f its share of the inertia.
The far angle is θ less the twist, so that with a load at the far end

    T_load = S − f J (θ″ − twist″) = [T − drags − J θ″] + f J twist″,

while a transducer in the coupling reads S itself, [T − drags − J θ″] + f J θ″. A dynamometer that
holds the far end makes both the same; one whose speed gives way does not. Motor angle and load are
recorded; the twist is a function of S, that of a spring or of a spring behind a gap, which
`discriminator` finds from whole logs. A coasting shaft passes on next to nothing.

References: [1] Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000); [2] Nordin & Gutman, Automatica 38
(2002), backlash as a dead zone of the twist; [3] Tukey, Exploratory Data Analysis (1977), ch. 16.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.effect import Discrimination, Effect, FullLog, LinearForm, Shown
from pipeline.criticism.machine.torsion import Law, Shaft, law_of_twist
from pipeline.criticism.operating import Array, Operating, Values
from pipeline.criticism.parameter import Machine, Parameter, choice
from pipeline.criticism.policy.machine import Torsion


def passed_on(x: Operating, share: float, far_friction: float) -> Array:
    """Torque that the motor's side of a coupling passes on.

    Parameters
    ----------
    x
        State of the machine, with its torque [N·m] and angle [rad] at one or more points a sample.
    share
        Of the inertia that is at the far end [1].
    far_friction
        Of the drags that is at the far end [1].

    Returns
    -------
    array [n, N·m]
        S = T − (1 − far_friction) drags − (1 − share) J θ″ at the samples; 0 at either end, where
        the means do not reach.

    Notes
    -----
    Three running means keep the encoder's rounding out of S. They are twiced, so that a ringing up
    to a seventh of 1/block passes to one per cent.

    References
    ----------
    J. W. Tukey, Exploratory Data Analysis, Addison-Wesley, 1977, ch. 16 (twicing).

    """
    torque, theta = _sampled(x, far_friction)
    near_kgm2 = (1.0 - share) * x.base["j_kgm2"]
    return _smoothed(x, torque[1:-1] - near_kgm2 * np.diff(theta, 2) / x.ts_s**2)


def _sampled(x: Operating, far_friction: float) -> tuple[Array, Array]:
    """Torque less the near drags [N·m] and angle [rad] at the samples [n] of a state of more."""
    finer = x.shaft.finer
    torque = x.torque_nm - (1.0 - far_friction) * x.drag_nm
    return torque[::finer], x.theta_rad[::finer]


def _at_points(x: Operating, signal: Array) -> Array:
    """A signal of the samples at all points of a state, on straight lines."""
    finer = x.shaft.finer
    at = np.arange(signal.size * finer) / finer
    return np.interp(at, np.arange(signal.size), signal) if finer > 1 else signal


def _smoothed(x: Operating, inner: Array) -> Array:
    """A signal without its first and last sample [n − 2], as `passed_on` smooths it [n]."""
    block = _block(x.ts_s, x.machine.policy.torsion)
    box = np.full(block, 1.0 / block)
    smooth = np.convolve(np.convolve(box, box), box)
    kernel = 2.0 * np.pad(smooth, smooth.size // 2) - np.convolve(smooth, smooth)
    smoothed = np.zeros(inner.size + 2)
    if smoothed.size < kernel.size + 2:
        return smoothed
    first = kernel.size // 2 + 1
    smoothed[first : smoothed.size - first] = np.convolve(inner, kernel, mode="valid")
    return smoothed


def _block(period_s: float, policy: Torsion) -> int:
    """Samples of each running mean of `passed_on`, odd."""
    block = max(min(round(policy.mean_s / period_s), policy.mean_samples), 1)
    return block - (1 - block % 2)


def reach(period_s: float, policy: Torsion) -> int:
    """Samples to either side of one that a drag of two masses there is made of.

    Parameters
    ----------
    period_s
        Sample period.
    policy
        Of a coupling.

    Returns
    -------
    int
        Six half means of `passed_on`, a second difference before and behind them, and the rate by
        which a damper lags.

    """
    return 3 * (_block(period_s, policy) - 1) + 3


def linear_far_drag(x: Operating, q: Values) -> Array:
    """`far_drag` of a spring and damper, in parameters that it is linear in.

    Parameters
    ----------
    x
        State of the machine.
    q
        `torque_s2` = f J/k and `angle_s2` = f J/k (1 − f) J/J0 [s²], with J0 of `inertia_scale`;
        `torque_s3` and `angle_s3` [s³] are c/k times these; `far_friction` is that of `passed_on`.

    Returns
    -------
    array [n·m, N·m]
        −f J twist″ = −(torque_s2 T″ − angle_s2 J0 θ⁗) + (torque_s3 T″ − angle_s3 J0 θ⁗)′, with the
        torque T less the drags at the near end; 0 of a shaft that no inverter drives, and at the
        stator.

    Notes
    -----
    Whatever the inertia of a fit is, both have the right form: of `far_drag` only one combination
    has, and that at the right inertia.

    """
    if not x.inverter or x.shaft.stator:
        return np.zeros(x.theta_rad.size)
    torque, theta = _sampled(x, q["far_friction"])
    bend = np.diff(theta, 2) / x.ts_s**2
    bend *= inertia_scale(x.machine)
    twist = _smoothed(x, q["torque_s2"] * torque[1:-1] - q["angle_s2"] * bend)
    if q["torque_s3"] or q["angle_s3"]:
        late = _smoothed(x, q["torque_s3"] * torque[1:-1] - q["angle_s3"] * bend)
        twist = twist - np.gradient(late) / x.ts_s
    return _at_points(x, -np.pad(np.diff(twist, 2), 1) / x.ts_s**2)


def inertia_scale(machine: Machine) -> float:
    """Order of magnitude of an inertia: a tenth of a second to full speed.

    Parameters
    ----------
    machine
        Torque and speed scales.

    Returns
    -------
    float
        0.1 T/ω [kg·m²].

    """
    return 0.1 * machine.scales["torque_nm"] / machine.scales["speed_rad_s"]


def spring_of(q: Values, base: Values, machine: Machine) -> Values | None:
    """Parameters of `compliance` from those of `linear_far_drag`.

    Parameters
    ----------
    q
        Parameters of `linear_far_drag`.
    base
        `j_kgm2`: inertia of both parts [kg·m²].
    machine
        Its scales.

    Returns
    -------
    mapping or None
        `share` = f [1], `twist_rad` = T/k [rad] at the machine's torque T and `damping_s` = c/k, on
        a dynamometer that gives way; None where no two masses have such parameters.

    """
    soft, bent, j_kgm2 = q["torque_s2"], q["angle_s2"] * inertia_scale(machine), base["j_kgm2"]
    if min(soft, bent, j_kgm2) <= 0.0 or bent >= soft * j_kgm2:
        return None
    share = 1.0 - bent / (soft * j_kgm2)
    twist_rad = machine.scales["torque_nm"] * soft / (share * j_kgm2)
    late_s = max(q["torque_s3"] / soft, 0.0)
    return {
        "share": share,
        "twist_rad": twist_rad,
        "damping_s": late_s,
        "far_friction": q["far_friction"],
        "between": -1.0,
    }


LINEAR_COUPLING = LinearForm(
    Effect(
        name="linear_coupling",
        words="f J twist″ of a spring and damper, linear in f J/k, f J (1 − f) J/k and c/k of both",
        signature="a resonance after torque steps",
        tests=("drive", "torque_map"),
        experiment="torque steps",
        reference="Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control",
        parameters=(
            Parameter("torque_s2", "s²", 1e-5, 0.0),
            Parameter("angle_s2", "s²", 1e-5, 0.0),
            Parameter("torque_s3", "s³", 1e-9, 0.0),
            Parameter("angle_s3", "s³", 1e-9, 0.0),
            choice("far_friction", (0.0, 1.0)),
        ),
        torque=linear_far_drag,
        coupling=True,
    ),
    "torque_shaft_nm",
    spring_of,
)
"""A start of `compliance`."""


def spring_twist(x: Operating, q: Values, through_nm: Array) -> Array:
    """Twist of a spring and damper side by side, by the torque they pass on.

    Parameters
    ----------
    x
        State of the machine.
    q
        `twist_rad` at the machine's torque [rad], `damping_s` = c/k [s].
    through_nm
        Torque S [n, N·m].

    Returns
    -------
    array [n, rad]

    Notes
    -----
    S = k (twist + c/k twist′), so the twist lags S by c/k, to first order in it.

    """
    late = through_nm - q["damping_s"] / x.ts_s * np.gradient(through_nm)
    return q["twist_rad"] / x.machine.scales["torque_nm"] * late


def far_drag(x: Operating, share: float, between: float, twist_rad: Callable[[], Array]) -> Array:
    """What a far inertia takes from the shaft torque beyond a rigid shaft's.

    Parameters
    ----------
    x
        State of the machine.
    share
        Of the inertia that is at the far end [1].
    between
        1: the transducer stands between the two parts, and so reads S. 0: it is beyond them, and a
        dynamometer that holds the far end reads S too. −1: that dynamometer gives way, and what
        it reads has the far part's inertia in it. Without a transducer the far end is free.
    twist_rad
        Gives the twist [n, rad] at the samples where it is needed.

    Returns
    -------
    array [n·m, N·m]
        −share J θ″ or −share J twist″; 0 of a shaft that no inverter drives,
        and at the stator.

    Notes
    -----
    The twist is not smoothed before it is differenced: the weak form's windows do that.

    """
    if not x.inverter or x.shaft.stator:
        return np.zeros(np.shape(x.omega_rad_s))
    far = share * x.base["j_kgm2"]
    rigid = not x.shaft.alone and (between > 0.0 or (between == 0.0 and x.shaft.held))
    angle_rad = x.theta_rad[:: x.shaft.finer] if rigid else twist_rad()
    return _at_points(x, -far / x.ts_s**2 * np.pad(np.diff(angle_rad, 2), 1))


def side_of(through_nm: Array, least_nm: float) -> Array:
    """Side of a gap that the torque passed on presses to.

    Parameters
    ----------
    through_nm
        Torque S [n, N·m].
    least_nm
        Torque below which the gap is open [N·m].

    Returns
    -------
    array [n]
        −1 to 1. If the torque comes back with the other sign, the gap is crossed in between: slowly
        at first, at an even acceleration.

    References
    ----------
    Nordin and Gutman, Automatica 38(10), 2002, 1633, doi:10.1016/S0005-1098(02)00047-X.

    """
    closed = np.flatnonzero(np.abs(through_nm) > least_nm)
    if closed.size == 0:
        return np.zeros(through_nm.size)
    at = np.arange(through_nm.size)
    place = np.searchsorted(closed, at, side="right")
    last = closed[np.maximum(place - 1, 0)]
    after = closed[np.minimum(place, closed.size - 1)]
    passed = np.clip((at - last) / np.maximum(after - last, 1), 0.0, 1.0)
    begin, end = np.sign(through_nm[last]), np.sign(through_nm[after])
    return begin + (end - begin) * passed**2


def discriminator(logs: Sequence[FullLog], q: Values) -> Discrimination | None:
    """Backlash or compliance, from drive logs in which the torque changes its sign.

    Parameters
    ----------
    logs
        Whole logs with currents, angle and the load's torque.
    q
        `share` of the inertia at the far end [1], whether the transducer is `between`, and the
        `twist_rad` or `gap_rad` of the fit.

    Returns
    -------
    Discrimination or None
        A gap if it is significant, and wider than the spring's twist at the torque passed on; a
        spring if such a gap is excluded; nothing if those of the fit are; else None. The limit is
        `sure_u` standard uncertainties.

    """
    between, share = q["between"] > 0.0, q["share"]
    if share <= 0.0 or not logs:
        return None
    law = _law(logs, between, share, _half_wave_s(logs[0], q))
    if law is None or not (between or _turns_both(law, logs[0])):
        return None
    if not between:
        excluded = _excluded(law, logs[0], share, q)
        return Discrimination(None, {}) if excluded else _discriminated(law, logs[0], share)
    return _in_coupling(law, logs[0], (1.0 - share) * logs[0].x.base["j_kgm2"])


def _excluded(law: Law, log: FullLog, part: float, q: Values) -> bool:
    """Whether a law, `part` of the twist in it, shows less of the fit's twist and gap than a share,
    and nothing of what the fit has not. One with a gap or softness below zero is of something else,
    and one that leaves more in its windows than the fit's is of a few of them.
    """
    machine = log.x.machine
    policy = machine.policy.torsion
    pairs = ((law.softness, law.u_softness), (law.gap_rad, law.u_gap_rad))
    if any(value < -policy.sure_u * u for value, u in pairs):
        return False
    softness = part * q.get("twist_rad", 0.0) / machine.scales["torque_nm"]
    gap = part * q.get("gap_rad", 0.0)
    if law.chi2(law.softness, law.gap_rad) > law.chi2(softness, gap):
        return False
    return all(
        value < policy.sure_u * u
        if size == 0.0
        else value + policy.sure_u * u < policy.least_shown * size
        for size, value, u in (
            (softness, law.softness, law.u_softness),
            (gap, law.gap_rad, law.u_gap_rad),
        )
    )


def _turns_both(law: Law, log: FullLog) -> bool:
    """Whether a law has the inertia of both parts, as the fit has. A log that has not obeys another
    one, and what that says of the twist is nothing.
    """
    least = log.x.machine.policy.torsion.least_shown
    return least < law.mobility * log.x.base["j_kgm2"] < 1.0 / least


def _half_wave_s(log: FullLog, q: Values) -> float:
    """Half a period of the resonance of a fit's spring: of less, a parabola is most."""
    share, j_kgm2 = q["share"], log.x.base["j_kgm2"]
    softness = q.get("twist_rad", 0.0) / log.x.machine.scales["torque_nm"]
    return math.pi * math.sqrt(share * max(1.0 - share, 0.0) * j_kgm2 * softness)


def _law(logs: Sequence[FullLog], between: bool, share: float, window_s: float = 0.0) -> Law | None:
    """The law of twist in logs, of enough windows, which are of such a length at the least; None
    without. Where the transducer is `between`, of logs with a transducer.
    """
    policy = logs[0].x.machine.policy.torsion
    policy = replace(policy, window_s=max(policy.window_s, window_s))
    used = (one for one in logs if not (between and one.x.shaft.alone))
    law = law_of_twist((_shaft(one, between, share) for one in used), policy)
    return None if law is None or law.windows < policy.windows else law


def _discriminated(law: Law, log: FullLog, part: float) -> Discrimination | None:
    """The form of a law if it is significant, `part` of the twist in it; a gap with its numbers."""
    machine = log.x.machine
    policy = machine.policy.torsion
    gap, u_gap = law.gap_rad / part, law.u_gap_rad / part
    torque = machine.scales["torque_nm"] / part
    values = {"twist_rad": (torque * law.softness, torque * law.u_softness)}
    if law.softness < policy.sure_u * law.u_softness:
        values.clear()
    matters = max(policy.no_gap_rad, law.softness / part * law.torque_nm)
    if gap > max(matters, policy.sure_u * u_gap):
        return Discrimination("backlash", {**values, "gap_rad": (gap, u_gap)})
    return Discrimination("compliance", {}) if gap + policy.sure_u * u_gap < matters else None


def _in_coupling(law: Law, log: FullLog, near_kgm2: float) -> Discrimination | None:
    """The form of a law if it is significant, where the transducer stands in the coupling, with the
    spring's numbers and the share of the inertia behind it, as no twist is in the equations there;
    None without a far inertia.
    """
    policy = log.x.machine.policy.torsion
    discrimination = _discriminated(law, log, 1.0)
    if discrimination is None or law.mobility < policy.sure_u * law.u_mobility:
        return None
    torque = log.x.machine.scales["torque_nm"]
    near_share = near_kgm2 * law.mobility
    values = {
        **discrimination.values,
        "share": (1.0 / (1.0 + near_share), near_share * law.u_mobility / law.mobility),
    }
    if law.softness > policy.sure_u * law.u_softness:
        values["twist_rad"] = torque * law.softness, torque * law.u_softness
    return Discrimination(discrimination.name, values)


def shown(logs: Sequence[FullLog]) -> Shown | None:
    """Two masses from the torque in their coupling, whatever a fit has of the shaft.

    Parameters
    ----------
    logs
        Whole logs with angle and the torque in the coupling; their base inertia is taken as that of
        the motor's side.

    Returns
    -------
    Shown or None
        None where no far inertia, or no twist nor gap, is significant behind the transducer.

    Notes
    -----
    θ = ∬S/(f J) + twist(S), over times in which nothing else turns the far part: no drag of the
    motor, no current and no flux is in it. A transducer beyond the far part gives no such law, as
    then its torque turns nothing.

    """
    law = _law(logs, True, 0.5) if logs else None
    if law is None:
        return None
    near_kgm2 = logs[0].x.base["j_kgm2"]
    discrimination = _in_coupling(law, logs[0], near_kgm2)
    if discrimination is None or "twist_rad" not in discrimination.values:
        return None
    return Shown(discrimination, {"between": 1.0}, {"j_kgm2": near_kgm2 + 1.0 / law.mobility})


def _shaft(log: FullLog, between: bool, share: float) -> Shaft:
    """A log as `law_of_twist` takes it: the coupling's torque, or the momentum of both parts."""
    x, inertia = log.x, log.x.base["j_kgm2"]
    driving = x.torque_nm - log.drag_nm
    u_both = math.hypot(log.u_shaft_nm, log.u_air_gap_nm)
    u_shaft = log.u_shaft_nm
    return Shaft(
        x.ts_s,
        x.theta_rad,
        log.shaft_nm if between else driving,
        log.shaft_nm if between else driving - log.shaft_nm,
        0.0 if between else (1.0 - share) * inertia,
        share * inertia if between else inertia,
        log.u_theta_rad,
        u_shaft if between else log.u_air_gap_nm,
        u_shaft if between else u_both,
        log.good,
    )
