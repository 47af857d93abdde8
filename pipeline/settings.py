"""The shape of `conf/`: plain dataclasses that Hydra merges the YAML files into.

One class a command. `key` gives a field its default and the words that `--help` prints; keys that
change no result (where to, how fast) are marked so and stay out of the configuration's digest.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any

import pipeline
from pipeline.records.errors import UsageError, meant


def key(
    default: Any,
    words: str,
    *,
    result: bool = True,
    package: str | None = None,
    place: bool = False,
    one_of: tuple[str, ...] = (),
) -> Any:
    """A settings field; `result` is False where the value cannot change what is computed.

    `package` is one each of whose modules is a name that the key takes. A `place` is a file,
    folder or URL: never empty, and `~` is the user's home. `one_of` are all values that there are.
    """
    metadata = {
        "words": words,
        "result": result,
        "package": package,
        "place": place,
        "one_of": one_of,
    }
    if isinstance(default, (dict, list)):
        return field(default_factory=lambda: type(default)(default), metadata=metadata)
    return field(default=default, metadata=metadata)


# keys of several commands
_input = partial(
    key, "data/demo", "folder of captures, searched with its subfolders", result=False, place=True
)
_output = partial(
    key, "reports/demo", "folder for everything that is written", result=False, place=True
)
_source = partial(
    key,
    "auto",
    "source map for foreign files, a name or path/to/map.yaml; auto recognises them",
    place=True,
)
_limits = partial(
    key, "default", "limits file of conf/limits/: constants a release must hold", place=True
)
_policy = partial(
    key, {}, "constants of judgement: policy.SECTION.FIELD=number, or policy=NAME of conf/policy/"
)
_constants = partial(
    key, {}, "stated constants: constants.NAME=number and constants.u_NAME=its standard uncertainty"
)
_registry = partial(
    key, "auto", "folder or URL; auto is registry/ in output", result=False, place=True
)


@dataclass(kw_only=True)
class Settings:
    """Keys that every command shares; a command's own are in its subclass."""

    json: bool = key(False, "print one JSON object in place of the text", result=False)
    timings: bool = key(False, "print the wall time of each stage", result=False)
    config_dir: str | None = key(
        None, "a conf/ of your own, as --config-dir: its files come first", result=False, place=True
    )


@dataclass(kw_only=True)
class ReadingSettings(Settings):
    """Keys of every command that reads foreign files."""

    read_seconds: float = key(
        60.0, "longest time for reading one file, and 1 s more a MB", result=False
    )
    read_memory_mb: int = key(
        1024, "most memory for reading one file, and 16 times its size more", result=False
    )


@dataclass(kw_only=True)
class ModelSettings:
    """`model.name` and `model.effects`: which model is held against the recordings."""

    name: str = key(
        "standard",
        "ideal, or standard: with copper_temperature, magnet_temperature and coulomb_friction; "
        "model=NAME says the same",
    )
    effects: list[str] = key(
        [],
        "[a,b] adds effects, [-a] takes one away: those of effects_path, and these",
        package="pipeline.criticism.effects",
    )


@dataclass(kw_only=True)
class OperateSettings:
    """`operate.KEY`: what the torque curve, ratings and losses of a motor are derived at."""

    vdc_v: float | None = key(None, "DC bus voltage; the highest in the captures without it")
    current_a: float | None = key(
        None, "current limit, phase peak; the highest in the captures without it"
    )
    temp_winding_degc: float | None = key(None, "winding, of the peak curve; 25 without it")
    temp_magnet_degc: float | None = key(None, "magnet, of the peak curve; 25 without it")
    temp_ambient_degc: float | None = key(None, "ambient, of continuous torque; 40 without it")
    temp_limit_degc: float | None = key(
        None, "winding's limit; 80 K over ambient without it (IEC 60034-1, class 130)"
    )
    voltage_share: float | None = key(None, "of vdc/√3 that the inverter uses; 1 without it")
    drop_v: float | None = key(None, "what a conducting device of the inverter drops")
    on_ohm: float | None = key(None, "and its resistance; neither: no inverter loss")


@dataclass(kw_only=True)
class RunSettings(ReadingSettings):
    """`run`: captures in; datasheets, checks, report and recordings out."""

    input: str = _input()
    output: str = _output()
    source: str = _source()
    release: str = key(
        "manual",
        "manual, or auto: release a datasheet that meets every condition",
        one_of=("manual", "auto"),
    )
    limits: str = _limits()
    recover: bool = key(False, "use the good part of MCAP files that are cut off, unverified")
    workers: int = key(0, "motors worked on at once; 0 is one a core", result=False)
    executor: str = key("local", "local processes, or dask", result=False)
    scheduler: str | None = key(
        None, "tls://HOST:PORT of a Dask cluster; dask starts its own without", result=False
    )
    tls_ca: str | None = key(
        None, "certificate of the cluster's authority", result=False, place=True
    )
    tls_cert: str | None = key(None, "certificate of this client", result=False, place=True)
    tls_key: str | None = key(None, "key of that certificate", result=False, place=True)
    watch: bool = key(
        False, "stay, and run again whenever captures have arrived in input", result=False
    )
    settle_s: float = key(
        1.0, "with watch=true: how long nothing in input may change before a run", result=False
    )
    prune: bool = key(
        False, "remove the motors of earlier runs that output holds beside these", result=False
    )
    cache: bool = key(True, "remember in output/.cache what need not be done again", result=False)
    recordings: bool = key(True, "write a Rerun recording a capture", result=False)
    report: bool = key(True, "write the HTML report", result=False)
    registry: str | None = key(
        "auto",
        "folder or URL that keeps every version; auto is registry/ in output, null is none",
        result=False,
        place=True,
    )
    registry_options: dict[str, Any] = key({}, "of deltalake, for a URL", result=False)
    residual_test: bool = key(
        True,
        "hold the captures against model= down to their noise, as diagnose does; false: "
        "not_tested, which a person may release and release=auto does not",
    )
    diagnose: str = key(
        "auto",
        "auto: name what the model lacks, with sizes, where residuals are over their floor; true: "
        "and write diagnosis/ as `diagnose` does; false: say only that something is missing",
        one_of=("auto", "true", "false"),
    )
    model: ModelSettings = field(default_factory=ModelSettings)
    policy: dict[str, Any] = _policy()
    operate: OperateSettings = field(
        default_factory=OperateSettings, metadata={"result": False, "words": ""}
    )
    fit: dict[str, Any] = key({}, "options of an estimator: fit.ESTIMATOR.OPTION=number")
    constants: dict[str, Any] = _constants()
    gates: dict[str, Any] = key({}, "options of a gate: gates.GATE.OPTION=number")
    crosscheck: dict[str, Any] = key({}, "options of a check: crosscheck.CHECK.OPTION=number")


@dataclass(kw_only=True)
class CalcSettings(Settings):
    """`calc`: one conversion with its formula."""

    kind: str = key("", "wye-delta, copper, ke-kt, kv, grip, pole-pairs or saliency")
    values: dict[str, str] = key({}, "what is given, each as name=number with its unit")


@dataclass(kw_only=True)
class InspectSettings(ReadingSettings):
    """`inspect`: what a file or folder holds, and a source map for it."""

    file: str = key("", "any file, or a folder of them", place=True)
    map: str | None = key(None, "where to write the source map, such as bench.yaml", place=True)
    check: bool = key(
        False, "read every capture through the map and say which constants it determines"
    )
    answers: dict[str, str] = key(
        {},
        "what the files do not say: unit.NAME=mA, scale.NAME=1e-4 of counts, column.NAME=iq_a or "
        "none, times.NAME=FIELD of a duty cycle, increment_s=1e-4, captures=proposed to cut files "
        "into the parts that their rows show, and metadata such as motor_id=M1 test=drive "
        "pole_pairs=7",
    )


@dataclass(kw_only=True)
class PlanSettings(ReadingSettings):
    """`plan`: which test to record next."""

    output: str = key(
        "reports/demo", "output folder of a run: the plan is of its datasheets", place=True
    )
    input: str | None = key(
        None, "folder of captures to plan from, where there is no run of them", place=True
    )
    source: str = _source()
    motor: str | None = key(None, "motor_id; every motor without it")
    limits: str = _limits()
    constants: dict[str, Any] = _constants()


@dataclass(kw_only=True)
class RegistrySettings(Settings):
    """`registry`: the versions that runs published."""

    action: str = key("", "list, show, diff, at, verify, approve, revoke, tag or untag")
    motor: str | None = key(None, "motor_id; for `at` the date may stand here")
    output: str = key("reports/demo", "output folder of a run", place=True)
    registry: str = key("auto", "folder or URL; auto is registry/ in output", place=True)
    registry_options: dict[str, Any] = key({}, "of deltalake, for a URL")
    revision: str | None = key(None, "1, 2, ... of the motor, for show, approve and revoke")
    version: str | None = key(None, "beginning of the version's digest, instead of a revision")
    from_: str | None = key(None, "revision, for diff")
    to: str | None = key(None, "revision, for diff")
    date: str | None = key(None, "2026-03-01 (its end, UTC) or 2026-03-01T12:00Z, for at")
    by: str | None = key(None, "who approves, revokes or tags")
    why: str | None = key(None, "why")
    tag: str | None = key(None, "name that versions bear, for tag and untag")
    select: str | None = key(None, "selector of the versions to tag, such as lot:A, or a motor")


@dataclass(kw_only=True)
class RegressSettings(Settings):
    """`regress`: whether a lot, or a version of the code, still gives the same."""

    baseline: str = key(
        "",
        "selector: FIELD:VALUE,VALUE,FIELD:VALUE with * and ?; fields are lot, type, station, "
        "motor, tag, status, version, revision, code, date, since, until (docs/lots.md)",
    )
    candidate: str = key("", "selector of what is judged; its motors are left out of the baseline")
    limits: str = key("default", "limits file of conf/limits/, or the path of one", place=True)
    mode: str = key(
        "auto", "auto, lots, or code: the same captures under two versions of the pipeline"
    )
    output: str = _output()
    registry: str = _registry()
    registry_options: dict[str, Any] = key({}, "of deltalake, for a URL", result=False)
    diagnoses: str = key(
        "auto", "folders of diagnoses, separated by commas; auto is diagnosis/ in output and beside"
    )
    lint: bool = key(False, "only check the limits file, and say what is wrong with it")


@dataclass(kw_only=True)
class ExportSettings(Settings):
    """`export`: one controller's configuration from a released datasheet."""

    format: str = key(
        "", "c-header, csv, json, moteus, mujoco, odrive, simplefoc, simscape, ssv, vesc"
    )
    motor: str = key("", "motor_id")
    revision: str | None = key(None, "1, 2, ... of the motor; the newest released without it")
    version: str | None = key(None, "beginning of the version's digest, instead of a revision")
    output: str = key("reports/demo", "folder to write export/ to", result=False, place=True)
    registry: str = _registry()
    registry_options: dict[str, Any] = key({}, "of deltalake, for a URL", result=False)
    options: dict[str, Any] = key({}, "of the format: options.NAME=value")


@dataclass(kw_only=True)
class SimulateSettings(Settings):
    """`simulate`: captures of a simulated motor, and what is true of it."""

    output: str = key("", "folder to write to", result=False, place=True)
    motor: str = key("gimbal-5208", "design of conf/motor/")
    effects: str = key("", "[name, name=size, name.parameter=value, ...]; a name alone is typical")
    outside: str | None = key(None, "a term of no library on top: eddy_brake, contact, ...")
    seed: int = key(1, "of every random draw")
    motor_id: str | None = key(None, "serial number; the design and the seed without it")
    lot: str = key("A", "lot")
    exact: bool = key(False, "instruments without gain errors")
    encoding: str = key("mixed", "mixed, csv, json, protobuf, cdr, or json_samples and the like")
    fleet: str | None = key(None, "fleet of conf/fleet/: many motors at once, seed its own")


@dataclass(kw_only=True)
class CompareSettings(ReadingSettings):
    """`compare`: where a model is off, signal by signal."""

    input: str = _input()
    output: str = _output()
    source: str = _source()
    motor: str | None = key(None, "motor_id; every motor without it")
    model: ModelSettings = field(default_factory=ModelSettings)
    policy: dict[str, Any] = _policy()
    effects_path: str | None = key(None, "folder of your own effects, one file each", place=True)
    constants: dict[str, Any] = _constants()


@dataclass(kw_only=True)
class DiagnoseSettings(CompareSettings):
    """`diagnose`: which effect is missing, how sure that is, what else it could be."""


@dataclass(kw_only=True)
class ReviewSettings(Settings):
    """`review`: what a run and its diagnoses recorded, in the Rerun viewer."""

    output: str = key("reports/demo", "output folder of a run", place=True)
    motor: str | None = key(None, "motor_id: its captures, ladder and comparison; else the fleet")
    lot: str | None = key(None, "lot: its motors, and the regressions it took part in")
    web: bool = key(False, "serve a browser instead of opening a window; on this machine only")
    port: int = key(0, "port of the web page, the fleet's table on the next; 0 takes free ones")


def result_document(settings: Settings) -> dict[str, Any]:
    """The settings that can change a result, as plain data for a digest."""
    kept = {f.name for f in fields(settings) if f.metadata.get("result", True)}
    return {name: value for name, value in sorted(asdict(settings).items()) if name in kept}


def named_file(group: str, name: str, config_dir: str | None = None) -> Path:
    """The file `GROUP/NAME.yaml` of the user's configuration folder, or of the package's.

    Raises UsageError where neither holds it, with the names that there are.
    """
    places = (
        [configuration_folder()]
        if config_dir is None
        else [Path(config_dir), configuration_folder()]
    )
    files = {path.stem: path for at in reversed(places) for path in (at / group).glob("*.yaml")}
    if name in files:
        return files[name]
    noun = "limits file" if group == "limits" else group
    raise UsageError(f"no {noun} {name!r}", meant(name, sorted(files)))


def configuration_folder() -> Path:
    """The folder `conf/`: beside the package in a checkout, inside it in a wheel.

    Raises UsageError where it is missing.
    """
    package = Path(pipeline.__file__).parent
    for folder in (package.parent / "conf", package / "conf"):
        if (folder / "command").is_dir():
            return folder
    raise UsageError("the configuration folder conf/ is missing", "reinstall the package")
