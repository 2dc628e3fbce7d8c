"""The diagnoses that a file describes, to be raised by number or by name.

A channel diagnosis has a ChannelErrorType and perhaps an ExtChannelErrorType; one in a form of the maker's own has a
UserStructureIdentifier.  Names of the types that the standard defines are those of `diagnosis_texts`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.texts import DescribedDiagnosis
from pnfarm.protocols.profinet.gsdml.values import parse_number
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import CHANNEL_ERROR_TYPES, EXT_CHANNEL_ERROR_TYPES
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.protocols.profinet.gsdml.document import ExtDiagnosis, Gsdml, UnitDiagnosis

__all__ = ["DescribedError", "DiagnosisCatalogue", "unit_octets"]

_U16 = 0xFFFF
#: Choices that a message lists.
_LISTED = 8


@dataclass(frozen=True, slots=True)
class DescribedError:
    """One diagnosis.

    ``error_type`` is the ChannelErrorType, or the UserStructureIdentifier where ``kind`` is ``unit``;
    ``ext_error_type`` 0 is none.  ``api`` is that of the profile which it belongs to, None for the maker's and the
    standard's.  ``severities`` are those that the file allows: D (diagnosis), MR (maintenance required), MD
    (maintenance demanded), QD (qualified).  ``base`` is the name of the error that an extended one belongs to.
    A number that the file does not name has no texts.
    """

    kind: Literal["channel", "unit"]
    error_type: int
    ext_error_type: int = 0
    api: int | None = None
    base: str = ""
    name: str = ""
    help: str = ""
    severities: tuple[str, ...] = ("D",)
    unit: UnitDiagnosis | None = None


class DiagnosisCatalogue:
    """The diagnoses of one file, and those of the standard."""

    def __init__(self, gsdml: Gsdml) -> None:
        self._languages = gsdml.languages
        #: Of the file, in its primary language.
        self.own_texts = DescribedDiagnosis(gsdml.diagnoses, gsdml.unit_diagnoses)
        #: What the file describes.
        self.described = (*_channels(gsdml), *_units(gsdml))
        known = {(one.error_type, one.ext_error_type) for one in self.described if one.kind == "channel"}
        self._standard = tuple(one for one in _standard() if (one.error_type, one.ext_error_type) not in known)
        self._all = (*self.described, *self._standard)

    def texts(self, error: DescribedError, language: str) -> tuple[str, str]:
        """Name and help in a language of the file; in its primary one where there is no translation."""
        parts = (error.base, error.name) if error.base else (error.name,)
        name = ": ".join(self._languages.translated(part, language) for part in parts)
        return name, self._languages.translated(error.help, language)

    def number(
        self,
        error_type: int,
        ext_error_type: int = 0,
        *,
        kind: Literal["channel", "unit"] = "channel",
        api: int | None = None,
    ) -> DescribedError:
        """The diagnosis of that number: the file's of this API, else any; without texts if nothing names it."""
        found = [
            one
            for one in self._all
            if (one.kind, one.error_type, one.ext_error_type) == (kind, error_type, ext_error_type)
        ]
        found.sort(key=lambda one: one.api != api)
        return found[0] if found else DescribedError(kind, error_type, ext_error_type, api)

    def find(self, wanted: str | int) -> DescribedError:
        """By number (``6``, ``0x0100``, ``0x0100: 2`` with the extended one), or by name in any language of the file.

        Upper and lower case are the same; a beginning is enough if only one has it; an extended one is found by its own
        name or as ``wire break: cable``.  Raises :class:`ConfigError` with what there is.
        """
        if isinstance(wanted, int):
            return self.number(_bounded(wanted))
        folded = _folded(wanted)
        numbers = _numbers(folded)
        if numbers is not None:
            return self.number(*numbers)
        if not folded:
            raise ConfigError("the diagnosis has no name")
        for fits in (str.__eq__, str.startswith):
            own, standard = (
                [one for one in errors if any(fits(word, folded) for word in self._wordings(one))]
                for errors in (self.described, self._standard)
            )
            found = [*own, *standard]
            # what the file describes goes before the standard's; an error before those that extend it
            for some in (
                [one for one in own if not one.ext_error_type],
                own,
                [one for one in found if not one.ext_error_type],
                found,
            ):
                if len(some) == 1:
                    return some[0]
                if some:
                    raise ConfigError(f"several diagnoses are called {wanted!r}: {_shown(some)}")
        names = [word for one in self._all for word in self._wordings(one)]
        raise ConfigError(
            f"the file describes no diagnosis {wanted!r}, it has {_shown(self.described) or 'none'}, and the standard's"
            + did_you_mean(wanted, names)
        )

    def _wordings(self, error: DescribedError) -> Iterator[str]:
        """Its names in all languages, in small letters."""
        bases = [_folded(word) for word in self._languages.wordings(error.base)] if error.base else []
        for word in self._languages.wordings(error.name):
            name = _folded(word)
            yield name
            yield from (f"{base}: {name}" for base in bases)


def _folded(text: str) -> str:
    return " ".join(text.split()).casefold()


def _bounded(number: int) -> int:
    if not 0 < number <= _U16:
        raise ConfigError(f"{number} is no ChannelErrorType, these are 1 to {_U16}")
    return number


def _numbers(text: str) -> tuple[int, int] | None:
    """A ChannelErrorType and its extension; None for a name."""
    first, colon, second = text.partition(":")
    try:
        return _bounded(parse_number(first, 1 << 32)), parse_number(second, _U16) if colon else 0
    except ValueError:
        return None


def _shown(errors: tuple[DescribedError, ...] | list[DescribedError]) -> str:
    named = [
        f"{one.base}: {one.name} (0x{one.error_type:04X}: {one.ext_error_type})"
        if one.ext_error_type
        else f"{one.name} (0x{one.error_type:04X})"
        for one in errors[:_LISTED]
    ]
    return ", ".join(named) + (" and others" if len(errors) > _LISTED else "")


def _channels(gsdml: Gsdml) -> Iterator[DescribedError]:
    for one in gsdml.diagnoses:
        name = one.name or CHANNEL_ERROR_TYPES.get(one.error_type, f"0x{one.error_type:04X}")
        yield DescribedError("channel", one.error_type, 0, one.api, "", name, one.help, one.severities)
        for ext in one.extended:
            yield _extended(one.error_type, name, ext, one.api)


def _extended(error_type: int, name: str, ext: ExtDiagnosis, api: int | None) -> DescribedError:
    named = ext.name or f"0x{ext.error_type:04X}"
    return DescribedError("channel", error_type, ext.error_type, api, name, named, ext.help, ext.severities)


def _units(gsdml: Gsdml) -> Iterator[DescribedError]:
    for one in gsdml.unit_diagnoses:
        name = one.name or f"0x{one.user_structure:04X}"
        yield DescribedError("unit", one.user_structure, 0, one.api, name=name, help=one.help, unit=one)


def _standard() -> Iterator[DescribedError]:
    for error_type, name in CHANNEL_ERROR_TYPES.items():
        yield DescribedError("channel", error_type, name=name)
        for ext, text in EXT_CHANNEL_ERROR_TYPES.get(error_type, {}).items():
            yield DescribedError("channel", error_type, ext, base=name, name=text)


def unit_octets(unit: UnitDiagnosis, values: Mapping[str, str | float] | None = None) -> bytes:
    """The octets of a diagnosis in the maker's own form: its defaults, and ``values`` by the names of its fields.

    Raises :class:`ConfigError` for an unknown name, and for a value that does not fit.
    """
    given = {name.casefold(): (name, value) for name, value in (values or {}).items()}
    octets = bytearray(max((ref.byte_offset + (ref.octets or 0) for ref in unit.fields), default=0))
    for ref in unit.fields:
        name, value = given.pop(ref.name.casefold(), (ref.name, None))
        try:
            if value is not None or ref.default:
                ref.put(octets, ref.default if value is None else ref.content(str(value)), checked=value is not None)
        except ValueError as exc:
            if value is not None:
                raise ConfigError(f"{unit.name}, {name}: {str(value)!r} is given, allowed is {exc}") from exc
    if given:
        name, _ = next(iter(given.values()))
        known = [ref.name for ref in unit.fields]
        raise ConfigError(
            f"{unit.name} has no field {name!r}, it has {', '.join(known) or 'none'}" + did_you_mean(name, known)
        )
    return bytes(octets)
