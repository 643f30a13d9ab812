"""All parameters of a run: the chosen methods, the shared groups, and a group for each method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

from pydantic import create_model
from pydantic.fields import FieldInfo

from tracker.parameters.definition import Params
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.fusion import FusionParams
from tracker.parameters.groups.pictures import PictureParams
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.parameters.methods import Method, MethodKey
from tracker.parameters.registry import REGISTERED

_Group = TypeVar("_Group", bound=Params)


class SharedParameters(Params):
    """Everything that a run depends on, besides the sequence and the seed."""

    single_view: str = "colour_phd"
    """Method of stage 1: boxes from each camera's pictures, or a detector's, filtered or not."""

    fusion_method: str = "multi_bernoulli"
    """Method of stage 2: how the cameras' boxes become 3D positions."""

    smoothing_method: str = "identities"
    """Method of stage 3: the filter's tracks as they are, smoothed, or with identities resolved."""

    pictures: PictureParams = PictureParams()
    foreground: ForegroundParams = ForegroundParams()
    fusion: FusionParams = FusionParams()
    smoothing: SmoothingParams = SmoothingParams()

    def of(self, kind: type[_Group]) -> _Group:
        """Return the parameters of one group, by their class.

        Raises:
            KeyError: If no registered method has this class for its parameters.
        """
        for name, field in type(self).model_fields.items():
            if field.annotation is kind:
                return cast(_Group, getattr(self, name))
        raise KeyError(f"no registered method has {kind.__name__} for its parameters")

    def method(self, key: MethodKey) -> Method:
        """Return the description of the chosen method."""
        return REGISTERED[key][getattr(self, key)]


def _with_methods() -> type[SharedParameters]:
    """Make the class with a group for every method that has one, and the methods' names as
    choices."""
    fields: dict[str, Any] = {}
    for key, methods in REGISTERED.items():
        shared: FieldInfo = SharedParameters.model_fields[key]
        fields[key] = (Literal[tuple(methods)], shared)
        for method in methods.values():
            if method.parameters is not None:
                fields[method.own_group] = (method.parameters, method.parameters())
    return create_model(
        "RunParameters",
        __base__=SharedParameters,
        __module__=__name__,
        __doc__=SharedParameters.__doc__,
        **fields,
    )


if TYPE_CHECKING:

    class RunParameters(SharedParameters):
        """Everything that a run depends on, besides the sequence and the seed."""

else:
    RunParameters = _with_methods()
