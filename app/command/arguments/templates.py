"""The arguments of ``templates`` as types."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, OmitSubcommandPrefixes, Positional, arg, subcommand

_SEQUENCE = arg(metavar="SEQUENCE", help="A built-in room's name or a folder.")


@dataclass
class ListTemplates:
    """List the templates of a sequence by number."""

    sequence: Annotated[Positional[str], _SEQUENCE]
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class OfferTemplates:
    """Track a sequence and list the templates that its tracks offer; with --add, take some.

    Boxes of people whom several cameras agree about, in cameras or looks without a template.
    What is added is written into sequence.toml, and what was there is kept beside it.
    """

    sequence: Annotated[Positional[str], _SEQUENCE]
    add: Annotated[
        tuple[int, ...], arg(metavar="NUMBER …", help_behavior_hint="(default: none)")
    ] = ()
    """Numbers of the list: these become templates."""
    add_all: FlagCreatePairsOff[bool] = False
    """All of them do."""
    pictures: Annotated[Path | None, arg(metavar="FOLDER", help_behavior_hint="(optional)")] = None
    """A folder that gets a PNG of each box, to look at before anything is added."""
    seed: int = 0
    """Seed of the run."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class RemoveTemplates:
    """Take templates away from a sequence's file, which is kept beside it as it was."""

    sequence: Annotated[Positional[str], _SEQUENCE]
    numbers: Annotated[Positional[tuple[int, ...]], arg(metavar="NUMBER …")]
    """As `templates list` has them."""


TemplatesAction = (
    Annotated[ListTemplates, subcommand("list")]
    | Annotated[OfferTemplates, subcommand("offer")]
    | Annotated[RemoveTemplates, subcommand("remove")]
)


@dataclass
class Templates:
    """Boxes whose colours model people: list them, have a run offer more, remove some."""

    action: OmitSubcommandPrefixes[TemplatesAction]
