"""What validation says of a capture with a fault in it."""

from __future__ import annotations

import pytest

from pipeline.contracts.validate import validate
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding


def refused(capture: Capture) -> CaptureError:
    """The refusal of a capture; fails if it is let through."""
    with pytest.raises(CaptureError) as caught:
        validate(capture, {})
    assert caught.value.message, "a refusal says what is wrong"
    assert caught.value.remedy, "a refusal says what to do"
    return caught.value


def warned(capture: Capture) -> tuple[Capture, Finding]:
    """The capture that came through, and its only finding."""
    passed, findings = validate(capture, {})
    assert len(findings) == 1, [finding.line() for finding in findings]
    assert findings[0].severity == "warning"
    assert findings[0].file == capture.path
    return passed, findings[0]
