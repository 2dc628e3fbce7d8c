"""Files in which makers describe their drives, as sources of a virtual drive's identity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pnfarm.drives.description.model import Model

__all__ = ["DescribedBus", "DescribedIdentity"]


@dataclass(frozen=True, slots=True)
class DescribedIdentity:
    """Keys of the farm file's ``identity``, and sentences about what could not be taken."""

    overrides: Mapping[str, Any]
    notes: tuple[str, ...] = ()


@runtime_checkable
class DescribedBus(Protocol):
    """What a bus says besides if a farm file's ``identity`` may name such a file."""

    @property
    def description_key(self) -> str:
        """The key of ``identity`` that names the file: ``gsdml``."""

    def described_identity(self, path: Path, model: Model, own: Mapping[str, Any]) -> DescribedIdentity:
        """The identity out of a file; ``own`` are the other keys of the section.

        Raises :class:`~pnfarm.errors.ConfigError` that names the file, if it cannot be read or is none.
        """
