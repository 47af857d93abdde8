"""A user's effect file with a mistake in it: one line of file, line and remedy, whatever it is."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from pipeline.__main__ import main
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.library.registry import effects
from pipeline.criticism.library.user_effects import Hook
from pipeline.criticism.parameter import SCALES
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.errors import UsageError
from tests.unit.criticism.machines import operating

BRAKE = """import numpy as np
from pipeline.criticism.effect import Effect, Parameter
def torque(x, q):
    drag = q["torque_nm"] * x.omega_rad_s / q["speed_rad_s"]
    return drag
EFFECT = Effect(
    name="eddy_brake", words="w", signature="s", tests=("spin_down",),
    experiment="e", reference="r",
    parameters=(
        Parameter("torque_nm", "N·m", 0.03, 0.0005, "torque_nm"),
        Parameter("speed_rad_s", "rad/s", 0.3, 0.0, "speed_rad_s", scan=(0.3,)),
    ),
    torque=torque,
)
"""
Q = {"torque_nm": 0.1, "speed_rad_s": 80.0}


def folder(tmp_path: Path, was: str = "", now: str = "") -> str:
    assert was in BRAKE
    text = BRAKE.replace(was, now, 1) if was else BRAKE
    (tmp_path / "eddy_brake.py").write_text(text, encoding="utf-8")
    return str(tmp_path)


@pytest.mark.parametrize(
    ("was", "now", "line", "words"),
    [
        ("def torque", "def (torque", 3, "SyntaxError"),
        ("signature=", "signatur=", 6, "unexpected keyword argument 'signatur'"),
        ('0.0005, "torque_nm"', '0.0005, "torqe_nm"', 10, "did you mean 'torque_nm'"),
        ('q["speed_rad_s"]', 'q["sped_rad_s"]', 4, "its parameters are torque_nm, speed_rad_s"),
        ("return drag", "return drag / x.machine.scales['omega_rad_s']", 5, "scales are current_a"),
        ("import numpy", "import nothing_there\nimport numpy", 1, "nothing_there"),
        ("import numpy", "import sys; sys.exit(0)\nimport numpy", 1, "it ends the program"),
        ("parameters=(", "parameters=3 or (", None, "TypeError"),
        ("return drag", "return 1e-3 + drag", None, "is not zero at zero parameters"),
        *(
            ("torque=torque,", f"torque=torque, in_place_of={named},", None, words)
            for named, words in (
                (("late_torqe_s", "torque_nm"), "did you mean late_torque_s?"),
                (("late_torque_s", "torqe_nm"), "did you mean torque_nm?"),
                (("j_kgm2", "torque_nm"), "known are ripple_slope"),
                (("late_torque_s",), "name a nuisance and a parameter"),
            )
        ),
    ],
)
def test_what_loading_tells(tmp_path: Path, was: str, now: str, line: int | None, words: str):
    with pytest.raises(UsageError) as told:
        effects(folder(tmp_path, was, now))
    assert str(told.value).startswith("eddy_brake.py")
    assert words in str(told.value)
    assert line is None or f"line {line}:" in str(told.value)


@pytest.mark.parametrize(
    ("now", "line", "words"),
    [
        ("return drag[:3]", 3, "shape (3,) for samples of shape (60,)"),
        ("return np.nan * drag", 3, "no finite number at 60 of 60 samples"),
        ("raise ValueError('boom')", 5, "ValueError: boom"),
        ("raise SystemExit(0)", 5, "it ends the program"),
        ("return 'much'", 3, "gives str and no numbers"),
        ("return 1j * drag", 3, "gives complex numbers; return real ones"),
    ],
)
def test_what_a_hook_does_wrong_is_told_when_it_does_it(
    tmp_path: Path, now: str, line: int, words: str
):
    """Loading lets it pass, for it may be right for another motor."""
    effect = effects(folder(tmp_path, "return drag", now))["eddy_brake"]
    with pytest.raises(UsageError) as told:
        effect.torque(operating(), Q)
    assert f"eddy_brake.py, line {line}: torque of effect eddy_brake" in str(told.value)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_a_good_hook_gives_what_it_gave_also_in_another_process(tmp_path: Path):
    effect = effects(folder(tmp_path))["eddy_brake"]
    x = operating()
    expected = 0.1 * x.omega_rad_s / 80.0
    np.testing.assert_array_equal(effect.torque(x, Q), expected)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(effect)).torque(x, Q), expected)


def test_a_hook_may_give_one_number_for_all_samples(tmp_path: Path):
    """A constant drag ended a diagnosis with: 'float' object has no attribute 'any'."""
    effect = effects(folder(tmp_path, "return drag", 'return q["torque_nm"]'))["eddy_brake"]
    x = operating()
    drag = effect.torque(x, Q)
    assert drag.shape == x.omega_rad_s.shape
    assert (drag == 0.1).all()


def test_samples_that_nothing_is_known_of_may_stay_unknown(tmp_path: Path):
    effect = effects(folder(tmp_path))["eddy_brake"]
    x = operating()
    x.omega_rad_s[3] = np.nan
    assert np.isnan(effect.torque(x, Q)[3])


def test_a_scale_of_what_a_machine_expands_to_is_known_too(tmp_path: Path):
    way = '    expand=lambda m: (Parameter("a", "1", 1.0, 0.1, "lenght_m"),),\n    torque=torque,'
    effect = effects(folder(tmp_path, "    torque=torque,", way))["eddy_brake"]
    with pytest.raises(UsageError, match=r"a has the scale 'lenght_m'"):
        effect.every(operating().machine)


def test_hooks_of_the_library_are_called_as_they_are():
    for effect in effects().values():
        assert not isinstance(effect.torque, Hook)


def test_scales_are_those_of_every_machine():
    assert set(machine_of(Campaign("m", ()), Constants()).scales) == set(SCALES)


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_the_command_says_it_in_one_line_before_it_reads(tmp_path: Path, capsys, command: str):
    """Also where the effect is not named: `diagnose` ranks all of the folder."""
    (tmp_path / "in").mkdir()
    own = folder(tmp_path, "import numpy", "import sys; sys.exit(0)\nimport numpy")
    words = [f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}", f"effects_path={own}"]
    assert main([command, *words]) == 2
    assert capsys.readouterr().err.startswith("error: eddy_brake.py, line 1: it ends the program")
