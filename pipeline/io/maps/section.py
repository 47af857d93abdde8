"""A YAML map read key by key: every key has a kind, and an unknown key is an error."""

from __future__ import annotations

import difflib
import re
from typing import Any

from pipeline.records import parse
from pipeline.records.errors import UsageError

_MAX_PATTERN = 500


class Section:
    """One map of the YAML, read key by key; an unknown key is an error."""

    def __init__(self, source: str, where: str, plain: Any) -> None:
        self.source = source
        self.where = where
        if plain is None or plain == "":
            plain = {}
        if not isinstance(plain, dict):
            raise self.fault("", "is no map of keys", "write `key: value` lines")
        self.remaining: dict[str, Any] = dict(plain)
        self.known_keys: list[str] = []

    def fault(self, key: str, what: str, remedy: str) -> UsageError:
        """An error that names the map and the key.

        Parameters
        ----------
        key
            The key.
        what
            What is wrong with it.
        remedy
            What to write.

        """
        place = ".".join(part for part in (self.where, key) if part) or "the top"
        return UsageError(f"source map {self.source}: {place}: {what}", remedy)

    def take(self, key: str) -> Any:
        """The plain value of a key, None where it is not there.

        Parameters
        ----------
        key
            The key.

        """
        self.known_keys.append(key)
        return self.remaining.pop(key, None)

    def close(self) -> None:
        """Raises UsageError for an unknown key."""
        for key in self.remaining:
            similar = difflib.get_close_matches(key, self.known_keys, 1)
            hint = (
                f"did you mean {similar[0]!r}?"
                if similar
                else f"known keys: {', '.join(self.known_keys)}"
            )
            raise self.fault(key, "is no key of a source map", hint)

    def section(self, key: str) -> Section:
        """The map under a key, empty where it is not there.

        Parameters
        ----------
        key
            The key.

        """
        inner = self.take(key)
        return Section(self.source, f"{self.where}.{key}".strip("."), inner)

    def text(self, key: str) -> str | None:
        """The text under a key, None where it is not there.

        Parameters
        ----------
        key
            The key.

        Raises
        ------
        UsageError
            It is no single text.

        """
        value = self.take(key)
        if value is not None and not isinstance(value, str):
            raise self.fault(key, "is not a single text", "write one value")
        return value

    def sections(self, key: str) -> list[Section]:
        """The items of a list of maps.

        Parameters
        ----------
        key
            The key.

        Raises
        ------
        UsageError
            It is no list.

        """
        listed = self.take(key)
        listed = listed or []
        if not isinstance(listed, list):
            raise self.fault(key, "is no list", "write `- key: value` items")
        where = f"{self.where}.{key}".strip(".")
        return [Section(self.source, f"{where}[{n}]", part) for n, part in enumerate(listed)]

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts, or one text.

        Parameters
        ----------
        key
            The key.

        Raises
        ------
        UsageError
            It is neither.

        """
        value = self.take(key)
        value = [value] if isinstance(value, str) else value or []
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self.fault(key, "is no list of texts", "write `[a, b]`")
        return tuple(value)

    def pattern(self, key: str) -> str | None:
        """A regular expression.

        Parameters
        ----------
        key
            The key.

        """
        value = self.text(key)
        return None if value is None else self._expression(key, value)

    def patterns(self, key: str) -> tuple[str, ...]:
        """A list of regular expressions.

        Parameters
        ----------
        key
            The key.

        """
        return tuple(self._expression(key, value) for value in self.texts(key))

    def _expression(self, key: str, value: str) -> str:
        try:
            if len(value) > _MAX_PATTERN:
                raise re.error("it is too long")
            re.compile(value)
        except (re.error, RecursionError, OverflowError) as fault:
            raise self.fault(key, f"is no regular expression: {fault}", "correct it") from None
        return value

    def number(self, key: str, default: float | None) -> float | None:
        """A finite number.

        Parameters
        ----------
        key
            The key.
        default
            Where the key is not there.

        Raises
        ------
        UsageError
            It is no number.

        """
        value = self.text(key)
        if value is None:
            return default
        parsed = parse.number(value)
        if parsed is None:
            raise self.fault(key, f"{value[:60]!r} is no number", "write a number")
        return parsed

    def flag(self, key: str, default: bool) -> bool:
        """The word true or false.

        Parameters
        ----------
        key
            The key.
        default
            Where the key is not there.

        Raises
        ------
        UsageError
            It is neither word.

        """
        value = self.text(key)
        if value is None:
            return default
        if value not in ("true", "false"):
            raise self.fault(key, f"{value!r} is neither true nor false", "write true or false")
        return value == "true"

    def choice(self, key: str, known: tuple[str, ...], default: str) -> Any:
        """One of some known words.

        Parameters
        ----------
        key
            The key.
        known
            The words.
        default
            Where the key is not there.

        Raises
        ------
        UsageError
            It is none of them.

        """
        value = self.text(key)
        if value is not None and value not in known:
            raise self.fault(key, f"{value!r} is unknown", f"use one of {', '.join(known)}")
        return default if value is None else value
