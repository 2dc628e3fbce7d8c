"""The parameters of a module by the names that its file gives them, as the records that have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.gsdml.station import PlugError
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.protocols.profinet.gsdml.languages import Languages
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef
    from pnfarm.protocols.profinet.gsdml.station import PluggedModule

    #: Subslot, index, octet, bit.
    Position = tuple[int, int, int, int]
    Found = tuple[Position, ParameterRecord, ParameterRef]

__all__ = ["parameter_records"]

#: Names that a message lists.
_LISTED = 12


def _all(module: PluggedModule) -> Iterator[Found]:
    for submodule in module.submodules:
        for record in submodule.records:
            for ref in record.refs:
                yield (submodule.subslot, record.index, ref.byte_offset, ref.bit_offset), record, ref


def _asked(key: str) -> tuple[tuple[int, ...], str]:
    """``1.5/Filter time`` as its place and its name; no place where the key has none."""
    place, slash, name = key.partition("/")
    words = place.split(".")
    if slash and all(word.strip().isdecimal() for word in words) and len(place) <= 40:
        return tuple(map(int, words)), name
    return (), key


def _find(module: PluggedModule, key: str, languages: Languages) -> Found:
    candidates = [found for found in _all(module) if found[2].name]
    # a name may begin like a place: 5/2 valve
    here = [found for found in candidates if languages.called(found[2].name, key)]
    place, name = _asked(key)
    here = here or [
        (position, record, ref)
        for position, record, ref in candidates
        if position[: len(place)] == place and languages.called(ref.name, name)
    ]
    if not here:
        names = list(dict.fromkeys(ref.name for _, _, ref in candidates))
        shown = ", ".join(names[:_LISTED]) + (" and others" if len(names) > _LISTED else "")
        raise PlugError(
            f"slot {module.slot} has no parameter {key!r}, it has {shown or 'none at all'}" + did_you_mean(name, names),
            slot=module.slot,
        )
    if len(here) > 1:
        choices = [f"{'.'.join(map(str, position))}/{ref.name}" for position, _, ref in here[:_LISTED]]
        raise PlugError(
            f"slot {module.slot} has {len(here)} parameters {key!r}, choose one by subslot, index, octet and bit: "
            f"{', '.join(choices)}" + (" and others" if len(here) > _LISTED else ""),
            slot=module.slot,
        )
    return here[0]


def parameter_records(
    module: PluggedModule, values: Mapping[str, str | float], languages: Languages
) -> dict[tuple[int, int], bytes]:
    """(subslot, index) -> octets, of the records that ``values`` change; what they do not name has its default.

    A key is a parameter's name in any language of the file; where several have that name, with the place of one
    before it (subslot, index, octet, bit, as far as needed): ``1.5/Filter time``.  A value is a number, a text, or the
    text that the file has for a number (``hold``).  Raises :class:`PlugError` for what the file does not allow.
    """
    changed: dict[tuple[int, int], bytearray] = {}
    for key, value in values.items():
        position, record, ref = _find(module, key, languages)
        if position[:2] not in changed:
            changed[position[:2]] = bytearray(record.defaults())
        octets = changed[position[:2]]
        text = str(value).lower() if isinstance(value, bool) else str(value)
        try:
            ref.put(octets, ref.content(text, languages), checked=True)
        except ValueError as exc:
            known = ", ".join(text for _, text in ref.texts[:_LISTED])
            raise PlugError(
                f"slot {module.slot}, {ref.name}: {text!r} is given, allowed is {exc}"
                + (f" ({known})" if known else ""),
                slot=module.slot,
                subslot=position[0],
            ) from exc
    return {place: bytes(octets) for place, octets in changed.items()}
