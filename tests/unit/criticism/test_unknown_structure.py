"""The sketch of an unknown: its terms, its curve, its effect file."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.discovery.bases import coarse, fine, variables
from pipeline.criticism.discovery.dictionary import CENTRED, SHAPES, Term
from pipeline.criticism.discovery.matching_pursuit import Pursuit
from pipeline.criticism.discovery.residual_inputs import ports, refined
from pipeline.criticism.discovery.unknown_structure import unknown_structure
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.residuals.residual import residual
from tests.unit.criticism.machines import BASE, fitted, log, machine, operating, with_drag


def told(drag, tmp_path):
    """The structure found in two logs with a further drag, and its effect file as a module."""
    segments = tuple(_cool(with_drag(drag, seed)) for seed in (5, 6))
    found, _ = unknown_structure(linear_system(fitted(segments)), ["torque_shaft_nm"], name="mine")
    path = tmp_path / "mine.py"
    path.write_text(found.source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("mine", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return found, module.EFFECT


def _cool(segment):
    """Without the log's own warming, which runs along with its speed."""
    cold = np.full(segment.size, 25.0)
    columns = {"temp_winding_degc": cold, "temp_magnet_degc": cold}
    return replace(segment, recorded={**segment.recorded, **columns})


def _warmed(seed):
    segment = log(noise=1.0, seed=seed)
    rng = np.random.default_rng(seed)
    n = segment.size
    theta = log().recorded["theta_mech_rad"]
    omega = np.gradient(theta, 5e-5)
    warm = 25.0 + 60.0 * np.abs(np.sin(np.arange(n) * 5e-5 * 9.0 + rng.uniform(0, 3)))
    torque = segment.recorded["torque_shaft_nm"] - 0.1 * omega / 250 * np.exp(-(warm - 25) / 15)
    columns = {"torque_shaft_nm": torque, "temp_winding_degc": warm}
    return replace(segment, recorded={**segment.recorded, **columns})


def brake(omega, _):
    u = omega / 70.0
    return 0.06 * u / (1.0 + u**2)


def test_a_brake_comes_out_as_one_term_with_its_peak_and_speed(tmp_path):
    found, _ = told(brake, tmp_path)
    assert found.variables == ("omega_mech_rad_s",)
    (term, size, unit) = found.sketch[0]
    assert len(found.sketch) == 1
    assert "2u/(1 + u²)" in term
    assert float(term.split("/(")[-1].split(" rad")[0]) == pytest.approx(70.0, rel=0.03)
    assert (size, unit) == (pytest.approx(0.03, rel=0.02), "N·m")
    peak = re.search(r"odd, with its maximum (\S+) N·m at (\S+) rad/s", found.shape)
    assert float(peak[1]) == pytest.approx(0.03, rel=0.02)
    assert float(peak[2]) == pytest.approx(70.0, rel=0.03)


def _softening(seed, fall_h_k):
    """A log of a machine whose q inductance falls with the winding's temperature."""
    warm = _warmed(seed).recorded["temp_winding_degc"]
    segment = log(noise=1.0, seed=seed)
    columns = {"temp_winding_degc": warm, "temp_magnet_degc": np.full(segment.size, 25.0)}
    segment = replace(segment, recorded={**segment.recorded, **columns})
    falling = Effect(
        name="soft",
        words="L_q falls",
        signature="",
        reference="",
        tests=(),
        experiment="",
        parameters=(Parameter("fall_h_k", "H/K", 1.0, 0.1),),
        coenergy=lambda x, q: -0.5 * q["fall_h_k"] * x.winding_k * x.iq_a * x.iq_a,
    )
    plain, model = Model(machine(), ()), Model(machine(), (falling,))
    values = {**BASE, "soft.fall_h_k": fall_h_k}
    more = residual(segment, plain, BASE) - residual(segment, model, values)
    added = dict(zip(segment.channels, more, strict=True))
    return replace(
        segment,
        recorded={n: column + added.get(n, 0.0) for n, column in segment.recorded.items()},
    )


@pytest.mark.slow
def test_an_inductance_that_goes_with_a_temperature_comes_out_as_one_term(tmp_path):
    fall = 2e-3 * BASE["lq_h"]
    segments = tuple(_softening(seed, fall) for seed in (5, 6))
    found, _ = unknown_structure(linear_system(fitted(segments)), ["vd_v", "vq_v"], name="mine")
    assert found.variables[0] == "temp_winding_degc" and "iq_a" in found.variables
    ((term, size, unit),) = found.sketch
    assert "q axis: iq_a²" in term
    scale = float(re.search(r"u = \(temp_winding_degc - 25 degC\)/\((\S+) K\)", term)[1])
    current = machine().scales["current_a"]
    assert (size, unit) == (pytest.approx(-fall * scale * current, rel=0.03), "Wb")
    path = tmp_path / "mine.py"
    path.write_text(found.source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("mine", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    x = operating()
    (name,) = (p.name for p in module.EFFECT.parameters)
    stored = module.EFFECT.coenergy(x, {name: size})
    assert stored == pytest.approx(-0.5 * fall * x.winding_k * x.iq_a**2, rel=0.03)


def shiver(omega, _):
    """A drag around one speed, as of a resonance of the bench."""
    return 0.04 * np.sign(omega) * np.exp(-(((np.abs(omega) - 80.0) / 30.0) ** 2))


def test_a_drag_around_one_speed_comes_out_as_one_term_at_that_speed(tmp_path):
    """Without such a term it was told as a drag of a hundred times the size with its maximum at
    rest, most of which viscous and Coulomb friction took back.
    """
    found, effect = told(shiver, tmp_path)
    (term, size, unit) = found.sketch[0]
    assert len(found.sketch) == 1
    assert (size, unit) == (pytest.approx(0.04, rel=0.03), "N·m")
    centre, width = re.search(r"- (\S+) rad/s\)/\((\S+) rad/s\)", term).groups()
    assert float(centre) == pytest.approx(80.0, rel=0.02)
    assert float(width) == pytest.approx(30.0, rel=0.05)
    x = operating()
    values = {p.name: p.scan[0] for p in effect.parameters if not p.amplitude}
    values |= {p.name: size for p in effect.parameters if p.amplitude}
    assert np.abs(effect.torque(x, values) - shiver(x.omega_rad_s, None)).max() < 2e-3


def test_the_curve_runs_through_the_truth_within_its_band(tmp_path):
    found, _ = told(brake, tmp_path)
    at = np.array([p.at for p in found.curve])
    truth = brake(at, None)
    assert all(p.low <= p.value <= p.high for p in found.curve)
    assert np.abs(np.array([p.value for p in found.curve]) - truth).max() < 2e-3
    inside = [p.low <= t <= p.high for p, t in zip(found.curve, truth, strict=True)]
    assert np.mean(inside) > 0.6


def test_the_effect_file_computes_the_expression_it_tells(tmp_path):
    found, effect = told(brake, tmp_path)
    x = operating()
    scales = {p.name: p.scan[0] for p in effect.parameters if not p.amplitude}
    sizes = [p.name for p in effect.parameters if p.amplitude]
    values = dict(zip(sizes, (size for _, size, _ in found.sketch), strict=True))
    drag = effect.torque(x, {**scales, **values})
    assert np.abs(drag - brake(x.omega_rad_s, None)).max() < 1e-3
    none = effect.torque(x, {**scales, **dict.fromkeys(sizes, 0.0)})
    assert not np.any(none)


@pytest.mark.slow
def test_variables_that_run_along_with_each_other_are_all_told():
    """In these logs temperature rises with speed: either could be the cause, and both are named."""
    segments = (with_drag(brake), with_drag(brake, 6))
    found, _ = unknown_structure(linear_system(fitted(segments)), ["torque_shaft_nm"])
    assert found.variables == ("omega_mech_rad_s",)
    told_of = {name for names, _ in found.alternatives for name in names}
    assert "temp_winding_degc" in told_of
    assert "temp_winding_degc" in found.shape


def test_two_variables_are_told_where_it_takes_two():
    """A grease that melts: speed times a curve of temperature."""
    segments = tuple(_warmed(seed) for seed in (5, 6))
    found, _ = unknown_structure(linear_system(fitted(segments)), ["torque_shaft_nm"])
    assert set(found.variables) == {"temp_winding_degc", "omega_mech_rad_s"}
    assert "omega_mech_rad_s" in found.times


@pytest.mark.slow
def test_a_test_that_was_done_once_is_held_out_in_parts():
    """A drag that melts as one log warms: no other log knows of it, but its other parts do."""
    warmed, cold = _slowly_warmed(5), _cool(log(noise=1.0, seed=6))
    what = linear_system(fitted((warmed, cold))), ["torque_shaft_nm"]
    whole, _ = unknown_structure(*what)
    assert whole is None or "temp_winding_degc" not in whole.variables
    found, _ = unknown_structure(*what, in_parts=True)
    assert "temp_winding_degc" in found.variables


def _slowly_warmed(seed):
    segment = log(noise=1.0, seed=seed)
    warm = 25.0 + 60.0 * (1.0 - np.exp(-3.0 * np.arange(segment.size) / segment.size))
    torque = segment.recorded["torque_shaft_nm"] - 0.05 * np.sin((warm - 25.0) / 9.0)
    columns = {"torque_shaft_nm": torque, "temp_winding_degc": warm}
    return replace(segment, recorded={**segment.recorded, **columns})


@pytest.mark.parametrize("name", sorted(variables(machine())))
def test_smooth_curves_lie_in_the_hats(name):
    """What a few smooth curves say, narrow hats can say as well."""
    variable = variables(machine())[name]
    few, many = (made(variable, machine(), DEFAULT.discovery) for made in (coarse, fine))
    if not few.nodes.size:
        return
    weights = np.random.default_rng(2).normal(size=len(few.names))
    hats = few.curve(many.nodes, weights)
    at = np.linspace(many.nodes[0], many.nodes[-1], 701)
    assert np.abs(many.curve(at, hats) - few.curve(at, weights)).max() < 1e-9


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.name)
@pytest.mark.parametrize("parity", ["odd", "even", "plain"])
def test_the_python_of_a_term_is_the_term(shape, parity):
    term = Term(shape.name, parity=parity, scale=1.7)
    v = np.linspace(-3.0, 4.0, 15)
    code = term.code("1.7", "0.0")
    written = eval(code, {"np": np, "v": v})
    assert np.broadcast_to(written, v.shape) == pytest.approx(term.value(v))


@pytest.mark.parametrize("kind", CENTRED)
@pytest.mark.parametrize("parity", ["odd", "even", "plain"])
def test_the_python_of_a_term_with_a_centre_is_the_term(kind, parity):
    term = Term(kind, parity=parity, scale=0.7, centre=1.9)
    v = np.linspace(-3.0, 4.0, 15)
    written = eval(term.code("0.7", "1.9"), {"np": np, "v": v})
    assert written == pytest.approx(term.value(v))
    assert float(term.value(np.array([1.9]))[0]) == pytest.approx(1.0)
    assert term.value(np.array([-1.9]))[0] == pytest.approx(
        {"odd": -1.0, "even": 1.0, "plain": float(term.value(np.array([5.7]))[0])}[parity]
    )


def test_a_straight_line_is_a_smooth_curve_of_speed():
    """Viscous friction must be nothing that a port knows and the model does not."""
    variable = variables(machine())["omega_mech_rad_s"]
    basis = coarse(variable, machine(), DEFAULT.discovery)
    at = np.linspace(-240.0, 240.0, 97)
    columns = np.stack([basis.curve(at, row) for row in np.eye(len(basis.names))], axis=1)
    fit = np.linalg.lstsq(columns, at, rcond=None)[0]
    assert np.abs(columns @ fit - at).max() < 1e-6 * 240.0


def test_every_port_is_zero_at_zero_and_has_a_name_of_its_own():
    x = replace(operating(), psi_wb=np.full(60, 0.01 + 0j), torque_em_nm=np.ones(60))
    offered = ports(machine(), DEFAULT.discovery)
    assert len({port.effect.name for port in offered}) == len(offered)
    for port in offered:
        fine_port = refined(port, machine(), DEFAULT.discovery)
        for one in (port, fine_port):
            q = {p.name: 0.0 for p in one.effect.parameters}
            hook = one.effect.coenergy or one.effect.drop or one.effect.torque
            assert not np.any(hook(x, q))
        if fine_port is not port:
            assert fine_port.effect.name != port.effect.name


def test_an_unknown_drag_is_told_by_its_variable_and_curve():
    """An eddy-current brake, in no library: peak 0.2 N·m at 40 rad/s, falling beyond."""

    def drag(omega, _):
        return 0.4 * (omega / 40.0) / (1.0 + (omega / 40.0) ** 2)

    segments = (with_drag(drag), with_drag(drag, 6))
    start = fitted(segments)
    assert remainder(linear_system(start))
    sketch, gain = unknown_structure(linear_system(start), ["torque_shaft_nm"])
    assert gain > 100.0
    assert sketch.signal == "torque_shaft_nm"
    assert sketch.variables == ("omega_mech_rad_s",)
    assert {unit for _, _, unit in sketch.sketch} == {"N·m"}


def test_a_wave_of_an_order_that_is_no_whole_number_is_told_with_its_phase():
    """0.03 N·m sin(4.83 θ + 0.5) at the largest current, whichever way that pushes."""
    current = log().recorded["iq_a"]
    top = machine().scales["current_a"]
    load = 0.03 * np.abs(current) / top
    segments = tuple(with_drag(lambda _, th: load * np.sin(4.83 * th + 0.5), n) for n in (5, 6))
    model = Model(replace(machine(), load_orders=(4.83,)), ())
    begun = Fit(segments, model, dict(BASE), floors(segments, model, BASE), BASE)
    sketch, _ = unknown_structure(gauss_newton(begun), ["torque_shaft_nm"])
    assert sketch.variables == ("theta_mech_rad", "iq_a")
    sizes = {term: size for term, size, _ in sketch.sketch}
    (sine,) = (size for term, size in sizes.items() if "sin(4.83 theta_mech_rad)" in term)
    (cosine,) = (size for term, size in sizes.items() if "cos(4.83 theta_mech_rad)" in term)
    assert np.hypot(sine, cosine) == pytest.approx(0.03, rel=0.02)
    assert np.arctan2(cosine, sine) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_parameter_that_nothing_shows_is_no_infinite_one_beside_others_that_nearly_tie(seed):
    """What rounding leaves of it was divided by the square of its own size, which is none."""
    random = np.random.default_rng(seed)
    model = random.normal(size=(200, 8))
    model[:, 5:] = model[:, :3] + 1e-7 * random.normal(size=(200, 3))
    model[:, 4] = 0.0
    rows = SimpleNamespace(
        matrix=np.column_stack([model, random.normal(size=(200, 3))]),
        residual=random.normal(size=200),
        prior_precision=np.zeros(11),
        prior_gradient=np.zeros(11),
        size=200,
        policy=DEFAULT,
    )
    pursuit = Pursuit(rows, 8, None, np.ones(200))
    free = pursuit.system.matrix[:, 8:]
    left = free - model @ np.linalg.lstsq(model, free, rcond=1e-5)[0]
    assert pursuit.gram == pytest.approx(left.T @ left, rel=1e-3, abs=0.1)
