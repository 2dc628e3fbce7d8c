"""Files of saved states: those of a small farm, with its plant, changed."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from moment_cell import cell_text

from pnfarm.errors import DecodeError
from pnfarm.farm.state.content import TakenState, check_state
from pnfarm.farm.state.files import parse_state
from pnfarm.farm.state.refused import RefusedStateError
from pnfarm.testing import Line

__all__ = ["check_changed", "saved_states"]


@cache
def _line() -> Line:
    line = Line.from_text(cell_text("profinet", Path(mkdtemp())))
    line.run(0.5)
    return line


def saved_states() -> list[bytes]:
    """Good files."""
    return [json.dumps(TakenState(_line().core).plain(), indent=1).encode()]


def check_changed(data: bytes) -> None:
    """Raises :class:`DecodeError` where the farm refuses them."""
    try:
        check_state(_line().core, parse_state(data, "x"))
    except RefusedStateError as exc:
        raise DecodeError("refused", str(exc)) from exc
