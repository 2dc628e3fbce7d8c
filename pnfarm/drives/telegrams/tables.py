"""``telegrams.toml``: signals, telegrams with their modules, and the names of bits.

A product may give the words of its telegrams, and each bus the modules that carry them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import integer, joined_tables, required
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.drives.telegrams.identifiers import profile_identifiers
from pnfarm.drives.telegrams.telegram import (
    PARAMETER_WORDS,
    TASK_FORMS,
    MappingError,
    Module,
    Signal,
    Submodule,
    Telegram,
    parameter_signals,
    signal_codes,
    with_choices,
)
from pnfarm.drives.telegrams.word_bits import WordBits, read_bits
from pnfarm.errors import ConfigError
from pnfarm.table.channel import MAX_WORDS
from pnfarm.table.signals import ACTUAL_SLOTS, SENT_BACK, SETPOINT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.files import ModelFiles, Table
    from pnfarm.drives.parameters.numbers import ParameterNumbers
    from pnfarm.drives.parameters.parameter import Parameter

    Parameters = Mapping[int, Parameter]

__all__ = ["read_telegrams"]

FILE = "telegrams.toml"

REAL_BITS = 32
#: Set points for which the axis has a field besides the telegram's.
FALLING_BACK = ("MDI_ACC",)


def _signal(table: Table) -> Signal:
    name, direction = table.required("name"), table.required("direction")
    if direction not in {"setpoint", "actual"}:
        raise table.wrong("direction", f"{direction!r} is neither setpoint nor actual")
    setpoint = direction == "setpoint"
    if name not in (SETPOINT_SLOTS if setpoint else ACTUAL_SLOTS):
        raise table.wrong("name", f"the process image has no {direction} {name!r}")
    if table.required("bits") not in {16, 32}:
        raise table.wrong("bits", f"{table['bits']!r} is neither 16 nor 32")
    if table.get("readable") and not (setpoint and SETPOINT_SLOTS[name] in SENT_BACK):
        raise table.wrong("readable", f"{name!r} is not a set point that the process image echoes")
    if table.get("stored", False) != name.startswith("SHOWN_"):
        raise table.wrong("stored", "only for a signal SHOWN_0, which is a stored parameter")
    real = _flag(table, "real")
    if real and table["bits"] != REAL_BITS:
        raise table.wrong("real", f"a number of single precision has {REAL_BITS} bits")
    return Signal(
        number=table.required("number"),
        name=name,
        bits=table["bits"],
        setpoint=setpoint,
        drive_signal=table.get("drive_signal", ""),
        source=table.required("source"),
        note=table.get("note", ""),
        readable=table.get("readable", False),
        stored=table.get("stored", False),
        shown_as=table.get("shown_as", 0),
        signed=table.get("signed", False),
        real=real,
    )


def _parameter_words(table: Table) -> int:
    """Number of leading words that are a parameter channel: they have no signal of their own."""
    count: int = table.get("parameter_words", 0)
    if count not in {0, PARAMETER_WORDS}:
        raise table.wrong("parameter_words", f"{count!r} is neither 0 nor {PARAMETER_WORDS}")
    for direction in ("output", "input"):
        if table.required(direction)[:count] != ["-"] * count:
            raise table.wrong(direction, f"the first {count} words are the parameter channel's, - each")
    return count


def _telegram(
    table: Table, signals: Mapping[str, Signal], layout: Mapping[str, Any] | None, numbers: ParameterNumbers
) -> Telegram:
    words: dict[str, tuple[Signal | None, ...]] = {}
    codes: dict[str, tuple[int, ...]] = {}
    parameter_words = _parameter_words(table)
    for direction in ("output", "input"):
        names = table.required(direction)
        unknown = [name for name in names if name != "-" and name not in signals]
        if unknown:
            raise table.wrong(direction, f"there is no signal {unknown[0]!r}")
        if len(names) > MAX_WORDS:
            raise table.wrong(direction, f"{len(names)} words; a frame carries at most {MAX_WORDS}")
        channel = parameter_signals(setpoint=direction == "output")[:parameter_words]
        words[direction] = channel + tuple(None if name == "-" else signals[name] for name in names[parameter_words:])
        try:
            codes[direction] = signal_codes(words[direction], setpoint=direction == "output")
        except MappingError as exc:
            raise table.wrong(direction, f"{exc}") from exc
    supplementary = _flag(table, "supplementary")
    if layout is None:
        modules = [Module(0, (), table.required("ident_source"))]
    elif supplementary:
        modules = [Module(0, (_data(table, words, layout, "supplement"),), table.required("ident_source"))]
    else:
        modules = _modules(table, words, layout, numbers)
    return Telegram(
        number=table.required("number"),
        name=table.required("name"),
        free_mapping=table.required("free_mapping"),
        output=words["output"],
        input=words["input"],
        output_words=codes["output"],
        input_words=codes["input"],
        module=modules[0],
        source=table.required("source"),
        note=table.get("note", ""),
        others=tuple(modules[1:]),
        parameter_words=parameter_words,
        settings=_settings(table, table.where("settings"), numbers),
        opmode=_choice(table, "opmode", range(3)),
        tasks=_tasks(table),
        pulses_enabled=_choice(table, "pulses_enabled", range(12)),
        falls_back=_falls_back(table),
        identifiers=_identifiers(table, words, profile=layout is None),
        own_words=_flag(table, "own_words"),
        supplementary=supplementary,
    )


def _data(
    table: Table, words: Mapping[str, tuple[Signal | None, ...]], layout: Mapping[str, Any], place: str
) -> Submodule:
    """The submodule with a telegram's data."""
    known = layout[place]
    return Submodule(
        slot=layout["slot"],
        subslot=known["subslot"],
        ident=table.required("submodule_ident"),
        api=layout["api"],
        input_bytes=2 * len(words["input"]),
        output_bytes=2 * len(words["output"]),
        name=table.required("name"),
        source=known["source"],
        note=known.get("note", ""),
    )


def _modules(
    table: Table,
    words: Mapping[str, tuple[Signal | None, ...]],
    layout: Mapping[str, Any],
    numbers: ParameterNumbers,
) -> list[Module]:
    """The modules that carry a telegram, the one to use first."""
    data = _data(table, words, layout, "telegram")
    return [
        Module(table.required("module_ident"), (_access_point(layout), data), table.required("ident_source")),
        *(
            _other_module(other, data, layout, f"{table.where('other_modules')} {index}", numbers)
            for index, other in enumerate(table.get("other_modules", ()), 1)
        ),
    ]


def _identifiers(table: Table, words: Mapping[str, tuple[Signal | None, ...]], *, profile: bool) -> bytes:
    """Identifiers of its modules, in hexadecimal; left out, the ``profile``'s, and none on a bus without."""
    text = table.get("identifiers", "")
    if profile and not text:
        return profile_identifiers(table.required("number"), len(words["output"]), len(words["input"]))
    try:
        return bytes.fromhex(text)
    except (TypeError, ValueError):
        raise table.wrong("identifiers", f"{text!r} are no octets in hexadecimal") from None


def _flag(table: Table, key: str) -> bool:
    """An optional true or false."""
    value = table.get(key, False)
    if type(value) is not bool:
        raise table.wrong(key, f"{value!r} is neither true nor false")
    return value


def _choice(table: Table, key: str, allowed: range) -> int | None:
    """An optional number."""
    value: int | None = table.get(key)
    if value is not None and value not in allowed:
        raise table.wrong(key, f"{value!r} is not within {allowed[0]}..{allowed[-1]}")
    return value


def _falls_back(table: Table) -> tuple[str, ...]:
    """Set points whose parameter applies while the telegram's word is 0."""
    names = tuple(table.get("falls_back", ()))
    for name in names:
        if name not in FALLING_BACK or name not in table["output"]:
            raise table.wrong("falls_back", f"{name!r} is not one of {', '.join(FALLING_BACK)} in its output")
    return names


def _tasks(table: Table) -> int:
    name = table.get("tasks", "none")
    if name not in TASK_FORMS:
        raise table.wrong("tasks", f"{name!r} is not one of {', '.join(TASK_FORMS)}")
    return TASK_FORMS.index(name)


def _access_point(layout: Mapping[str, Any]) -> Submodule:
    point = layout["access_point"]
    return Submodule(
        slot=layout["slot"],
        subslot=point["subslot"],
        ident=point["ident"],
        api=layout["api"],
        input_bytes=0,
        output_bytes=0,
        name="Parameter access point",
        source=point["source"],
        note=point.get("note", ""),
    )


def _other_module(
    table: Mapping[str, Any], data: Submodule, layout: Mapping[str, Any], where: str, numbers: ParameterNumbers
) -> Module:
    """Another module of a telegram: like its first one, with another ident and name."""
    name, source = required(table, "name", where), required(table, "source", where)
    note = table.get("note", "")
    if source == "assumed" and not note:
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    submodules = tuple(replace(submodule, source=source, note=note) for submodule in (_access_point(layout), data))
    return Module(
        required(table, "ident", where), submodules, source, note, name, _settings(table, f"{where}, settings", numbers)
    )


def _settings(table: Mapping[str, Any], where: str, numbers: ParameterNumbers) -> dict[int, int]:
    """Parameters that plugging a module sets: PNU -> raw number."""
    return {
        numbers.of(pnu, where): integer(str(value), where, str(pnu)) for pnu, value in table.get("settings", {}).items()
    }


def _check_settings(telegrams: Mapping[int, Telegram], places: Mapping[int, Table], known: Parameters) -> None:
    """Check that the model has the parameters that its modules set, and that the values are allowed."""
    for telegram in telegrams.values():
        where = places[telegram.number].where("settings")
        for settings in (telegram.settings, *(module.settings for module in telegram.modules)):
            for pnu, value in settings.items():
                parameter = known.get(pnu)
                if parameter is None or parameter.backing not in {Backing.STORED, Backing.FIELD}:
                    raise ConfigError(f"{where}: no parameter {pnu} that is stored")
                if not parameter.minimum <= value <= parameter.maximum:
                    raise ConfigError(f"{where}.{pnu}: {value} is not within {parameter.minimum}..{parameter.maximum}")


def _check_identifiers(telegrams: Mapping[int, Telegram], places: Mapping[int, Table]) -> None:
    """A master names a telegram by its identifiers alone."""
    owners: dict[bytes, int] = {}
    for number, telegram in telegrams.items():
        owner = owners.setdefault(telegram.identifiers, number) if telegram.identifiers else number
        if owner != number:
            where = places[number].where("identifiers")
            raise ConfigError(f"{where}: {telegram.identifiers.hex(' ').upper()} are those of telegram {owner}")


def _check_stored(signal: Signal, table: Table, parameters: Parameters) -> None:
    """Whether a signal that shows a parameter has one."""
    shown = parameters.get(signal.number)
    if signal.stored and (
        shown is None or shown.backing not in {Backing.STORED, Backing.FIELD} or 8 * shown.octets != signal.bits
    ):
        raise table.wrong("stored", f"no stored parameter {signal.number} of its length")
    if signal.shown_as and signal.shown_as not in parameters:
        raise table.wrong("shown_as", f"no parameter {signal.shown_as}")


def read_telegrams(
    files: ModelFiles, layout: Mapping[str, Any] | None, parameters: Parameters, numbers: ParameterNumbers
) -> tuple[dict[int, Signal], dict[int, Telegram], dict[int, Telegram], tuple[WordBits, ...]]:
    """Signals, telegrams and supplementary telegrams by number, in ascending order, and names of bits.

    ``layout`` is the section ``telegram_module``, the structure of all modules; None on a bus whose telegrams have
    identifiers instead.
    """
    tables = joined_tables(files, FILE, "signal", "number")
    signals = {number: _signal(table) for number, table in sorted(tables.items())}
    for number, signal in signals.items():
        _check_stored(signal, tables[number], parameters)
    by_name = {signal.name: signal for signal in signals.values()}
    places = joined_tables(files, FILE, "telegram", "number")
    # the product may have telegrams that a bus lacks
    known = frozenset(places)
    places = {number: table for number, table in places.items() if "absent" not in table}
    telegrams = {number: _telegram(table, by_name, layout, numbers) for number, table in sorted(places.items())}
    _check_settings(telegrams, places, parameters)
    _check_identifiers(telegrams, places)
    owners: dict[int, int] = {}
    supplements = {number: telegram for number, telegram in telegrams.items() if telegram.supplementary}
    telegrams = {number: telegram for number, telegram in telegrams.items() if number not in supplements}
    for telegram in telegrams.values() if layout is not None else ():
        for module in telegram.modules:
            if module.ident in owners:
                where = places[telegram.number].where("module_ident")
                raise ConfigError(f"{where}: 0x{module.ident:X} is the module ident of telegram {owners[module.ident]}")
            owners[module.ident] = telegram.number
    bits = [
        (f"{path}, bits {index}", table)
        for path, data in files.tomls(FILE)
        for index, table in enumerate(data.get("bits", ()), 1)
    ]
    if supplements:
        telegrams = with_choices(telegrams, supplements.values())
    return signals, telegrams, supplements, read_bits(bits, by_name, known)
