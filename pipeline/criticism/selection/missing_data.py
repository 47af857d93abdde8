"""What a campaign's captures lack: equations that use them, temperatures, tests of an effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.criticism.data.drive_log import drive_log
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.data.settling import unexplained_voltage
from pipeline.criticism.data.traces import with_values
from pipeline.criticism.data.unlogged_load import unexplained_share
from pipeline.criticism.effect import Effect, Evidence
from pipeline.criticism.library.equations import equation_of, equations
from pipeline.criticism.parameter import UNLOGGED, Machine
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.residuals.segments import known_tests, mixed_setups
from pipeline.criticism.selection.alternatives import detectable
from pipeline.criticism.selection.candidates import Candidate
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.numerics.coast_setups import REMEDY, setup_words
from pipeline.physics.glossary import of_ohmmeter
from pipeline.records.capture import Campaign, Capture
from pipeline.records.diagnosis import Unexcited


def mixed_coasts(campaign: Campaign, machine: Machine) -> tuple[str, ...]:
    """A note of the coasts that are left out, since they are of several set-ups.

    Parameters
    ----------
    campaign
        All captures of one motor.
    machine
        Policy.

    """
    setups = mixed_setups(campaign, machine)
    return (f"coasts left out: {setup_words(setups)}; {REMEDY}",) if setups else ()


def unused_captures(campaign: Campaign, cut_segments: Sequence[Segment]) -> tuple[str, ...]:
    """A note of the captures that no equation could use, none where all are used.

    Parameters
    ----------
    campaign
        Captures of the motor.
    cut_segments
        Segments made of them.

    Returns
    -------
    tuple of str
        Empty where all captures are used.

    """
    used = {segment.capture for segment in cut_segments}
    unused_paths = [
        c.path for c in campaign.captures if c.path not in used and c.meta.test in known_tests()
    ]
    reason = "without the signals of their test's equation, or an even stretch of samples"
    return (f"not used, {reason}: {', '.join(sorted(unused_paths))}",) if unused_paths else ()


def unusable_captures(campaign: Campaign, machine: Machine) -> tuple[str, ...]:
    """Why no capture is used, and what each would need.

    Parameters
    ----------
    campaign
        All captures of one motor, none of which any equation took.
    machine
        Policy.

    Returns
    -------
    tuple of str
        One sentence a cause.

    """
    needs: dict[str, list[str]] = {}
    for capture in campaign.captures:
        needs.setdefault(_needs(capture), []).append(capture.path)
    causes = (*mixed_coasts(campaign, machine), *loaded_drives(campaign, machine))
    lacking = (f"{', '.join(sorted(paths))}: {need}" for need, paths in sorted(needs.items()))
    return causes or tuple(lacking)


def _needs(capture: Capture) -> str:
    """What the equation that a capture is nearest to needs of it."""
    test = capture.meta.test
    if of_ohmmeter(test, capture.columns):
        return (
            "no equation takes the readings of an ohmmeter, which show no current; a run makes "
            "r_phase_ohm of them, and a test with a recorded current shows more"
        )
    takers = [equation for equation in equations().values() if test in equation.tests]
    if not takers:
        return f"no equation takes a {test}"
    missing = [[n for n in equation.columns if not capture.has(n)] for equation in takers]
    fewest = min(map(len, missing))
    if not fewest:
        return (
            f"the {test} has the columns of an equation, but too few even samples, or no motion "
            "(theta_mech_rad, omega_mech_rad_s)"
        )
    ways = dict.fromkeys(" with ".join(names) for names in missing if len(names) == fewest)
    return f"a {test} needs {' or '.join(ways)} as well"


def loaded_drives(campaign: Campaign, machine: Machine) -> tuple[str, ...]:
    """Notes of the drives whose motion is not used, since an unrecorded torque turns the shaft.

    Parameters
    ----------
    campaign
        All captures of one motor.
    machine
        Its orders of torque against angle.

    """
    shares: dict[bool, dict[str, float]] = {True: {}, False: {}}
    for recorded in campaign.of("drive"):
        capture = None if recorded.has("torque_shaft_nm") else with_values(recorded)
        if capture is None or not capture.has("t_s"):
            continue
        share, current = None, capture.has("iq_a")
        if current:
            log = drive_log(capture, machine)
            used = log is not None and (log.angle or not capture.has("vq_v"))
            share = unexplained_share(log, machine) if log and used else None
        elif capture.has("vq_v"):
            share = unexplained_voltage(capture, machine.policy)
        if share is not None and share >= machine.policy.cutting.unexplained_share:
            shares[current][recorded.path] = share
    where = {
        current: ", ".join(f"{path} {100.0 * share:.2g} %" for path, share in sorted(paths.items()))
        for current, paths in shares.items()
    }
    notes = {
        True: "the motion of these drives gives no inertia and no friction, as a torque that "
        "nothing recorded turns the shaft (acceleration that does not follow the current over "
        f"what does, squared): {where[True]}; log torque_shaft_nm, or record with nothing coupled "
        "to the shaft",
        False: "these drives without a current are not used, as a torque that nothing recorded "
        "turns the shaft (voltage that follows neither speed nor acceleration over what the latter "
        f"takes, squared): {where[False]}; log iq_a, or record with nothing coupled to the shaft",
    }
    return tuple(notes[current] for current, paths in shares.items() if paths)


def unlogged_temperatures(fit: Fit) -> tuple[str, ...]:
    """Notes of the captures in which a temperature that the model uses was not recorded.

    Parameters
    ----------
    fit
        Segments, model and values.

    Returns
    -------
    tuple of str
        One a temperature, with the uncertainty that it is taken with, and one a capture that only
        a temperature beyond it explains.

    """
    model, cut_segments, notes = fit.model, fit.segments, []
    for effect in model.effects:
        for name in (signal for signal in effect.signals if signal.startswith("temp_")):
            warmed = (s for s in cut_segments if effect.hook in equation_of(s).use.warms)
            cold = {s.capture for s in warmed if name not in s.recorded}
            if cold:
                where = ", ".join(sorted(cold))
                u_k = model.priors()[UNLOGGED[name]][1]
                notes.append(f"no {name}, taken to be at ambient temperature ± {u_k:g} K: {where}")
                notes += [
                    f"{path} is as a {name} of about {warmer:+.0f} K beside the other captures "
                    "makes it, which none of these records: log it"
                    for path, warmer in _warmer(fit, name).items()
                    if abs(warmer) > u_k
                ]
    return tuple(dict.fromkeys(notes))


def unrecorded_signals(campaign: Campaign, cut_segments: Sequence[Segment]) -> tuple[str, ...]:
    """Notes of the signals that captures do not record, and that were taken as none or as another.

    Parameters
    ----------
    campaign
        Captures of the motor.
    cut_segments
        The segments that are made of them.

    Returns
    -------
    tuple of str
        One a signal: what it was taken as, and in which captures.

    """
    used = {segment.capture for segment in cut_segments}
    captures = [c for c in campaign.captures if c.path in used and c.has("t_s")]
    without_d = [c.path for c in captures if c.has("iq_a") and not c.has("id_a")]
    by_speed = [
        c.path
        for c in captures
        if c.has("omega_mech_rad_s") and not (c.has("theta_mech_rad") or c.has("theta_elec_rad"))
    ]
    cases = (("id_a", "taken as zero", without_d), ("angle", "known by omega_mech_rad_s", by_speed))
    return tuple(
        f"what is left may be of an {name} that was not recorded, and is {how}: log it in "
        + ", ".join(sorted(paths))
        for name, how, paths in cases
        if paths
    )


def _warmer(fit: Fit, name: str) -> dict[str, float]:
    """How much warmer [K] each capture without this temperature is fitted than most of them."""
    known = fit.model.machine.unlogged
    fitted = {
        path: fit.values[key]
        for key, (signal, path) in known.items()
        if signal == name and key.startswith(UNLOGGED[name])
    }
    # what all have in common is in the shared nuisance, or in theirs
    usual = float(np.median(list(fitted.values()))) if fitted else 0.0
    return {path: value - usual for path, value in fitted.items()}


def unexcited_effects(
    campaign: Campaign,
    library: Mapping[str, Effect],
    last: LadderStep,
    offered: Sequence[Candidate],
) -> tuple[Unexcited, ...]:
    """Effects that no capture would show at typical size.

    Parameters
    ----------
    campaign
        Captures of the motor.
    library
        Every effect by name.
    last
        The last step of the search.
    offered
        The candidates on it.

    Returns
    -------
    tuple of Unexcited
        Each with the tests that are missing, or the signals missing in them. An effect whose first
        test was recorded with all its signals is not among them.

    """
    inside = {effect.name for effect in last.system.fit.model.effects}
    least, hidden = last.system.policy.selection.visible_u, []
    for name, effect in library.items():
        lacking = tuple(test for test in effect.tests if not _has_signals(campaign, effect, test))
        if name in inside or not lacking or lacking[0] != effect.tests[0]:
            continue
        if detectable(effect, last.system, offered) < least:
            signals = _missing(campaign, effect, lacking)
            hidden.append(Unexcited(name, lacking, effect.experiment, signals))
    return tuple(hidden)


def _has_signals(campaign: Campaign, effect: Evidence, test: str) -> bool:
    """Whether some capture is of a test and has every signal that shows an effect."""
    captures = campaign.of(test)
    return any(all(capture.has(name) for name in effect.signals) for capture in captures)


def _missing(campaign: Campaign, effect: Evidence, tests: Sequence[str]) -> tuple[str, ...]:
    """Signals of an effect that no capture of these tests has, none where there is no capture."""
    captures = campaign.of(*tests)
    if not captures:
        return ()
    return tuple(n for n in effect.signals if not any(capture.has(n) for capture in captures))
