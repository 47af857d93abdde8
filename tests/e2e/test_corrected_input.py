"""A corrected input publishes the corrected number, into the same output as well."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.__main__ import main
from pipeline.estimation import registry as fit_registry
from pipeline.execution.caches import keys
from pipeline.io.registry.store import Registry
from pipeline.settings import configuration_folder
from pipeline.stages.steps import motor
from tests.registered import NOON

KT_NM_A = 0.748
QUICK = ("report=false", "recordings=false", "residual_test=false")
MAP = """about: log of a hall bench
recognise:
  header: "^time;Iq;Torque;Speed;Ud;Uq;Id"
layout:
  separator: ;
fields:
  time: {{column: t_s}}
  Iq: {{column: iq_a, unit: {unit}}}
  Id: {{column: id_a, unit: A}}
  Torque: torque_shaft_nm
  Speed: omega_mech_rad_s
  Ud: vd_v
  Uq: vq_v
metadata:
  motor_id: hall/7
  test: torque_map
  pole_pairs: 4
  station: hall
"""


class Hall:
    """A torque map of one motor in a bench's own form, its source map, and an output folder."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.input, self.output, self.conf = folder / "in", folder / "out", folder / "conf"
        self.input.mkdir()
        shutil.copytree(configuration_folder(), self.conf)
        monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "home"))
        self.state("A")
        rng = np.random.default_rng(7)
        levels = np.repeat([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0], 200)
        rows = ["time;Iq;Torque;Speed;Ud;Uq;Id"]
        for k, iq_a in enumerate(levels):
            torque_nm = KT_NM_A * iq_a - 0.02 + rng.normal(0.0, 1e-3)
            speed_rad_s = 50.0 + rng.normal(0.0, 1e-2)
            uq_v = 0.3 * iq_a + KT_NM_A / 6.0 * 4.0 * speed_rad_s
            rows.append(
                f"{k / 1000:.3f};{iq_a + rng.normal(0.0, 1e-3):.6f};{torque_nm:.6f};"
                f"{speed_rad_s:.6f};{-0.01 * iq_a:.6f};{uq_v:.6f};{rng.normal(0.0, 1e-3):.6f}"
            )
        (self.input / "map.csv").write_text("\n".join(rows) + "\n")

    def state(self, unit: str, *, voltages: bool = True) -> None:
        """States the unit of the logged q current in the map; voltages refute a wrong one."""
        text = MAP if voltages else re.sub(r"  U[dq]: .*\n", "", MAP)
        (self.conf / "source" / "hall.yaml").write_text(text.format(unit=unit))

    def results(self, output: Path) -> dict[str, bytes]:
        """Every file that is kept under a key."""
        files = (path for path in output.rglob("*") if path.is_file())
        named = {path.relative_to(output).as_posix(): path.read_bytes() for path in files}
        return {k: v for k, v in named.items() if not k.startswith((".cache/", "registry/"))}

    def run(self, output: Path | None = None, *more: str) -> int:
        words = [f"input={self.input}", f"output={output or self.output}", "workers=1"]
        words.append(f"config_dir={self.conf}")
        return main(["run", *words, *QUICK, *more])

    def sheet(self, output: Path | None = None) -> tuple[bytes, dict[str, Any]]:
        (path,) = ((output or self.output) / "datasheets").iterdir()
        return path.read_bytes(), json.loads(path.read_bytes())


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Hall:
    return Hall(tmp_path, monkeypatch)


def kt(said: dict[str, Any]) -> float:
    value = said["constants"]["kt_peak_nm_a"]["value"]
    assert isinstance(value, float), said["constants"]["kt_peak_nm_a"]
    return value


def test_kt_748_stays_no_more_when_the_unit_is_corrected(hall: Hall, tmp_path: Path) -> None:
    """Kept fits were named by the bytes of files alone: the old Kt came out as a new version."""
    hall.state("mA", voltages=False)
    hall.run()
    _, wrong = hall.sheet()
    assert kt(wrong) == pytest.approx(748.0, rel=0.01)
    hall.state("A", voltages=False)
    hall.run()
    content, right = hall.sheet()
    assert kt(right) == pytest.approx(KT_NM_A, rel=0.01)
    assert right["version"] != wrong["version"]

    hall.run(tmp_path / "anew", "cache=false")
    assert hall.sheet(tmp_path / "anew")[0] == content
    assert hall.run(None, "cache=false") != 1, "equal bytes are no conflict"
    assert hall.sheet()[0] == content

    registry = Registry(str(hall.output / "registry"))
    history = registry.history("hall/7")
    assert [version.version for version in history] == [wrong["version"], right["version"]]
    assert [kt(said) for said in registry.documents(history)] == [kt(wrong), kt(right)]


def told(capsys: pytest.CaptureFixture[str]) -> str:
    return capsys.readouterr().err


def test_a_wrong_registered_version_is_revoked_and_superseded(
    hall: Hall, capsys: pytest.CaptureFixture[str]
) -> None:
    """A registry holds Kt 748 under the version of the right work: the right bytes were refused."""
    hall.run(None, "registry=null")
    right, said = hall.sheet()
    wrong = json.loads(right)
    wrong["constants"]["kt_peak_nm_a"]["value"] = 748.0
    place = str(hall.output / "registry")
    registry = Registry(place)
    registry.publish([wrong], NOON)

    capsys.readouterr()
    assert hall.run() == 1
    error = told(capsys)
    assert "registered with other content" in error
    assert hall.run() == 1, "it stays an error until a person decides"
    command = re.search(r"`(registry revoke .*?)`", error)
    assert command is not None, error
    words = shlex.split(command[1].replace("by=NAME", "by='A. Smith'").replace("=REASON", "=unit"))
    assert main(words) == 0

    assert hall.run() == 0
    content, new = hall.sheet()
    assert new["version"] != said["version"]
    assert new["supersedes"] == {"version": said["version"], "by": "A. Smith", "why": "unit"}
    alone = ("version", "supersedes")
    assert {k: v for k, v in new.items() if k not in alone} == {
        k: v for k, v in said.items() if k not in alone
    }
    old, now = registry.history("hall/7")
    assert (old.status, now.status, now.version) == ("revoked", "provisional", new["version"])
    assert registry.documents([old, now]) == [wrong, new]
    assert registry.verify().faults == ()
    capsys.readouterr()
    main(["registry", "show", "hall/7", f"registry={place}"])
    assert f"takes the place of version {said['version'][:12]}, revoked by A. Smith: unit" in (
        capsys.readouterr().out
    )

    for more in ((), ("cache=false",)):
        assert hall.run(None, *more) == 0
        assert hall.sheet()[0] == content, "the same work gives the same bytes again"
    main(["registry", "revoke", "hall/7", "revision=1", "by=B", "why=again", f"registry={place}"])
    assert hall.run() == 0
    assert hall.sheet()[0] == content, "the first reason is the one that counts"


def test_revoking_a_version_that_a_broken_cache_made_makes_its_fits_anew(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kt 1 % off, kept by every cache: the revocation doubts them all, the next run fits again."""
    kept = fit_registry.estimators

    def broken() -> Any:
        return tuple(
            replace(e, fit=lambda *a, fit=e.fit: moved(fit(*a))) if e.name == "torque_map" else e
            for e in kept()
        )

    def moved(fit: Any) -> Any:
        values = (replace(e, value=e.value * 1.01) if e.known else e for e in fit.estimates)
        return replace(fit, estimates=tuple(values))

    with monkeypatch.context() as patch:
        patch.setattr(fit_registry, "estimators", broken)
        hall.run()
    wrong = hall.sheet()[1]
    assert kt(wrong) == pytest.approx(1.01 * KT_NM_A, rel=1e-3)
    hall.run()
    assert hall.sheet()[1] == wrong, "nothing that a key holds has changed"
    registry = f"registry={hall.output / 'registry'}"
    version = f"version={wrong['version'][:12]}"
    assert main(["registry", "revoke", "hall/7", version, "by=A", "why=1 % off", registry]) == 0
    hall.run()
    right = hall.sheet()[1]
    assert kt(right) == pytest.approx(KT_NM_A, rel=1e-3)
    assert right["supersedes"] == {"version": wrong["version"], "by": "A", "why": "1 % off"}


def test_a_file_that_killed_its_reader_once_is_read_again(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy machine may have been at fault: neither motor nor batch is kept as done."""
    whole = motor.process_motor
    with monkeypatch.context() as patch:
        patch.setattr(motor, "process_motor", lambda job: whole(job.without("map.csv", "killed")))
        assert hall.run() == 3
    assert hall.run() == 0
    assert kt(hall.sheet()[1]) == pytest.approx(KT_NM_A, rel=0.01)


OF_DASK = {"executor", "scheduler", "tls_ca", "tls_cert", "tls_key"}
"""tests/faults/test_dask.py holds that such workers write the same bytes."""
OF_WATCH = {"watch"}
"""tests/e2e/test_watch.py: such a run stays."""
ELSEWHERE = {
    "settle_s": "settle_s=5",
    "input": "input={place}/moved",
    "output": "output={place}/another",
    "workers": "workers=3",
    "cache": "cache=false",
    "timings": "timings=true",
    "json": "json=true",
    "config_dir": "config_dir={place}/in_another_place",
    "registry_options": "registry_options.timeout=30s",
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The results of a run that states none of these settings."""
    with pytest.MonkeyPatch.context() as patch:
        hall = Hall(tmp_path_factory.mktemp("plain"), patch)
        hall.run(None, "report=true")
    return hall.results(hall.output)


@pytest.mark.parametrize("name", sorted(ELSEWHERE))
def test_what_no_key_holds_changes_no_byte(
    hall: Hall, tmp_path: Path, plain: dict[str, bytes], name: str
) -> None:
    """Each setting that is left out of the keys of motor and batch."""
    assert set(ELSEWHERE) | OF_DASK | OF_WATCH == keys.NOT_OF_A_BATCH
    assert {"input", "output", "key", "refused"} == keys.NOT_OF_A_MOTOR
    shutil.copytree(hall.input, tmp_path / "moved")
    shutil.copytree(hall.conf, tmp_path / "in_another_place")
    output = tmp_path / ("another" if name == "output" else "out")
    words = ["report=true", ELSEWHERE[name].format(place=tmp_path)]
    hall.run(None, *words)
    assert hall.results(output) == plain
    assert "report/index.html" in plain
