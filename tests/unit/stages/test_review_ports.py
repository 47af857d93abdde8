"""`review web=true` on a port that another program has: one line with the remedy."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.io.recordings.viewer import free_port, require_free
from pipeline.records.errors import MachineError
from pipeline.stages import review


@pytest.mark.parametrize("later", [0, 1], ids=["page", "table"])
def test_review_on_a_taken_port_ended_in_a_traceback(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    later: int,
) -> None:
    """The page is served on the port, the fleet's table on the next; nothing has been started."""
    motors = (tmp_path / "motor-x.rrd",)
    monkeypatch.setattr(review, "_chosen", lambda *_: review.Opened(motors, ()))
    monkeypatch.setattr(review, "_refused", lambda *_: ())
    monkeypatch.setattr(review, "silence", lambda: None)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1] - later
        assert main(["review", f"output={tmp_path}", "web=true", f"port={port}"]) == 5
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: port {port + later} cannot be served: ")
    assert line.endswith("name another with port=, or leave it out")


def test_a_free_port_is_served() -> None:
    require_free(free_port())
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(MachineError, match="cannot be served"):
            require_free(other.getsockname()[1])
