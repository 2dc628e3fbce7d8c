"""States as files of JSON in one folder, each written as a whole."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.state.refused import RefusedStateError
from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.whole_files import write_whole

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.farm.shard import Shard

__all__ = ["KeptState", "StateFiles", "UnknownStateError", "parse_state", "states_folder"]

#: Below the farm's state folder.
_FOLDER = "states"
#: Octets of a file, files in a folder, and mappings and lists in each other.
MOST_OCTETS = 256_000_000
MOST_STATES = 1000
_DEEPEST = 64
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


class UnknownStateError(ConfigError):
    """There is no state of this name."""


class KeptState(NamedTuple):
    """A file: its state's name, when it was written (seconds since 1970), and its length."""

    name: str
    saved_s: float
    octets: int


def states_folder(state: Path | None, shard: Shard | None) -> Path | None:
    """Where the states of a farm, or of its shard, are kept; ``state``: the folder of the farm file's key."""
    if state is None:
        return None
    return state / _FOLDER if shard is None else state / _FOLDER / f"shard-{str(shard).replace('/', '-')}"


def parse_state(data: bytes, name: str) -> Any:
    """What is in the file of this state; raises :class:`RefusedStateError`."""
    begin = f"state {name} cannot be restored: its file is"
    try:
        found = json.loads(data, parse_constant=_refuse_constant)
    except RecursionError as exc:
        raise RefusedStateError(f"{begin} nested too deeply") from exc
    except ValueError as exc:
        raise RefusedStateError(f"{begin} damaged, it is not JSON: {exc}") from exc
    level, depth = [found], 0
    while level:
        if depth > _DEEPEST:
            raise RefusedStateError(f"{begin} nested too deeply")
        inside = [one for one in level if isinstance(one, dict | list)]
        level = [part for one in inside for part in (one.values() if isinstance(one, dict) else one)]
        depth += 1
    return found


def _refuse_constant(text: str) -> None:
    raise ValueError(f"{text} is no number")


class StateFiles:
    """The states in ``folder``, which is made with the first one."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def kept(self) -> list[KeptState]:
        """All of them, by name.  Raises :class:`EnvironmentError_`."""
        found = []
        try:
            for path in self._folder.glob("*.json") if self._folder.exists() else ():
                if _NAME.fullmatch(path.stem) and path.is_file():
                    facts = path.stat()
                    found.append(KeptState(path.stem, facts.st_mtime, facts.st_size))
        except OSError as exc:
            raise self._failed("list the states", exc) from exc
        return sorted(found)

    def read(self, name: str) -> Any:
        """One of them; raises :class:`UnknownStateError`, :class:`RefusedStateError` or :class:`EnvironmentError_`."""
        try:
            data = read_regular(self.path(name), MOST_OCTETS + 1)
        except FileNotFoundError as exc:
            raise self._unknown(name) from exc
        except OSError as exc:
            raise self._failed(f"read state {name}", exc) from exc
        if len(data) > MOST_OCTETS:
            raise RefusedStateError(f"state {name} cannot be restored: its file has more than {MOST_OCTETS} octets")
        return parse_state(data, name)

    def write(self, name: str, state: Any) -> None:
        """Write one, also over an earlier one.  Raises :class:`ConfigError` or :class:`EnvironmentError_`."""
        path = self.path(name)
        data = json.dumps(state, allow_nan=False, separators=(",", ":")).encode()
        if len(data) > MOST_OCTETS:
            raise ConfigError(f"state {name} has {len(data)} octets, more than {MOST_OCTETS}")
        if not path.exists() and len(self.kept()) >= MOST_STATES:
            raise ConfigError(f"{self._folder} has {MOST_STATES} states, as many as it can have; delete some")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole({path: data})
        except OSError as exc:
            raise self._failed(f"write state {name}", exc) from exc

    def delete(self, name: str) -> None:
        """Delete one; raises :class:`UnknownStateError` or :class:`EnvironmentError_`."""
        try:
            self.path(name).unlink()
        except FileNotFoundError as exc:
            raise self._unknown(name) from exc
        except OSError as exc:
            raise self._failed(f"delete state {name}", exc) from exc

    def path(self, name: str) -> Path:
        """The file of a state; raises :class:`ConfigError` for what is no name."""
        if not _NAME.fullmatch(name):
            raise ConfigError(
                f"{shown(name)} is no name of a state: up to 64 letters, digits, '-', '_', '.', no sign first"
            )
        return self._folder / f"{name}.json"

    def _unknown(self, name: str) -> UnknownStateError:
        return UnknownStateError(f"there is no state {name} in {self._folder}; `pnfarm state list` lists them")

    def _failed(self, what: str, exc: OSError) -> EnvironmentError_:
        why = exc.strerror or str(exc)
        return EnvironmentError_(f"cannot {what} in {self._folder}: {why[:1].lower()}{why[1:]}")
