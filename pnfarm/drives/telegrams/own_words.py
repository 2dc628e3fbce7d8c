"""A free telegram, whose words a farm file gives by the names of the model's signals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.drives.telegrams.identifiers import profile_identifiers
from pnfarm.drives.telegrams.telegram import TASK_FORMS, MappingError, signal_codes
from pnfarm.errors import ConfigError
from pnfarm.table.channel import MAX_WORDS
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Module, Signal, Telegram

__all__ = ["FIRST_WORDS", "free_telegram", "with_words"]

#: Key of the farm file -> the first word, as the profile asks.
FIRST_WORDS = {"output": "STW1", "input": "ZSW1"}
#: The set point of a telegram with tasks -> how it brings them.
_TASKS = {"POS_STW1": "pos-stw", "SATZANW": "mdi"}
_NO_SIGNAL = "-"
_POSITION_MODE = 2


def free_telegram(model: Model) -> Telegram | None:
    """The telegram whose words a farm file gives, None for a model without one."""
    return next((telegram for telegram in model.profidrive.telegrams.values() if telegram.own_words), None)


def _signals(model: Model, direction: str, names: Sequence[str]) -> tuple[Signal | None, ...]:
    """The signals word by word: each name once, a double word takes two."""
    setpoint = direction == "output"
    # those of single precision come together: they are a telegram's own
    signals = (signal for signal in model.profidrive.signals.values() if not signal.real)
    known = {signal.name: signal for signal in signals if signal.setpoint is setpoint}
    found: list[Signal | None] = []
    for place, name in enumerate(names):
        if name != _NO_SIGNAL and name not in known:
            kind = "set point" if setpoint else "actual value"
            what = f"word {place + 1}: {model.name} has no {kind} {shown(name)}{did_you_mean(name, known)}"
            raise ConfigError(f"words.{direction}: {what}")
        signal = known.get(name)
        found += [signal] * (signal.bits // 16 if signal else 1)
    if names[:1] != [FIRST_WORDS[direction]]:
        raise ConfigError(f"words.{direction}: must begin with {FIRST_WORDS[direction]}")
    if len(found) > MAX_WORDS - 1:
        raise ConfigError(f"words.{direction}: {len(found)} words; a frame carries at most {MAX_WORDS - 1}")
    return tuple(found)


def _module(module: Module, words: Mapping[str, tuple[Signal | None, ...]]) -> Module:
    """The telegram's module with these words; each length has an ident of its own."""
    output, inputs = len(words["output"]), len(words["input"])
    *access, data = module.submodules
    ident = output << 26 | inputs << 20
    lengths = replace(data, ident=data.ident | ident, output_bytes=2 * output, input_bytes=2 * inputs)
    return replace(module, ident=module.ident | ident, submodules=(*access, lengths))


def with_words(model: Model, given: Mapping[str, Sequence[str]]) -> Model:
    """The model with the free telegram's words ``output`` and ``input``; raises :class:`ConfigError`."""
    if not given:
        return model
    free = free_telegram(model)
    if free is None:
        raise ConfigError(f"words: {model.name} has no telegram whose words a farm file gives")
    if given.keys() != FIRST_WORDS.keys():
        raise ConfigError("words: must have output and input")
    words: dict[str, tuple[Signal | None, ...]] = {}
    codes: dict[str, tuple[int, ...]] = {}
    for direction in FIRST_WORDS:
        names = given[direction]
        words[direction] = _signals(model, direction, list(names))
        try:
            codes[direction] = signal_codes(words[direction], setpoint=direction == "output")
        except MappingError as exc:
            raise ConfigError(f"words.{direction}: {exc}") from exc
    form = next((form for name, form in _TASKS.items() if name in given["output"]), "")
    telegram = replace(
        free,
        output=words["output"],
        input=words["input"],
        output_words=codes["output"],
        input_words=codes["input"],
        module=_module(free.module, words) if free.module.submodules else free.module,
        identifiers=profile_identifiers(free.number, *map(len, words.values())) if free.identifiers else b"",
        tasks=TASK_FORMS.index(form) if form else free.tasks,
        opmode=_POSITION_MODE if form else free.opmode,
    )
    telegrams = dict(model.profidrive.telegrams) | {free.number: telegram}
    return replace(model, profidrive=replace(model.profidrive, telegrams=telegrams))
