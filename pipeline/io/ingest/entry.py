"""A file that is a capture, with all that is stated of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Literal

from pipeline.io.maps.source_map import Part, SourceMap

Form = Literal["mcap", "csv", "foreign"]


@dataclass(frozen=True, slots=True)
class Entry:
    """A file that is a capture: where it is, what it is, and all that is stated of it.

    Attributes
    ----------
    path
        Relative to the input folder, with forward slashes.
    sha256
        Digest of its bytes.
    form
        MCAP, text, or a foreign form.
    source
        The source map that it is read by; None for the contract's own form.
    metadata
        Merged metadata as pairs of texts.
    recovered
        Whether it is cut off, and its good part is used.
    part
        The rows of it that are this capture.

    """

    path: str
    sha256: str
    form: Form
    source: SourceMap | None
    metadata: tuple[tuple[str, str], ...]
    recovered: bool = False
    part: Part | None = None

    @property
    def capture_path(self) -> str:
        """The path of the capture: the file's, its stem with the rows where it is a part of it."""
        if self.part is None:
            return self.path
        path = PurePosixPath(self.path)
        return path.with_name(f"{path.stem} {self.part.name}{path.suffix}").as_posix()

    @property
    def stated(self) -> dict[str, str]:
        """The merged metadata as texts."""
        return dict(self.metadata)
