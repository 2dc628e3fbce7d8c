"""A model's ``telegrams.toml``: signals, telegrams with their modules, and the names of bits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.drives.model_files import integer, read_toml, required
from pnfarm.drives.parameter import Backing, Parameter
from pnfarm.drives.telegram import (
    PARAMETER_WORDS,
    TASK_FORMS,
    MappingError,
    Module,
    Signal,
    Submodule,
    Telegram,
    parameter_signals,
    signal_codes,
)
from pnfarm.drives.word_bits import WordBits, read_bits
from pnfarm.errors import ConfigError
from pnfarm.table.channel import MAX_WORDS
from pnfarm.table.signals import ACTUAL_SLOTS, SENT_BACK, SETPOINT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["check_settings", "read_telegrams"]

#: Set points for which the axis has a place beside that of the telegram.
FALLING_BACK = ("MDI_ACC",)


def _signal(table: Mapping[str, Any], where: str) -> Signal:
    name, direction = required(table, "name", where), required(table, "direction", where)
    if direction not in {"setpoint", "actual"}:
        raise ConfigError(f"{where}, direction: {direction!r} is neither setpoint nor actual")
    setpoint = direction == "setpoint"
    if name not in (SETPOINT_SLOTS if setpoint else ACTUAL_SLOTS):
        raise ConfigError(f"{where}, name: the process image has no {direction} {name!r}")
    if required(table, "bits", where) not in {16, 32}:
        raise ConfigError(f"{where}, bits: {table['bits']!r} is neither 16 nor 32")
    if table.get("readable") and not (setpoint and SETPOINT_SLOTS[name] in SENT_BACK):
        raise ConfigError(f"{where}, readable: {name!r} is no set point that the process image sends back")
    if table.get("stored", False) != name.startswith("SHOWN_"):
        raise ConfigError(f"{where}, stored: of a signal SHOWN_0, which is a stored parameter, and of no other")
    return Signal(
        number=required(table, "number", where),
        name=name,
        bits=table["bits"],
        setpoint=setpoint,
        drive_signal=table.get("drive_signal", ""),
        source=required(table, "source", where),
        note=table.get("note", ""),
        readable=table.get("readable", False),
        stored=table.get("stored", False),
        shown_as=table.get("shown_as", 0),
        signed=table.get("signed", False),
    )


def _parameter_words(table: Mapping[str, Any], where: str) -> int:
    """How many words in front are a parameter channel: they have no signal of their own."""
    count: int = table.get("parameter_words", 0)
    if count not in {0, PARAMETER_WORDS}:
        raise ConfigError(f"{where}, parameter_words: {count!r} is neither 0 nor {PARAMETER_WORDS}")
    for direction in ("output", "input"):
        if required(table, direction, where)[:count] != ["-"] * count:
            raise ConfigError(f"{where}, {direction}: the first {count} words are the parameter channel's, - each")
    return count


def _telegram(
    table: Mapping[str, Any], where: str, signals: Mapping[str, Signal], layout: Mapping[str, Any]
) -> Telegram:
    words: dict[str, tuple[Signal | None, ...]] = {}
    codes: dict[str, tuple[int, ...]] = {}
    parameter_words = _parameter_words(table, where)
    for direction in ("output", "input"):
        names = required(table, direction, where)
        unknown = [name for name in names if name != "-" and name not in signals]
        if unknown:
            raise ConfigError(f"{where}, {direction}: there is no signal {unknown[0]!r}")
        if len(names) > MAX_WORDS:
            raise ConfigError(f"{where}, {direction}: {len(names)} words; a frame carries at most {MAX_WORDS}")
        channel = parameter_signals(setpoint=direction == "output")[:parameter_words]
        words[direction] = channel + tuple(None if name == "-" else signals[name] for name in names[parameter_words:])
        try:
            codes[direction] = signal_codes(words[direction], setpoint=direction == "output")
        except MappingError as exc:
            raise ConfigError(f"{where}, {direction}: {exc}") from exc
    known = layout["telegram"]
    data = Submodule(
        slot=layout["slot"],
        subslot=known["subslot"],
        ident=required(table, "submodule_ident", where),
        api=layout["api"],
        input_bytes=2 * len(words["input"]),
        output_bytes=2 * len(words["output"]),
        name=required(table, "name", where),
        source=known["source"],
        note=known.get("note", ""),
    )
    ident, source = required(table, "module_ident", where), required(table, "ident_source", where)
    return Telegram(
        number=required(table, "number", where),
        name=required(table, "name", where),
        free_mapping=required(table, "free_mapping", where),
        output=words["output"],
        input=words["input"],
        output_words=codes["output"],
        input_words=codes["input"],
        module=Module(ident, (_access_point(layout), data), source),
        source=required(table, "source", where),
        note=table.get("note", ""),
        others=tuple(
            _other_module(other, data, layout, f"{where}, other_modules {index}")
            for index, other in enumerate(table.get("other_modules", ()), 1)
        ),
        parameter_words=parameter_words,
        settings=_settings(table, where),
        opmode=table.get("opmode"),
        tasks=_tasks(table.get("tasks", "none"), where),
        pulses_enabled=table.get("pulses_enabled"),
        falls_back=_falls_back(table, where),
    )


def _falls_back(table: Mapping[str, Any], where: str) -> tuple[str, ...]:
    """Set points whose parameter counts where the telegram's word is 0."""
    names = tuple(table.get("falls_back", ()))
    for name in names:
        if name not in FALLING_BACK or name not in table["output"]:
            raise ConfigError(f"{where}, falls_back: {name!r} is none of {', '.join(FALLING_BACK)} in its output")
    return names


def _tasks(name: Any, where: str) -> int:
    if name not in TASK_FORMS:
        raise ConfigError(f"{where}, tasks: {name!r} is none of {', '.join(TASK_FORMS)}")
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


def _other_module(table: Mapping[str, Any], data: Submodule, layout: Mapping[str, Any], where: str) -> Module:
    """Another module of a telegram: as its first one, under another ident and name."""
    name, source = required(table, "name", where), required(table, "source", where)
    note = table.get("note", "")
    if source == "assumed" and not note:
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    submodules = tuple(replace(submodule, source=source, note=note) for submodule in (_access_point(layout), data))
    return Module(required(table, "ident", where), submodules, source, note, name, _settings(table, where))


def _settings(table: Mapping[str, Any], where: str) -> dict[int, int]:
    """What plugging a module sets: PNU -> raw number; the parameters are looked for when all are known."""
    return {
        integer(str(pnu), where, "settings"): integer(str(value), where, f"settings.{pnu}")
        for pnu, value in table.get("settings", {}).items()
    }


def check_settings(telegrams: Mapping[int, Telegram], parameters: Mapping[int, Parameter], path: Path) -> None:
    """Whether the model has the parameters that its modules set, and they may hold those values."""
    for telegram in telegrams.values():
        for settings in (telegram.settings, *(module.settings for module in telegram.modules)):
            for pnu, value in settings.items():
                parameter = parameters.get(pnu)
                if parameter is None or parameter.backing not in {Backing.STORED, Backing.FIELD}:
                    raise ConfigError(
                        f"{path}, telegram {telegram.number}, settings: no parameter {pnu} that is stored"
                    )
                if not parameter.minimum <= value <= parameter.maximum:
                    raise ConfigError(
                        f"{path}, telegram {telegram.number}, settings.{pnu}: {value} is not within "
                        f"{parameter.minimum}..{parameter.maximum}"
                    )


def read_telegrams(
    path: Path, layout: Mapping[str, Any]
) -> tuple[dict[int, Signal], dict[int, Telegram], tuple[WordBits, ...]]:
    """Signals and telegrams by number, and names of bits; ``layout`` is what ``model.toml`` says of all modules."""
    data = read_toml(path)
    signals: dict[int, Signal] = {}
    for index, table in enumerate(data.get("signal", ()), 1):
        signal = _signal(table, f"{path}, signal {index}")
        if signal.number in signals:
            raise ConfigError(f"{path}, signal {index}, number: {signal.number} stands twice")
        signals[signal.number] = signal
    by_name = {signal.name: signal for signal in signals.values()}
    telegrams: dict[int, Telegram] = {}
    for index, table in enumerate(data.get("telegram", ()), 1):
        telegram = _telegram(table, f"{path}, telegram {index}", by_name, layout)
        if telegram.number in telegrams:
            raise ConfigError(f"{path}, telegram {index}, number: {telegram.number} stands twice")
        if telegram.opmode not in {None, 0, 1, 2}:
            raise ConfigError(f"{path}, telegram {index}, opmode: {telegram.opmode!r} is none of 0, 1, 2")
        if telegram.pulses_enabled is not None and telegram.pulses_enabled not in range(12):
            raise ConfigError(
                f"{path}, telegram {index}, pulses_enabled: {telegram.pulses_enabled!r} is not within 0..11"
            )
        telegrams[telegram.number] = telegram
    idents = [module.ident for telegram in telegrams.values() for module in telegram.modules]
    twice = next((ident for ident in idents if idents.count(ident) > 1), None)
    if twice is not None:
        raise ConfigError(f"{path}: the module ident 0x{twice:X} stands twice")
    return signals, telegrams, read_bits(data.get("bits", ()), str(path), by_name, telegrams)
