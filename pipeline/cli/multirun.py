"""One run for each combination of values, as Hydra's `--multirun` makes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

from pipeline.cli.commands import Command
from pipeline.cli.flags import asks_for_json
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Outcome, first_that_applies

MOST_RUNS = 1000


def sweep(command: Command, words: Sequence[str], run: Callable[[list[str]], Outcome]) -> Outcome:
    """Performs a command once for each combination of the values of its keys.

    `key=a,b` has two values; commas inside brackets, braces and quotes part none. Each run writes
    to a folder of its own under `output`: `multirun/model=a/`. The exit code is the one that the
    contract puts first among those of the runs. With `json=true` the text is one list of theirs.

    Parameters
    ----------
    command
        The command.
    words
        The words of the command line after the command.
    run
        Performs the command with the words of one combination.

    Raises
    ------
    UsageError
        Where no key has several values, or there are more than `MOST_RUNS` combinations.

    """
    choices = [_values(word) for word in words]
    swept = [number for number, values in enumerate(choices) if len(values) > 1]
    if not swept:
        raise UsageError("--multirun: no key has several values", "write model=ideal,standard")
    runs = list(product(*choices))
    if len(runs) > MOST_RUNS:
        raise UsageError(f"--multirun: {len(runs)} runs", f"at most {MOST_RUNS}; sweep fewer keys")
    as_json = asks_for_json(words)
    texts, errors, codes, of_runs = [], [], [], []
    for combination in runs:
        name = ",".join(combination[number] for number in swept)
        outcome = run(_run_words(command, combination, name))
        texts.append(outcome.text if as_json else f"[{name}]\n{outcome.text}".rstrip())
        errors += [f"[{name}] {line}" for line in outcome.errors]
        of_runs.append({"words": name, "exit_code": outcome.exit_code, "result": outcome.result})
        codes.append(outcome.exit_code)
    text = f"[{','.join(texts)}]" if as_json else "\n".join(texts)
    return Outcome(first_that_applies(*codes), text, tuple(errors), result=of_runs)


def _run_words(command: Command, words: Sequence[str], name: str) -> list[str]:
    """The words of one run, its `output` in a folder of its own where the command has one."""
    fields = command.settings.__dataclass_fields__
    if "output" not in fields or fields["output"].metadata.get("result", True):
        return list(words)
    outputs = [word.partition("=")[2] for word in words if word.startswith("output=")]
    output = outputs[-1] if outputs else fields["output"].default
    rest = [word for word in words if not word.startswith("output=")]
    return [*rest, f"output={output}/multirun/{name.replace('/', '_')}"]


def _values(word: str) -> list[str]:
    """The words of which `key=a,b` is short; commas in brackets, braces and quotes part none."""
    key, equals, text = word.partition("=")
    if not equals:
        return [word]
    values, depth, quote = [""], 0, ""
    for char in text:
        if quote:
            quote = "" if char == quote else quote
        elif char in "'\"":
            quote = char
        elif char in "[{(":
            depth += 1
        elif char in "]})":
            depth -= 1
        elif char == "," and depth == 0:
            values.append("")
            continue
        values[-1] += char
    return [f"{key}={value}" for value in values]
