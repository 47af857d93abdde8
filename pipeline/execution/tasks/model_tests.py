"""The residual test of one motor in a worker: a model is compared with its captures, once."""

from __future__ import annotations

import gc
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, NamedTuple, Protocol

from pipeline.estimation.registry import BROKEN
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.finding import Finding
from pipeline.records.model_verdict import ModelVerdict

if TYPE_CHECKING:
    from pipeline.records.diagnosis import Diagnosis

SWITCHED_OFF = ModelVerdict("not_tested", note="residual_test=false")


class Tested(NamedTuple):
    """The verdict on a model, the errors of the test, and the diagnosis where one was asked for."""

    verdict: ModelVerdict
    findings: tuple[Finding, ...] = ()
    diagnosis: Diagnosis | None = None


class Verdicts(Protocol):
    """A cache of verdicts, by a key of everything that they depend on."""

    def one_at_a_time(self) -> AbstractContextManager[None]:
        """Waits for the process that makes this motor's verdict, if there is one."""

    def key(self, model: ModelSpec, start: Constants) -> str:
        """The key of a model that is compared with the captures from these constants.

        Parameters
        ----------
        model
            The model and its effects.
        start
            Constants that the fit starts from.

        """

    def recall(self, key: str) -> ModelVerdict | None:
        """The verdict of a key, or None.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.

        """

    def keep(self, key: str, verdict: ModelVerdict) -> None:
        """Stores a verdict.

        Parameters
        ----------
        key
            The key, a digest of all that the result depends on.
        verdict
            The verdict.

        """


def judged_model(
    campaign: Campaign,
    model: ModelSpec | None,
    constants: Constants,
    memory: Verdicts | None = None,
    diagnose: str = "auto",
) -> Tested:
    """The verdict on a model of one motor, `not_tested` for None.

    `diagnose` is the key of a run: `true` gives the diagnosis as well, which no memory holds;
    `false` searches for no effects where that some are missing is sure without. A test that fails
    on some captures does not stop the datasheet.

    Parameters
    ----------
    campaign
        The captures of one motor.
    model
        The model and its effects; None for no test.
    constants
        The fitted constants.
    memory
        Cache of verdicts; None for no cache.
    diagnose
        The key `diagnose` of `run`: `auto`, `true` or `false`.

    Raises
    ------
    UsageError
        An unknown model or effect.

    """
    if model is None:
        return Tested(SWITCHED_OFF)
    from pipeline.criticism.adequacy import model_verdict
    from pipeline.execution.tasks.start import start_constants

    try:
        start = start_constants(campaign, constants)
        if memory is None:
            verdict, document = model_verdict(campaign, model, start, search=diagnose != "false")
            return Tested(verdict, (), document if diagnose == "true" else None)
        key = memory.key(model, start)
        with memory.one_at_a_time():
            if diagnose != "true" and (known := memory.recall(key)) is not None:
                return Tested(known)
            verdict, document = model_verdict(campaign, model, start, search=diagnose != "false")
            memory.keep(key, verdict)
    except (*BROKEN, MemoryError) as error:
        message = f"the residual test broke on these captures: {type(error).__name__}: {error}"
        remedy = "the constants stand; report the captures with this line"
        broken = Finding(campaign.motor_id, "warning", "residual_test_failed", message, remedy)
        return Tested(
            ModelVerdict("not_tested", model.name, model.effects, note=message), (broken,)
        )
    finally:
        # a segment and what is kept of it refer to each other, and the collector counts objects,
        # not the size of their arrays: a worker would grow with every motor of a fleet
        gc.collect()
    return Tested(verdict, (), document if diagnose == "true" else None)
