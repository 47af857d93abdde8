"""Whatever is handed to the work whose result is kept is in its key: one thing changed at a time.

Each key is a digest of named parts. A change of anything that the work gets must change the key;
with any one part left out there must be a change that the key does not see, so no part is idle and
none is untested.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import polars as pl
import pytest

from pipeline.execution.caches import keys
from pipeline.execution.jobs import MotorJob
from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.identification import Question
from pipeline.io.ingest.survey import Survey
from pipeline.io.maps.source_map import FieldMap, SourceMap, TimeMap
from pipeline.io.tables.csv_dialect import CsvDialect
from pipeline.records.capture import Campaign, Capture, CaptureMeta, Mask
from pipeline.records.comparison import ModelSpec
from pipeline.records.content import content_digest
from pipeline.records.datasheet import Superseded
from pipeline.records.estimate import Estimate, Order
from pipeline.records.finding import Finding
from pipeline.records.ledger import Revocation
from pipeline.records.uncertainty import Contribution
from pipeline.settings import RunSettings
from tests.changes import changes

HALL = SourceMap(
    "hall",
    files=("*.txt",),
    header="^Time",
    topics=("/bench",),
    layout=CsvDialect(separator=";", names=("Time", "Iq"), missing=("-",)),
    fields=(FieldMap("Time", "t_s", "ms"), FieldMap("Iq", "iq_a", None, -1.0, 2.0, 0.5)),
    time=TimeMap("field", 100.0, 0.25, 0.5),
    joint="wrist",
    reader="hall",
    metadata=(("test", "drive"), ("station", "hall")),
    per_file=(("a*", (("lot", "7"),)),),
)
FINDING = Finding("a.txt", "warning", "gap", "a gap", "close it", (3, 5))
ENTRIES = (
    Entry("a.txt", "a" * 64, "csv", HALL, (("motor_id", "m"), ("test", "drive"))),
    Entry("b.mcap", "b" * 64, "mcap", None, (("motor_id", "m"), ("pole_pairs", "7")), True),
)
REVOKED = Revocation("v" * 64, "c" * 64, "A. Smith", "unit")
META = CaptureMeta(
    "m",
    "drive",
    lot="A",
    pole_pairs=7,
    ambient_degc=25.0,
    voltage_kind="commanded",
    extra={"kv_rpm_v": "90", "note": "-"},
)
TABLE = pl.DataFrame({"t_s": [0.0, 0.1, 0.2], "iq_a": [0.5, -0.25, 0.0]})
CAPTURE = Capture(
    "a.txt", "a" * 64, "verified", META, (TABLE, TABLE.rename({"iq_a": "id_a"})),
    (Mask("spikes", 0, np.array([True, False, True])),),
)  # fmt: skip
SCATTER = Contribution("scatter", 1e-3, "A", 40.0)
ESTIMATE = Estimate(
    "r_phase_ohm", 0.3, "ohm", "measured", "resistance", (SCATTER,), {"temp_winding_degc": 25.0},
    ("a.txt",), "as found", (0.0, 1.0), False, (Order(6, 0.1, 0.01, 0.2),),
)  # fmt: skip
CAMPAIGN = Campaign("m", (CAPTURE,))
QUESTION = Question("a.txt", "a.meta.yaml", (("lot", "7"),))
GATES, FIT = {"clipping": {"share": 0.1}}, {"derived": {"temp_degc": 25.0}}
JOB = MotorJob(
    "m", ENTRIES, "in", "out", "d" * 64, ("r_phase_ohm", "ld_h"), "manual", True, True,
    GATES, FIT, {"kt_vs_ke": {"allowance": 0.1}}, (FINDING,), ReadLimits(), (REVOKED,),
)  # fmt: skip
SPEC = ModelSpec("standard", ("cogging",))
SURVEY = Survey(ENTRIES, (FINDING,), ("notes.txt",))
SUPERSEDED = Superseded("v" * 64, "A. Smith", "unit")


@dataclass(frozen=True)
class Answers:
    """What is handed to the survey of every file."""

    tools: str = "1"
    sources: Mapping[str, SourceMap] = field(default_factory=lambda: {"hall": HALL})
    limits: ReadLimits = field(default_factory=ReadLimits)
    recover: bool = False

    def parts(self) -> keys.Parts:
        return _named(keys.AnswersParts, self)


@dataclass(frozen=True)
class Answer:
    """What is handed to the survey of one file."""

    survey: str = "s" * 64
    question: Question = QUESTION
    file: str = "a" * 64
    sidecar: str | None = "b" * 64

    def parts(self) -> keys.Parts:
        return _named(keys.AnswerParts, self)


@dataclass(frozen=True)
class Motor:
    """What is handed to the worker of one motor."""

    tools: str = "1"
    job: MotorJob = JOB

    def parts(self) -> keys.Parts:
        return keys.motor_parts(self.tools, self.job)


@dataclass(frozen=True)
class Batch:
    """What is handed to the pages and the outcome of a batch."""

    tools: str = "1"
    settings: RunSettings = field(default_factory=RunSettings)
    motors: tuple[str, ...] = ("k1", "k2")
    found: Survey = SURVEY
    commit: int | None = 4

    def parts(self) -> keys.Parts:
        return keys.batch_parts(self.tools, self.settings, self.motors, self.found, self.commit)


@dataclass(frozen=True)
class Version:
    """What is handed to the maker of a datasheet."""

    code: str = "0.1.0+ab"
    libraries: str = "numpy 2"
    campaign: Campaign = CAMPAIGN
    config: str = "d" * 64

    def parts(self) -> keys.Parts:
        return _named(keys.VersionParts, self)


@dataclass(frozen=True)
class Superseding:
    """What the version depends on that takes the place of a revoked one."""

    version: str = "v" * 64
    supersedes: Superseded = SUPERSEDED

    def parts(self) -> keys.Parts:
        return _named(keys.SupersedingParts, self)


@dataclass(frozen=True)
class Fit:
    """What is handed to an estimator."""

    code: str = "e" * 64
    libraries: str = "numpy 2"
    campaign: Campaign = CAMPAIGN
    options: Mapping[str, float] = field(default_factory=lambda: {"share": 0.1, "level": 1e-3})
    known: tuple[Estimate, ...] = (ESTIMATE,)
    revoked: tuple[Revocation, ...] = (REVOKED,)

    def parts(self) -> keys.Parts:
        return _named(keys.FitParts, self)


@dataclass(frozen=True)
class Model:
    """What is handed to the residual test."""

    code: str = "e" * 64
    libraries: str = "numpy 2"
    campaign: Campaign = CAMPAIGN
    model: ModelSpec = SPEC
    start: tuple[Estimate, ...] = (ESTIMATE,)
    revoked: tuple[Revocation, ...] = (REVOKED,)
    search: bool = True

    def parts(self) -> keys.Parts:
        return _named(keys.ModelParts, self)


def _named(kind: type[Any], handed: Any) -> keys.Parts:
    """The parts of a key, a campaign by the digests of its captures."""
    own = {f.name: getattr(handed, f.name) for f in fields(handed)}
    if "campaign" in own:
        own["campaign"] = _readings(own["campaign"])
    parts: keys.Parts = kind(**own)._asdict()
    return parts


def _readings(campaign: Campaign) -> Sequence[Any]:
    return keys.campaign_key(campaign, [content_digest(capture) for capture in campaign.captures])


KEPT: tuple[Callable[[], Any], ...] = (
    Answers,
    Answer,
    Motor,
    Batch,
    Version,
    Superseding,
    Fit,
    Model,
)
OF_NO_WORK = {
    Motor: tuple(f"job.{name}" for name in keys.NOT_OF_A_MOTOR),
    # the entries of a survey are in the keys of its motors
    Batch: ("found.entries", *(f"settings.{name}" for name in keys.NOT_OF_A_BATCH)),
}


def unseen(handed: Any, *, without: str | None = None) -> list[str]:
    """Changes that the key does not see, with one part of it left out."""

    def key(one: Any) -> str:
        return keys.key_of({n: part for n, part in one.parts().items() if n != without})

    base, free = key(handed), OF_NO_WORK.get(type(handed), ())
    return [
        where
        for where, other in changes(handed)
        if key(other) == base
        and not any(where == name or where.startswith(f"{name}.") for name in free)
    ]


@pytest.mark.parametrize("kept", KEPT)
def test_whatever_the_work_gets_is_in_its_key(kept: Callable[[], Any]) -> None:
    assert unseen(kept()) == []


def test_every_key_is_among_these() -> None:
    made = {name for name in vars(keys) if name.lower().endswith("parts")} - {"Parts"}
    assert {name.lower().replace("_", "") for name in made} == {
        f"{kept.__name__.lower()}parts"  # type: ignore[attr-defined]
        for kept in KEPT
    }


PARTS = [(kept, name) for kept in KEPT for name in kept().parts()]


@pytest.mark.parametrize(("kept", "part"), PARTS, ids=[f"{k.__name__}-{n}" for k, n in PARTS])
def test_a_key_without_one_of_its_parts_misses_a_change(kept: Callable[[], Any], part: str) -> None:
    assert unseen(kept(), without=part) != []


@pytest.mark.parametrize("kept", KEPT)
def test_equal_work_has_an_equal_key(kept: Callable[[], Any]) -> None:
    """Records made anew, and maps in another order."""
    one, other = kept(), kept()
    assert keys.key_of(one.parts()) == keys.key_of(other.parts())
    turned = dict(reversed(one.parts().items()))
    assert keys.key_of(turned) == keys.key_of(one.parts())


def test_numbers_that_are_equal_in_python_alone_are_told_apart() -> None:
    values: list[Any] = [1, 1.0, True, "1", None, 0.0, -0.0, float("nan"), float("inf"), ["1"]]
    assert len({content_digest(value) for value in values}) == len(values)
    assert content_digest(np.float64(0.1)) == content_digest(0.1)
    missing = (pl.DataFrame({"a": [1.0, other]}) for other in (None, float("nan"), 0.0))
    assert len({content_digest(table) for table in missing}) == 3
    with pytest.raises(TypeError, match="object has no digest"):
        content_digest(object())
