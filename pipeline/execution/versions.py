"""Which code, and which libraries, the results of a run hang on: by what each of them imports."""

from __future__ import annotations

from pipeline.io.storage.code_version import closure_digest, code_version, libraries_version

WORK = "pipeline.execution.work"
"""What makes datasheets."""
RUN = "pipeline.stages.run"
"""What makes everything that a run writes."""
LOOK = "pipeline.execution.looking"
"""What finds captures in a folder."""


def datasheet_code() -> str:
    """The version of the code that makes datasheets."""
    return code_version(WORK)


def datasheet_libraries() -> str:
    """The libraries that datasheets hang on."""
    return libraries_version(WORK)


def tools(module: str) -> str:
    """A module's code with all that it imports and runs on."""
    return f"{closure_digest(module)}; {libraries_version(module)}"
