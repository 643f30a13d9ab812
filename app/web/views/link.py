"""The address of the page that shows a run: what the page itself writes into its address."""

from __future__ import annotations

from urllib.parse import urlencode

from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import changed_values


def address_of(base: str, opens: str, parameters: RunParameters, defaults: RunParameters) -> str:
    """The address at which a run can be looked into again.

    Args:
        base: Of the page, with its last slash.
        opens: The name or folder that opens the recording.
        parameters: Of the run.
        defaults: Of the recording; what differs from them is in the address.
    """
    changes = {
        f"p.{key}": str(value).lower() if isinstance(value, bool) else value
        for key, value in changed_values(parameters, defaults).items()
    }
    return f"{base}?{urlencode({'seq': opens, **changes})}"
