"""Generic places where an unknown effect could act: curves of one variable, without a formula.

Each port is an effect like any other, so the same fit and score serve it. A port's curve may be
carried by a second variable: a drag that is speed times a curve of temperature, a friction that is
the sense of rotation times waves of the angle, a drop that is current times a curve of speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.criticism.discovery.bases import PAST, Basis, Variable, coarse, fine, variables
from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Operating, Values
from pipeline.criticism.parameter import Machine, Parameter
from pipeline.criticism.policy.discovery import Discovery

_WIDE = 1e6
"""Bound of a coefficient in machine scales: none, but finite."""
_SCALES = {
    "torque": ("torque_nm", "N·m"),
    "drop": ("voltage_v", "V"),
    "flux": ("flux_wb", "Wb"),
    "angle": ("1", "rad"),
}


@dataclass(frozen=True, slots=True)
class Carrier:
    """What multiplies a curve.

    Attributes
    ----------
    columns
        Columns of a capture that it adds to those of the curve.
    words, code
        It in a sentence, and in Python.
    value
        Computes it from the state.

    """

    columns: tuple[str, ...]
    words: str
    code: str
    value: Callable[[Operating], Any]


@dataclass(frozen=True, slots=True)
class Port:
    """One residual input: a generic effect without a formula.

    Attributes
    ----------
    effect
        The effect whose parameters are the coefficients.
    hook
        Where it acts: `torque`, `drop` or `flux`.
    variable, basis
        What its curve is of, and the curves; None for a polynomial of the currents.
    carriers
        What the curve is multiplied by.
    signals
        Recorded signal that each carrier acts on; for a torque the shaft's.
    monomials
        Powers of d and q current of a co-energy, in place of a curve [K].

    """

    effect: Effect
    hook: str
    variable: Variable | None
    basis: Basis | None
    carriers: tuple[Carrier, ...]
    signals: tuple[str, ...]
    monomials: tuple[tuple[int, int], ...] = ()

    @property
    def unit(self) -> str:
        """Unit of every coefficient."""
        return _SCALES[self.hook][1]

    @property
    def columns(self) -> tuple[str, ...]:
        """The capture columns that the structure depends on."""
        if self.variable is None:
            return ("id_a", "iq_a")
        names = [*self.variable.columns, *(c for a in self.carriers for c in a.columns)]
        return tuple(dict.fromkeys(names))


def ports(
    machine: Machine, policy: Discovery, hooks: Iterable[str] = ("torque", "drop", "flux")
) -> tuple[Port, ...]:
    """Every residual input of one machine.

    Parameters
    ----------
    machine
        Ranges and orders of the variables.
    policy
        Number of knots.
    hooks
        Where they act.

    """
    makers = {
        "torque": _torque_ports,
        "drop": _drop_ports,
        "flux": _flux_ports,
        "angle": _angle_ports,
    }
    return tuple(port for hook in hooks for port in makers[hook](machine, policy))


def refined(port: Port, machine: Machine, policy: Discovery) -> Port:
    """The same port with narrow hats instead of a few smooth curves, where it has a curve.

    Parameters
    ----------
    port
        The input.
    machine
        Ranges and orders of the variables.
    policy
        Number of hats.

    Returns
    -------
    Port
        The same where it has no curve to refine.

    """
    if port.variable is None or (port.hook == "flux" and port.variable.kind == "turn"):
        return port
    return _port(
        port.hook, port.variable, fine(port.variable, machine, policy), port.carriers, port.signals
    )


def _torque_ports(machine: Machine, policy: Discovery) -> list[Port]:
    constant, omega, sense, iq, load = _torque_carriers(machine)
    warm, turn = ("temp_winding_degc", "temp_magnet_degc"), ("theta_mech_rad", "theta_elec_rad")
    pairs = (
        *((constant, name) for name in ("omega_mech_rad_s", "iq_a", "id_a", *warm, *turn)),
        *((omega, name) for name in (*warm, turn[0], "i_a")),
        *((sense, name) for name in (*warm, turn[0], "i_a")),
        *((iq, name) for name in (*warm, *turn, "omega_mech_rad_s")),
        (load, turn[0]),
        (constant, PAST),
    )
    known = variables(machine)
    shaft = ("torque_shaft_nm",)
    return [
        _port("torque", known[name], coarse(known[name], machine, policy), (carrier,), shaft)
        for carrier, name in pairs
    ]


def _angle_ports(machine: Machine, policy: Discovery) -> list[Port]:
    """Errors of the angle that an encoder records: by its direction, the torque, the turn."""
    constant, known = _torque_carriers(machine)[0], variables(machine)
    names = ("omega_mech_rad_s", "iq_a", "theta_mech_rad")
    curves = [(known[name], coarse(known[name], machine, policy)) for name in names]
    return [_port("angle", variable, basis, (constant,), ("vd_v",)) for variable, basis in curves]


def _torque_carriers(machine: Machine) -> tuple[Carrier, ...]:
    """One, the speed, its sense, the q current and its magnitude."""
    speed, current = machine.scales["speed_rad_s"], machine.scales["current_a"]
    constant = Carrier((), "", "1.0", lambda _: 1.0)
    omega = Carrier(
        ("omega_mech_rad_s",),
        f"omega_mech_rad_s/({speed:.4g} rad/s)",
        f"x.omega_rad_s / {speed:.6g}",
        lambda x: x.omega_rad_s / float(f"{speed:.6g}"),
    )
    sense = Carrier(
        ("omega_mech_rad_s",),
        "sign(omega_mech_rad_s)",
        "np.sign(x.omega_rad_s)",
        lambda x: np.sign(x.omega_rad_s),
    )
    iq = Carrier(
        ("iq_a",),
        f"iq_a/({current:.4g} A)",
        f"np.real(x.iq_a) / {current:.6g}",
        lambda x: np.real(x.iq_a) / float(f"{current:.6g}"),
    )
    load = Carrier(
        ("iq_a",),
        f"|iq_a|/({current:.4g} A)",
        f"np.abs(np.real(x.iq_a)) / {current:.6g}",
        lambda x: np.abs(np.real(x.iq_a)) / float(f"{current:.6g}"),
    )
    return constant, omega, sense, iq, load


def _constant(unit: complex) -> Callable[[Operating], Any]:
    return lambda _: unit


def _with_speed(unit: complex, speed_rad_s: float) -> Callable[[Operating], Any]:
    return lambda x: unit * x.omega_rad_s / float(f"{speed_rad_s:.6g}")


def _drop_ports(machine: Machine, policy: Discovery) -> list[Port]:
    """Drops of a drive's log: along an axis, along the current, at right angles to the flux."""
    speed, current = machine.scales["speed_rad_s"], machine.scales["current_a"]
    d, q = (Carrier((), "", code, _constant(unit)) for code, unit in (("1.0", 1.0), ("1j", 1j)))
    along = Carrier(
        ("id_a", "iq_a"),
        f"(id_a + j iq_a)/({current:.4g} A)",
        f"x.i_a / {current:.6g}",
        lambda x: x.i_a / float(f"{current:.6g}"),
    )
    turned = [
        Carrier(
            ("omega_mech_rad_s",),
            f"omega_mech_rad_s/({speed:.4g} rad/s)",
            f"{code} * x.omega_rad_s / {speed:.6g}",
            _with_speed(unit, speed),
        )
        for code, unit in (("1.0", 1.0), ("1j", 1j))
    ]
    both = ("vd_v", "vq_v")
    warm, turn = ("temp_winding_degc", "temp_magnet_degc"), ("theta_mech_rad", "theta_elec_rad")
    straight = ("id_a", "iq_a", "omega_mech_rad_s")
    pairs = (
        *(((d,), both[:1], name) for name in straight),
        *(((q,), both[1:], name) for name in straight),
        *(((along,), both[1:], name) for name in ("i_a", "omega_mech_rad_s", *warm)),
        *(((turned[1],), both[1:], name) for name in (*warm, "i_a", "iq_a", "id_a")),
        *(((turned[0],), both[:1], name) for name in ("iq_a", "id_a")),
        *(((d, q), both, name) for name in turn),
        *((tuple(turned), both, name) for name in turn),
    )
    known = variables(machine)
    return [
        _port("drop", known[name], coarse(known[name], machine, policy), carriers, signals)
        for carriers, signals, name in pairs
    ]


def _flux_ports(machine: Machine, policy: Discovery) -> list[Port]:
    """Co-energy that turns with the rotor, an inductance that goes with a temperature, any map."""
    d, q = (
        Carrier((), "", "x.id_a", lambda x: x.id_a),
        Carrier((), "", "x.iq_a", lambda x: x.iq_a),
    )
    known = variables(machine)
    both = ("psi_d_wb", "psi_q_wb")
    turned = ((d, q), known["theta_elec_rad"])
    stored = tuple(_stored(axis, 2.0 * machine.scales["current_a"]) for axis in ("d", "q"))
    warm = ((stored, known[name]) for name in ("temp_winding_degc", "temp_magnet_degc"))
    return [
        *(_port("flux", v, coarse(v, machine, policy), pair, both) for pair, v in (turned, *warm)),
        _flux_map(),
    ]


def _stored(axis: str, twice_a: float) -> Carrier:
    """What an inductance of one axis stores: a co-energy with the square of its current."""
    name = f"i{axis}_a"

    def square(x: Operating) -> Any:
        current = getattr(x, name)
        return current * current / float(f"{twice_a:.6g}")

    code = f"x.{name} * x.{name} / {twice_a:.6g}"
    return Carrier((name,), f"{name}²/({twice_a:.4g} A)", code, square)


def _parameters(names: Iterable[str], hook: str) -> tuple[Parameter, ...]:
    scale, unit = _SCALES[hook]
    return tuple(Parameter(name, unit, 0.01, 0.0, scale, -_WIDE, _WIDE) for name in names)


def _port(
    hook: str,
    variable: Variable,
    basis: Basis,
    carriers: tuple[Carrier, ...],
    signals: tuple[str, ...],
) -> Port:
    count = len(basis.names)
    names = [f"c{n}{name}" for n in range(len(carriers)) for name in basis.names]

    def value(x: Operating, q: Values) -> Any:
        weights = np.array(list(q.values()))
        at = variable.read(x)
        total: Any = 0.0
        for n, carrier in enumerate(carriers):
            carrier_weights = weights[n * count : (n + 1) * count]
            if np.any(carrier_weights):
                total = total + carrier.value(x) * basis.curve(at, carrier_weights)
        return total + np.zeros(np.shape(x.omega_rad_s))

    hooks: dict[str, Any] = {
        "torque": {"torque": value},
        "drop": {"drop": lambda x, q: value(x, q).astype(complex) * (1.0 if x.inverter else 0.0)},
        "flux": {"coenergy": value},
        "angle": {"angle": lambda x, q: value(x, q) * (1.0 if x.inverter else 0.0)},
    }[hook]
    word = {
        "torque": "drag",
        "drop": "voltage drop",
        "flux": "flux linkage",
        "angle": "error of the electrical angle that the encoder records",
    }[hook]
    if variable.name == PAST:
        word = "error of the torque's transducer (hysteresis)"
    times = carriers[0].words
    words = f"{word} as a curve of {variable.name}" + (f" times {times}" if times else "")
    title = f"port:{hook}:{'+'.join(signals)}:{variable.name}:{times}:{count}"
    effect = _effect(title, words, _parameters(names, hook), **hooks)
    return Port(effect, hook, variable, basis, carriers, signals)


def _effect(name: str, words: str, parameters: tuple[Parameter, ...], **hooks: Any) -> Effect:
    """An effect that is reported under no name."""
    return Effect(
        name=name,
        words=words,
        parameters=parameters,
        signature="",
        reference="",
        tests=(),
        experiment="",
        **hooks,
    )


def _flux_map() -> Port:
    powers = tuple((a, n - a) for n in (3, 4, 5) for a in range(n + 1))
    names = tuple(f"d{a}q{b}" for a, b in powers)

    def coenergy(x: Operating, q: Values) -> Any:
        size = x.machine.scales["current_a"]
        d, i = x.id_a / size, x.iq_a / size
        weights = zip(powers, q.values(), strict=True)
        return size * sum(c * d**a * i**b for (a, b), c in weights if c)

    words = "co-energy as a polynomial of the currents"
    effect = _effect("port:flux:current", words, _parameters(names, "flux"), coenergy=coenergy)
    return Port(effect, "flux", None, None, (), ("psi_d_wb", "psi_q_wb"), powers)
