"""The code and the libraries that the results of a run depend on, by their imports."""

from __future__ import annotations

from pipeline.io.storage.code_version import closure_digest, code_version, libraries_version

WORK = "pipeline.execution.tasks.work"
"""The module that makes datasheets."""
RUN = "pipeline.stages.run"
"""The module that makes everything that a run writes."""
SURVEY = "pipeline.execution.tasks.survey_tasks"
"""The module that finds captures in a folder."""


def datasheet_code() -> str:
    """The version of the code that makes datasheets."""
    return code_version(WORK)


def datasheet_libraries() -> str:
    """The libraries that datasheets depend on."""
    return libraries_version(WORK)


def tools(module: str) -> str:
    """Version of a module's code with everything that it imports, and of its libraries.

    Parameters
    ----------
    module
        Dotted name of the module.

    """
    return f"{closure_digest(module)}; {libraries_version(module)}"
