"""Draws the figures of docs/real-recordings.md: `make stories`, from the recordings themselves."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pipeline.criticism.data.holding_cells import holding_orders
from pipeline.criticism.policy.policy import DEFAULT
from tests.sectors import sector_errors
from tests.stories.fits import REAL, campaign, fit, without
from tests.stories.svg import COLOURS, INK, Panel, page

BLUE, RED, GREEN, VIOLET, OCHRE = COLOURS
SPEED = "omega_mech_rad_s"


def holding() -> str:
    """Holding current over a part of the turn, and the errors against the number of orders."""
    found = campaign("laas_solo")
    made = fit(found, "cogging", "coulomb_friction", "sample_delay")
    segment = made.segment("standing")
    seen, told = made.curves("standing")
    theta, sense = segment.recorded["theta_mech_rad"], segment.recorded["sense"]
    left = Panel("Holding current, a tenth of the turn", "shaft angle [rad]", "current [A]")
    for side, colour, name in ((1.0, BLUE, "arrived forwards"), (-1.0, RED, "backwards")):
        mine = np.flatnonzero((sense == side) & (theta > 1.0) & (theta < 1.63))
        mine = mine[np.argsort(theta[mine])]
        left.add("dots", theta[mine], seen[0, mine], colour, name)
        left.add("line", theta[mine], told[0, mine], colour)
    right = Panel("Error against the number of orders", "orders in the model", "rms [A]", log=True)
    captures = found.of("holding_current")
    strongest = (72, 18, 12, 144, 24, 36, 48, 216)
    chosen = [k for k in strongest if k in holding_orders(captures, (12, 18), DEFAULT, 400)]
    steps = [(n, *sector_errors(captures, chosen[:n], DEFAULT)) for n in range(len(chosen) + 1)]
    steps += [
        (n, *sector_errors(captures, range(1, n + 1), DEFAULT)) for n in (19, 39, 79, 119, 159)
    ]
    count = [n for n, _, _ in steps]
    for place, (colour, name) in enumerate(((BLUE, "fitted"), (RED, "held out")), start=1):
        error = [step[place] for step in steps]
        right.add("line", count[: len(chosen) + 1], error[: len(chosen) + 1], colour, name)
        right.add("dots", count, error, colour)
    right.notes.append((140, steps[-1][2] / 2, "every order from 1"))
    right.notes.append((22, steps[len(chosen)][1] / 2, f"{len(chosen)} chosen"))
    return page([left, right])


def timing() -> str:
    """The recorded speed behind the angle's, and the resistance as effects are added."""
    found = campaign("laas_solo")
    blind = fit(without(found, "theta_mech_rad"), kinds=("q",), on_time=True)
    plain = fit(found, kinds=("q",))
    late = fit(found, "sample_delay", kinds=("q",))
    both = fit(found, "sample_delay", "dead_time", kinds=("q",))
    segment = late.segment("q")
    seen, _ = late.curves("q")
    from_angle = seen[1] - (plain.curves("q")[0][1] - plain.curves("q")[1][1])
    rows = slice(1190, 1330)
    left = Panel("A drive's own speed comes late", "time [s]", "speed [rad/s]")
    at = np.arange(segment.size)[rows] * segment.ts_s
    left.add("dots", at, _calm(from_angle)[rows], OCHRE, "from the angle")
    left.add("line", at, seen[1][rows], BLUE, "as recorded")
    names = ("by its own speed", "by the angle", "+ dead time", "standstill")
    ohm = [f.values["r_ohm"] for f in (blind, late, both)] + [0.485]
    right = Panel("Resistance along the ladder", "", "R [Ω]", x_labels=names)
    for n, value in enumerate(ohm):
        right.add("bars", [n], [value], (BLUE, BLUE, BLUE, INK)[n])
        right.notes.append((n, value, f"{value:.3f}"))
    return page([left, right])


def _calm(signal: np.ndarray) -> np.ndarray:
    return np.convolve(signal, np.full(5, 0.2), mode="same")


def moteus() -> str:
    """Flux of each level of d current, with a constant and a saturating L_d."""
    panels = []
    for motor in ("mj5208", "be8108", "flipsky6374"):
        found = campaign("moteus", motor)
        models = ((fit(found), OCHRE, "constant"), (fit(found, "saturation"), BLUE, "saturating"))
        segment = models[0][0].segment("steady")
        panel = Panel(f"{motor}: slope of each level", "d current [A]", "d flux [mWb]", below=True)
        levels = segment.blocks
        speed = segment.recorded[SPEED] * models[0][0].model.machine.pole_pairs
        for made, colour, name in models:
            _, told = made.curves("steady")
            current, flux = _slopes(segment.recorded["id_a"], speed, told[0], levels)
            panel.add("line", current, 1e3 * flux, colour, f"L_d {name}")
        current, flux = _slopes(segment.recorded["id_a"], speed, segment.recorded["vq_v"], levels)
        panel.add("dots", current, 1e3 * flux, INK, "measured")
        panels.append(panel)
    return page(panels, width=360.0)


def _slopes(current, speed, volts, levels) -> tuple[np.ndarray, np.ndarray]:
    """Slope of voltage over speed of every level, beside its d current."""
    pairs = [
        (current[levels == k].mean(), np.polyfit(speed[levels == k], volts[levels == k], 1)[0])
        for k in np.unique(levels)
    ]
    return np.array(pairs).T


def baldor() -> str:
    """Flux of q over its current at three d currents, and the error on rows held out."""
    found = campaign("baldor")
    ladder = ((), ("saturation",), ("saturation", "cross_saturation"))
    made = [fit(found, *effects) for effects in ladder]
    recorded = made[0].segment("flux_map").recorded
    title = "Measured flux of q, and the last model"
    left = Panel(title, "q current [A]", "q flux [Wb]", below=True)
    for level, colour in ((-20.0, BLUE), (0.0, GREEN), (20.0, RED)):
        mine = np.flatnonzero((np.abs(recorded["id_a"] - level) < 0.1) & (recorded["iq_a"] >= 0))
        mine = mine[np.argsort(recorded["iq_a"][mine])]
        seen, told = made[-1].curves("flux_map")
        left.add("dots", recorded["iq_a"][mine], seen[1, mine], colour, f"i_d = {level:g} A")
        left.add("line", recorded["iq_a"][mine], told[1, mine], colour)
    names = ("linear", "+ saturation", "+ cross")
    right = Panel("Error of rows held out", "", "rms [Wb]", log=True, x_labels=names)
    for n, one in enumerate(made):
        for shift, signal, colour in ((-0.17, "psi_q_wb", BLUE), (0.17, "psi_d_wb", OCHRE)):
            name = ("ψ_q" if signal == "psi_q_wb" else "ψ_d") if n == 0 else ""
            right.add("bars", [n + shift], [one.held_out[signal]], colour, name)
            right.notes.append((n + shift, one.held_out[signal], f"{one.held_out[signal]:.3f}"))
    return page([left, right])


FIGURES: dict[str, Callable[[], str]] = {
    "real-holding": holding,
    "real-timing": timing,
    "real-moteus": moteus,
    "real-baldor": baldor,
}


def main() -> None:
    """Writes every figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path, default=Path("docs/images"))
    parser.add_argument("names", nargs="*", default=list(FIGURES))
    asked = parser.parse_args()
    if not REAL.is_dir():
        raise SystemExit(f"the shared recordings are not at {REAL}")
    asked.into.mkdir(parents=True, exist_ok=True)
    for name in asked.names:
        (asked.into / f"{name}.svg").write_text(FIGURES[name](), encoding="utf-8")


if __name__ == "__main__":
    main()
