"""What of a written diagnosis reaches a comparison of lots."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.io.storage.diagnoses import read_diagnoses
from pipeline.io.storage.publish import canonical_json
from pipeline.records.errors import UsageError
from tests.unit.ladders import make_diagnosis


def test_what_diagnose_wrote_is_read(tmp_path: Path) -> None:
    written = make_diagnosis()
    (tmp_path / "m.json").write_bytes(canonical_json(written.document()))
    found = read_diagnoses([tmp_path / "absent", tmp_path])
    assert set(found) == {written.motor_id}
    told = found[written.motor_id]
    assert (told.verdict, told.missing) == (written.verdict, written.missing)
    for ranked in written.ranking:
        values = {name: (value, unit) for name, (value, _, unit) in ranked.parameters.items()}
        assert dict(told.parameters[ranked.effect]) == values


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": "findings/1", "verdict": "adequate"}']
)
def test_another_file_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "odd.json").write_text(text)
    with pytest.raises(UsageError, match=r"odd.json is no diagnosis"):
        read_diagnoses([tmp_path])
