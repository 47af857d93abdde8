"""What dead time and the thresholds of switches take from the legs of a switching inverter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.criticism.operating import Array, Complex, Operating

_OTHERS = ((1, 2), (2, 0), (0, 1))
_ROUNDS = 3
"""Times that the legs' edges are worked out from each other's: two legs that switch within one dead
time hold each other up."""
_SHARP = 1e-9
"""Width [A] below which a current's sign is as good as a step."""
_SIN_120 = 0.5 * 3.0**0.5
_SHORT = 1e-3
"""Widths below which a mean of tanh is that at the middle: what it lacks is 1e-7."""


def turning(eps_rad: Array) -> Complex:
    """Unit vector of the rotor in the stationary frame.

    Parameters
    ----------
    eps_rad
        Electrical angle [n].

    Returns
    -------
    array [n], complex
        e^{jε}.

    """
    turn = np.empty(eps_rad.shape, dtype=np.complex128)
    turn.real, turn.imag = np.cos(eps_rad), np.sin(eps_rad)
    return turn


def phases_of(vector: Complex) -> Array:
    """Components along the phases a, b and c of a vector of the stationary frame.

    Parameters
    ----------
    vector
        Complex [n], α on phase a.

    Returns
    -------
    array [3, n]
        In the unit of the vector.

    """
    phases = np.empty((3, vector.size))
    phases[0] = vector.real
    across = _SIN_120 * vector.imag
    phases[1] = across - 0.5 * vector.real
    phases[2] = -across - 0.5 * vector.real
    return phases


def vector_of(phases: Array) -> Complex:
    """Vector of the stationary frame of three phases, amplitude-invariant.

    Parameters
    ----------
    phases
        [3, n].

    Returns
    -------
    array [n], complex
        2/3 Σ x_k e^{j2πk/3}.

    """
    vector = np.empty(phases.shape[1], dtype=np.complex128)
    vector.real = 2.0 / 3.0 * (phases[0] - 0.5 * (phases[1] + phases[2]))
    vector.imag = 2.0 / 3.0 * _SIN_120 * (phases[1] - phases[2])
    return vector


def lost_shares(
    x: Operating, eps_rad: Array, current_a: Array, loss_v: float, width_a: float
) -> Array:
    """What dead time takes from each leg [3, n], of the voltage that it takes from a large current.

    Parameters
    ----------
    x : Operating
        Flux linkage and recorded voltage [n] in the rotor frame, `pwm_s` and `vdc_v` of the
        inverter; without these two the share is tanh(i/width).
    eps_rad : Array
        Electrical angle [n, rad].
    current_a : Array
        Phase currents [3, n, A], means over a switching period.
    loss_v : float
        Voltage [V] that dead time takes from a large current: V_dc t_d/T.
    width_a : float
        Current [A] over which a leg's diodes change over.

    Notes
    -----
    Pulses are centred. Leg k loses λ of the dead time before its pulse, and keeps 1 − μ of it
    after. While both of its switches are off, a diode holds it at a rail until its current is
    zero; then it floats at the mean of the others. With c the part of the dead time in which these
    are low, and i the current where the dead time begins,

        λ, μ = clip(c + i/W, 0, 1),  W = 2/3 V_loss T/L_k,
        c = ½ Σ_j clip((v_k − v_j)/(2 V_loss) + λ_j or μ_j, 0, 1).

    The share is λ + μ − 1. Up to the edge of leg k the current vector moves from its mean by the
    inverse of the inductance times T/2 [V_dc Σ_j a_j max(d_j − d_k − 2 λ_j V_loss/V_dc, 0) −
    e (1 − d_k + V_loss/V_dc)], a the vectors of the legs over 3/2, d the widths of the pulses, e
    the voltage at the winding; alike at the other edge. So where the ripple exceeds the current
    nothing is lost, and at little voltage a current rests at zero while its leg's voltage passes
    through the dead time. The ripple of unequal inductances turns with the rotor:
    u → ½ (1/L_d + 1/L_q) u + ½ (1/L_d − 1/L_q)
    e^{2jε} u*.

    References
    ----------
    Holmes & Lipo, Pulse Width Modulation for Power Converters (2003), ch. 6.
    doi:10.1109/9780470546284
    Choi & Sul, IEEE Trans. Ind. Appl. 32 (1996), zero current clamping. doi:10.1109/28.502170

    """
    width, supply = max(width_a, _SHARP), x.supply
    known = _switching(x, eps_rad)
    if known is None or loss_v <= 0.0:
        return np.tanh(current_a / width)
    slopes, winding, recorded = known
    late = keeps = (current_a > 0.0).astype(float)
    ramp = 4.0 / 3.0 * loss_v * slopes.own
    dead = loss_v / supply.vdc_v
    for _ in range(_ROUNDS):
        volts = winding + loss_v * (late + keeps - 1.0) if recorded is None else recorded
        middle = 0.5 * (volts.max(axis=0) + volts.min(axis=0))
        duty = np.clip(0.5 + (volts - middle) / supply.vdc_v, 0.0, 1.0)
        low, before = _beside(volts, loss_v, late, -1.0)
        rise = current_a + slopes.at_edges(before, winding, 1.0 - duty + dead)
        low_after, after = _beside(volts, loss_v, 1.0 - keeps, 1.0)
        fall = current_a + slopes.at_edges(-after, winding, duty + dead)
        late = _passed(rise + (low - 0.5) * ramp, ramp, width)
        keeps = _passed(fall + (low_after - 0.5) * ramp, ramp, width)
    return late + keeps - 1.0


def swept_shares(x: Operating, eps_rad: Array, current_a: Array, width_a: float) -> Array:
    """What thresholds of switches take from each leg [3, n], of what they take at a large current.

    Parameters
    ----------
    x : Operating
        As for `lost_shares`.
    eps_rad : Array
        Electrical angle [n, rad].
    current_a : Array
        Phase currents [3, n, A], means over a switching period.
    width_a : float
        Current [A] over which a threshold changes over.

    Notes
    -----
    A threshold acts at each moment, against the current of that moment: the share is the mean over
    a period of tanh(i(t)/width). Pulses are centred, so a current is at its mean in the middle of
    both zero vectors. Between, it moves by (V_dc (s_k − Σ s_j/3) − e_k)/L with the legs s that are
    high, e the voltage at the winding, and in the other half of the period the other way.

    References
    ----------
    Holmes & Lipo, Pulse Width Modulation for Power Converters (2003), ch. 6.
    doi:10.1109/9780470546284

    """
    width = max(width_a, _SHARP)
    known = _switching(x, eps_rad)
    if known is None:
        return np.tanh(current_a / width)
    slopes, winding, recorded = known
    volts = winding if recorded is None else recorded
    duty = np.clip(
        0.5 + (volts - 0.5 * (volts.max(axis=0) + volts.min(axis=0))) / x.supply.vdc_v, 0.0, 1.0
    )
    falling = _falling(duty)
    lasts = -np.diff(falling, axis=0, prepend=1.0, append=0.0)
    above = np.stack([sum(volts[j] > volts[k] for j in others) for k, others in enumerate(_OTHERS)])
    moves = [
        share / width * slopes.moved(x.supply.vdc_v * ((high > above) - high / 3.0) - winding)
        for high, share in enumerate(lasts)
    ]
    mean = current_a / width
    shares, begun = np.zeros_like(mean), _log_cosh(mean)
    for way in (1.0, -1.0):
        at, integral = mean, begun
        for share, move in zip(lasts, moves, strict=True):
            after = at + way * move
            ends = _log_cosh(after)
            shares += 0.5 * share * _mean_tanh(at, after, ends - integral)
            at, integral = after, ends
    return shares


@dataclass(frozen=True, slots=True)
class _Slopes:
    """What a voltage does to phase currents in half a switching period.

    `even` [A/V] is what it does along itself, `odd` [n, A/V], e^{2jε} times a share of the
    saliency, what its conjugate does; `own` [3, n, A/V] is that of each phase's voltage to itself.
    """

    even: float
    odd: Complex | None
    own: Array | float

    def moved(self, volts: Array) -> Array:
        """Change of the currents [3, n, A] by voltages [3, n, V] without a common part."""
        if self.odd is None:
            return self.even * volts
        return self.even * volts + phases_of(self.odd * np.conj(vector_of(volts)))

    def at_edges(self, others: Array, winding: Array, lasts: Array) -> Array:
        """Change of each leg's current [3, n, A] up to its edge, by the `others` [3, 3, n, V]
        (leg, of leg) and the winding's voltage, which `lasts` [3, n] of half a period.
        """
        total = others.sum(axis=1) / 3.0
        change: Array = -self.even * (total + winding * lasts)
        if self.odd is not None:
            for k in range(3):
                across = others[k] - total[k] - winding * lasts[k]
                change[k] += phases_of(self.odd * np.conj(vector_of(across)))[k]
        return change


def _slopes_of(x: Operating, turn: Complex) -> _Slopes | None:
    """The slopes at the base inductances, one standing for one that is not known; None without."""
    l_d, l_q = x.base["ld_h"], x.base["lq_h"]
    half_s = 0.5 * x.supply.pwm_s
    if max(l_d, l_q) <= 0.0 or not half_s:
        return None
    along_d, along_q = half_s / (l_d if l_d > 0.0 else l_q), half_s / (l_q if l_q > 0.0 else l_d)
    even = 0.5 * (along_d + along_q)
    if along_d == along_q:
        return _Slopes(even, None, even)
    odd = 0.5 * (along_d - along_q) * turn**2
    axes = np.exp(-4j * np.pi * np.arange(3) / 3.0)
    return _Slopes(even, odd, even + (odd * axes[:, None]).real)


def _switching(x: Operating, eps_rad: Array) -> tuple[_Slopes, Array, Array | None] | None:
    """Slopes of the currents, voltages at the winding and, where they were recorded, those that
    were asked for [3, n]; None where it is not known how the inverter switches.
    """
    supply = x.supply
    turn = x.once(eps_rad, "turning", lambda: turning(eps_rad))
    slopes = _slopes_of(x, turn)
    if slopes is None or not supply.vdc_v or x.psi_wb is None:
        return None
    induced = 1j * x.machine.pole_pairs * x.omega_rad_s * x.flux_wb
    winding = phases_of((x.base["r_ohm"] * x.i_a + induced) * turn)
    recorded = None if supply.volts_v is None else phases_of(supply.volts_v * turn)
    return slopes, winding, recorded


def _falling(rows: Array) -> Array:
    """Three numbers [3, n] of each sample, the largest first: a sort along so short an axis takes
    two to ten times as long.
    """
    upper, lower = np.maximum(rows[0], rows[1]), np.minimum(rows[0], rows[1])
    middle = np.maximum(lower, np.minimum(upper, rows[2]))
    return np.stack([np.maximum(upper, rows[2]), middle, np.minimum(lower, rows[2])])


def _mean_tanh(one: Array, other: Array, rise: Array) -> Array:
    """Mean of tanh between two arguments, of which `rise` is the integral."""
    apart = other - one
    short = np.abs(apart) < _SHORT
    apart[short] = 1.0
    mean: Array = rise / apart
    mean[short] = np.tanh(0.5 * (one[short] + other[short]))
    return mean


def _log_cosh(at: Array) -> Array:
    """Integral of tanh, but for a constant: to the rounding of 1, as good as log1p here and less
    than three quarters of its time.
    """
    size = np.abs(at)
    rest = np.exp(-2.0 * size)
    rest += 1.0
    np.log(rest, out=rest)
    rest += size
    return rest


def _beside(volts: Array, loss_v: float, late: Array, side: float) -> tuple[Array, Array]:
    """At each leg's edge: the part [3, n] of its dead time in which the others are low, and for how
    long each of these [3, 3, n] was elsewhere since the middle of its zero vector [V].

    `late` [3, n] is the part of the dead time by which an edge comes late; `side` −1 at the edges
    before the pulses, 1 at those after.
    """
    low, elsewhere = np.zeros_like(volts), np.zeros((3, *volts.shape))
    behind = late if side < 0.0 else 1.0 - late
    held = 2.0 * loss_v * late
    for k, others in enumerate(_OTHERS):
        for j in others:
            difference = volts[k] - volts[j]
            low[k] += 0.5 * np.clip(difference / (2.0 * loss_v) + behind[j], 0.0, 1.0)
            elsewhere[k, j] = np.maximum(side * difference - held[j], 0.0)
    return low, elsewhere


def _passed(current_a: Array, ramp_a: Array | float, width_a: float) -> Array:
    """A ramp from 0 to 1 of a length [A] about zero, smoothed by sech² of a width [A]."""
    up, down = (_log_cosh((current_a + part * ramp_a) / width_a) for part in (0.5, -0.5))
    return 0.5 + 0.5 * width_a / ramp_a * (up - down)
