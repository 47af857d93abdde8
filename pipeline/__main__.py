"""The entry point: `python -m pipeline COMMAND key=value ...`."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TextIO

from pipeline.cli.colour import coloured, wanted
from pipeline.cli.commands import COMMANDS, Command, overview, program, usage
from pipeline.cli.flags import Flags, asks_for_json, split_flags
from pipeline.records.errors import PipelineError, UsageError, meant
from pipeline.records.naming import printable
from pipeline.records.outcome import INTERRUPTED, Fault, Outcome, fault_of, first_that_applies

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: list[str] | None = None) -> int:
    """Runs one command and returns its exit code (`contract/outputs.md`)."""
    for name in THREADS:
        # A sum split over threads depends on their number; results must not.
        os.environ.setdefault(name, "1")
    given = sys.argv[1:] if arguments is None else arguments
    return _show(_guarded(given))


def _guarded(arguments: Sequence[str]) -> Outcome:
    """The outcome of a command; an expected failure becomes one line and its exit code, and with
    `json=true` an object as well.
    """
    try:
        return _perform(arguments)
    except PipelineError as error:
        failed = Outcome(error.exit_code, errors=(f"error: {error}",), faults=(fault_of(error),))
    except OSError as error:
        what = error.filename or "the system"
        failed = Outcome(5, errors=(f"error: {what}: {error.strerror}",))
        fault = Fault("error", str(error.strerror), file=error.filename, code="system")
        failed = replace(failed, faults=(fault,))
    except KeyboardInterrupt:
        again = "rerun the same command to go on"
        failed = Outcome(INTERRUPTED, errors=(f"error: interrupted; {again}",))
        failed = replace(failed, faults=(Fault("error", "interrupted", again, code="interrupted"),))
    command = next((word for word in arguments if not word.startswith("-")), "")
    return _as_json(command, failed) if asks_for_json(arguments) else failed


def _perform(arguments: Sequence[str]) -> Outcome:
    flags, words = split_flags(arguments)
    if flags.version:
        from pipeline import __version__

        return Outcome(text=f"motor-datasheets {__version__}")
    if flags.shell_completion:
        from pipeline.cli.completion import completed

        return Outcome(text=completed(flags.shell_completion))
    if not words or words[0] == "help":
        return Outcome(0 if words or flags.help else 2, overview())
    command = _command(words[0])
    if flags.help:
        return Outcome(text=usage(command))
    if flags.multirun:
        from pipeline.cli.multirun import sweep

        return sweep(command, words[1:], lambda each: _run(command, flags, each))
    return _run(command, flags, words[1:])


def _command(word: str) -> Command:
    if word in COMMANDS:
        return COMMANDS[word]
    raise UsageError(f"no command {word!r}", meant(word, COMMANDS))


def _run(command: Command, flags: Flags, words: Sequence[str]) -> Outcome:
    """One run of a command: its settings made, and its stage performed."""
    from pipeline.cli.configuration import load_settings, origin_text, settings_text, with_source
    from pipeline.report.text.waiting import waiting

    settings = load_settings(command, words, flags.config_dir)
    if flags.cfg is not None:
        return Outcome(text=settings_text(settings))
    if flags.info:
        return Outcome(text=origin_text(command, settings))
    with waiting("" if command.shows_progress else command.name):
        stage = importlib.import_module(f"pipeline.stages.{command.stage or command.name}")
        outcome: Outcome = stage.main(settings)
    if not settings.timings:
        outcome = replace(outcome, timings=())
    if outcome.next:
        outcome = replace(outcome, next=with_source(outcome.next, settings))
    return _as_json(command.name, outcome) if settings.json else outcome


def _as_json(command: str, outcome: Outcome) -> Outcome:
    """The outcome with one JSON object for its text; errors stay on standard error as well."""
    import json

    from pipeline.cli.plain import finite

    document = {
        "schema": "outcome/1",
        "command": command,
        "exit_code": outcome.exit_code,
        "result": outcome.result,
        "text": outcome.text.splitlines(),
        "messages": list(outcome.errors),
        "errors": list(outcome.faults),
        "wrote": outcome.wrote or None,
        "next": outcome.next or None,
        "seconds": dict(outcome.timings),
    }
    text = json.dumps(finite(document), indent=2, ensure_ascii=False, allow_nan=False)
    return replace(outcome, text=text, wrote="", next="", timings=())


def _show(outcome: Outcome) -> int:
    """Prints an outcome and what its command goes on with; the exit code of all of it."""
    _print_outcome(outcome)
    code = outcome.exit_code
    while outcome.then is not None:
        outcome = _continued(outcome.then)
        _print_outcome(outcome)
        code = first_that_applies(code, outcome.exit_code)
    return code


def _print_outcome(outcome: Outcome) -> None:
    for line in outcome.errors:
        _print(line, sys.stderr)
    if outcome.text:
        _print(outcome.text, sys.stdout)
    stream = sys.stderr if outcome.is_content else sys.stdout
    if outcome.wrote:
        _print(f"wrote {outcome.wrote}", stream)
    if outcome.next:
        _print(f"next: {program()} {printable(outcome.next)}", stream)
    if outcome.timings:
        rows = [f"  {name:<12} {seconds:8.3f} s" for name, seconds in outcome.timings]
        _print("\n".join(["timings", *rows]), sys.stdout)


def _continued(then: Callable[[], Outcome]) -> Outcome:
    """What a command that stays comes to; an interrupt is how a user ends it, no failure."""
    try:
        return then()
    except PipelineError as error:
        return Outcome(error.exit_code, errors=(f"error: {error}",))
    except KeyboardInterrupt:
        return Outcome()


def _print(text: str, stream: TextIO) -> None:
    """Prints a text; a reader that has seen enough (`| head`) is no failure."""
    try:
        shown = coloured(text) if wanted(stream) else text
        print(shown.rstrip("\n"), file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
