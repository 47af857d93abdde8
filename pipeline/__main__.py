"""The entry point: `python -m pipeline COMMAND key=value ...`."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TextIO

from pipeline.commands import COMMANDS, Command, overview, usage
from pipeline.configuration import load_settings
from pipeline.records.errors import PipelineError
from pipeline.records.outcome import Outcome, first_that_applies

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: list[str] | None = None) -> int:
    """Runs one command and returns its exit code (`contract/outputs.md`)."""
    for name in THREADS:
        # A sum split over threads depends on their number; results must not.
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help", "help"):
        return _show(Outcome(0 if words else 2, overview()))
    command = COMMANDS.get(words[0])
    if command is None:
        known = ", ".join(COMMANDS)
        return _show(Outcome(2, errors=(f"error: no command {words[0]!r}; known are {known}",)))
    if "--help" in words[1:] or "-h" in words[1:]:
        return _show(Outcome(0, usage(command)))
    return _show(_guarded(command, words[1:]))


def _guarded(command: Command, words: list[str]) -> Outcome:
    """The command's outcome, its expected failures turned into one line and their exit code."""
    try:
        return _perform(command, words)
    except PipelineError as error:
        return Outcome(error.exit_code, errors=(f"error: {error}",))
    except OSError as error:
        what = error.filename or "the system"
        return Outcome(5, errors=(f"error: {what}: {error.strerror}",))
    except KeyboardInterrupt:
        return Outcome(5, errors=("error: interrupted; rerun the same command to go on",))


def _perform(command: Command, words: list[str]) -> Outcome:
    settings = load_settings(command, words)
    stage = importlib.import_module(f"pipeline.stages.{command.stage}")
    outcome: Outcome = stage.main(settings)
    return outcome if settings.timings else replace(outcome, timings=())


def _show(outcome: Outcome) -> int:
    for line in outcome.errors:
        _print(line, sys.stderr)
    if outcome.text:
        _print(outcome.text, sys.stdout)
    if outcome.timings:
        rows = [f"  {name:<12} {seconds:8.3f} s" for name, seconds in outcome.timings]
        _print("\n".join(["timings", *rows]), sys.stdout)
    if outcome.then is None:
        return outcome.exit_code
    return _show(_continued(outcome.exit_code, outcome.then))


def _continued(code: int, then: Callable[[], tuple[int, tuple[str, ...]]]) -> Outcome:
    """What a command that stays comes to; an interrupt is how a user ends it, no failure."""
    try:
        further, lines = then()
    except PipelineError as error:
        further, lines = error.exit_code, (f"error: {error}",)
    except KeyboardInterrupt:
        further, lines = 0, ()
    return Outcome(first_that_applies(code, further), errors=lines)


def _print(text: str, stream: TextIO) -> None:
    """Prints a text; a reader that has seen enough (`| head`) is no failure."""
    try:
        print(text.rstrip("\n"), file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
