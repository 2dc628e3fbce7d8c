"""Files in which makers describe their drives, as sources of a virtual drive's identity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pnfarm.drives.description.model import Model

__all__ = ["AccessPointError", "DescribedBus", "DescribedIdentity"]


@dataclass(frozen=True, slots=True)
class DescribedIdentity:
    """Keys of the farm file's ``identity``, and sentences about what could not be taken.

    ``file`` is what a running drive has of the file besides, in the form of its bus; None for nothing.
    """

    overrides: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    file: Any = None


class AccessPointError(ConfigError):
    """A file has no access point of that name, or several."""


@runtime_checkable
class DescribedBus(Protocol):
    """What a bus says besides if a drive of a farm file may have such a file."""

    @property
    def description_key(self) -> str:
        """The key of a drive, and of its ``identity``, that names the file: ``gsdml``."""

    def described_identity(
        self, path: Path, model: Model, own: Mapping[str, Any], access_point: str | int | None
    ) -> DescribedIdentity:
        """The identity out of a file; ``own`` are the other keys of the section, ``access_point`` is what the drive
        calls that of the file.

        Raises :class:`~pnfarm.errors.ConfigError` that names the file, if it cannot be read or is none, and
        :class:`AccessPointError` if it has no such access point.
        """
