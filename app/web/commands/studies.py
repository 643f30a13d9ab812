"""Commands that take over what a study found: on the sliders, or as a preset."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from app.errors import ApiError
from app.web.commands.command import Owners
from app.web.commands.parameters import ToState
from app.web.dependencies import nothing_open
from app.web.studies.dependencies import no_trial, store_of
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import changed_values, value_of, with_values
from tracker.studies.errors import StudyError


class _OfStudy(ToState):
    study: str
    """The study's name."""
    trial: int | None = None
    """The trial's number, 0 for what the study began with; null for what the study proposes."""

    def parameters(self, owners: Owners) -> RunParameters:
        """The values of the trial, what its study holds, and the defaults."""
        values = self._values(owners)
        snapshot = owners.workbench.snapshot()
        if snapshot.sequence is None:
            raise nothing_open()
        return with_values(snapshot.defaults, values)

    def _values(self, owners: Owners) -> dict[str, Any]:
        store = store_of(owners.studies, self.study)
        if self.trial is not None:
            try:
                found, definition = store.trial(self.trial), store.definition()
            except StudyError as error:
                raise no_trial(error, "trial") from None
            return {**definition.held(), **(found.values if self.trial else {})}
        proposed, definition = store.fact("tuned"), store.definition()
        if proposed is None or not proposed["better"]:
            raise ApiError(409, "nothing_better", f"The study {store.name} proposes nothing.")
        return {**definition.held(), **proposed["values"]}


class UseTrial(_OfStudy):
    """Set all parameters to those of a study's trial, or to what the study proposes."""

    name: Literal["use_trial"]

    def change(self, owners: Owners) -> None:
        parameters = self.parameters(owners)
        values = {key: value_of(parameters, key) for key in (*METHODS, *PARAMETERS)}
        owners.workbench.set_parameters(values, "api")


class KeepTrial(_OfStudy):
    """Save the values of a study's trial, or what the study proposes, as a preset."""

    name: Literal["keep_trial"]
    preset: str = Field(max_length=4096)

    def change(self, owners: Owners) -> None:
        defaults = owners.workbench.snapshot().defaults
        owners.presets.keep(self.preset, changed_values(self.parameters(owners), defaults))


StudiesCommand = UseTrial | KeepTrial
