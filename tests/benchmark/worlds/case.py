"""One case of a world: what is hidden in which motor, and what an answer is worth."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pipeline.io.storage.publish import canonical_json
from pipeline.io.storage.syntax import syntax_of

HERE = Path(__file__).parent
Mark = Literal["right", "abstained right", "half", "silent", "unsure", "wrong", "failed"]
MARKS: tuple[Mark, ...] = (
    "right",
    "abstained right",
    "half",
    "silent",
    "unsure",
    "wrong",
    "failed",
)


@cache
def recorder_digest(world: str) -> str:
    """8 hex digits of a digest of what makes a world's captures."""
    names = ("damage.py", "lanes.py", "programmes.py", "recording.py", f"with_{world}.py")
    parts = [syntax_of((HERE / name).read_bytes(), "tests.benchmark.worlds") for name in names]
    return hashlib.sha256("".join(part.digest for part in parts).encode()).hexdigest()[:8]


@dataclass(frozen=True, slots=True)
class WorldCase:
    """What is hidden in a motor of a world, in typical sizes, and how it is recorded."""

    world: str
    programme: str
    seed: int
    effects: Mapping[str, float] = field(default_factory=dict)
    outside: bool = False
    model: str = "standard"

    def document(self) -> dict[str, Any]:
        """The case as plain data."""
        return asdict(self)

    @property
    def key(self) -> str:
        """Name of the case: 16 hex digits of a digest of its content."""
        return hashlib.sha256(canonical_json(self.document())).hexdigest()[:16]

    @property
    def station_key(self) -> str:
        """8 hex digits of a digest of the code that records the case."""
        return recorder_digest(self.world)

    @property
    def family(self) -> str:
        """World and programme."""
        return f"{self.world} {self.programme}"

    @property
    def number(self) -> int:
        """The motor's seed."""
        return self.seed

    @property
    def line(self) -> str:
        """The line of the table that the case belongs to."""
        if not self.effects:
            return "nothing"
        if self.outside:
            return "outside"
        if len(self.effects) > 1:
            return "pair"
        return "typical" if max(self.effects.values()) == 1.0 else "third"


def judged(case: WorldCase, document: Mapping[str, Any]) -> tuple[int, int]:
    """How many of the hidden effects are named with confidence, and how many names are false."""
    names = set(document["missing"]) if document.get("verdict") == "missing" else set()
    ranked = {r["effect"]: set(r["confused_with"]) for r in document.get("ranking", ())}
    hidden = set() if case.outside else set(case.effects)
    stands = {h: {n for n in names if n == h or h in ranked.get(n, ())} for h in hidden}
    false = names - set().union(*stands.values())
    return sum(bool(found) for found in stands.values()), len(false)


def marked(case: WorldCase, document: Mapping[str, Any]) -> Mark:
    """What a diagnosis is worth.

    right: exactly what is hidden is named with confidence, by its name or by one that is reported
    as not to be parted from it. half: part of it, or all of it beside a name that is false. wrong:
    a false name with confidence, and none that is true. unsure: a remainder is reported in place
    of a name. silent: nothing is. abstained right: nobody's library has it, and a remainder is
    reported without a false name.
    """
    if "failure" in document:
        return "failed"
    hits, false = judged(case, document)
    left = any(one["matters"] for one in document.get("remainder", ()))
    return _mark(case, hits, bool(false), document["verdict"] == "unknown" or left)


def _mark(case: WorldCase, hits: int, false: bool, left: bool) -> Mark:
    """The mark of so many true names, a false one, and a remainder."""
    wanted = 0 if case.outside else len(case.effects)
    if hits:
        return "right" if hits == wanted and not false else "half"
    if false:
        return "wrong"
    if case.outside:
        return "abstained right" if left else "silent"
    if not wanted:
        return "unsure" if left else "right"
    return "unsure" if left else "silent"
