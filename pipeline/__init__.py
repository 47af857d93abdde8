"""Recordings of motor test benches in, trusted motor datasheets out.

    import pipeline

    recordings = pipeline.read("captures/")          # validated captures by motor
    fits = pipeline.fit(recordings)                  # constants with uncertainty
    sheets = pipeline.check(fits)                    # cross-checks, datasheets
    pipeline.operate(sheets["M1"], vdc_v=48.0, current_a=20.0)  # torque curve, ratings
    pipeline.compare(recordings, effects=["cogging"])  # where a model is off
    pipeline.diagnose(recordings)                    # which physical effect it lacks
    pipeline.simulate("gimbal-5208", ["stribeck"])   # recordings of a simulated motor
    pipeline.load("reports/demo")                    # the datasheets of a run

Results are frozen records with polars frames (`.constants`, `.residuals`, `.ladder`, ...). Nothing
is written to the disk. Whatever is not listed in `__all__` may change without notice.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"
_HOMES = {
    "Comparisons": "models",
    "Datasheets": "datasheets",
    "Diagnoses": "models",
    "Figure": "figure",
    "Fits": "fits",
    "Recordings": "recordings",
    "check": "datasheets",
    "compare": "models",
    "diagnose": "models",
    "fit": "fits",
    "load": "datasheets",
    "operate": "performance",
    "read": "recordings",
    "simulate": "simulated",
}
__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """A public name, imported at its first use, so that commands start without its libraries."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.api.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
