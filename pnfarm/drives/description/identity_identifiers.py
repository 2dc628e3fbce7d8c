"""The part of the farm file's ``identity`` about identifiers: what a PROFIBUS master names telegrams by."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.identity_modules import less_absent, mapping, number
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.profiles.profidrive.part import Profidrive

__all__ = ["octets", "with_identifiers"]

#: Octets of Chk_Cfg.
_LONGEST = 244


def octets(value: Any, where: str, most: int) -> bytes:
    """A text in hexadecimal, or octets; raises :class:`ConfigError`."""
    try:
        found = value if isinstance(value, bytes) else bytes.fromhex(value)
    except (TypeError, ValueError):
        found = b""
    if not 0 < len(found) <= most:
        raise ConfigError(f"identity.{where}: {value!r} is not 1 to {most} octets in hexadecimal")
    return found


def with_identifiers(profidrive: Profidrive, overrides: Mapping[str, Any], model: str) -> Profidrive:
    """The telegrams under the identifiers of ``telegrams``, less those ``without``.

    Raises :class:`ConfigError`.
    """
    telegrams = dict(profidrive.telegrams)
    for key, wanted in mapping(overrides.get("telegrams", {}), "telegrams").items():
        where = f"telegrams.{key}"
        telegram = telegrams.get(number(key, where, 0xFFFF))
        if telegram is None:
            known = ", ".join(map(str, telegrams))
            raise ConfigError(f"identity.{where}: {model} has no telegram {key}; it has {known}")
        telegrams[telegram.number] = dataclasses.replace(telegram, identifiers=octets(wanted, where, _LONGEST))
    left = less_absent(dataclasses.replace(profidrive, telegrams=telegrams), overrides, model)
    if len({one.identifiers for one in left.telegrams.values()}) != len(left.telegrams):
        raise ConfigError("identity.telegrams: two telegrams have the same identifiers; a master could not say which")
    return left
