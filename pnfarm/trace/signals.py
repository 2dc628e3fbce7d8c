"""The signals of a drive that a trace can sample, with their units; those of a device: :mod:`pnfarm.trace.traced`.

Names are lower-case.  A drive has

* its motor and its state, whatever its model and bus;
* the words of its profile (``stw1``), and each of their bits by the name that the model's manual gives it
  (``zsw1.fault_present``), or by its number (``zsw1.3``);
* the words of its telegram, by the signals' own names (``nsoll_a``), as they are on the wire, and the bits of those
  that are control and status words.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import fault_label
from pnfarm.drives.telegrams.word_bits import STW1_BITS
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.station.signals import SIGNALS, profile_words
from pnfarm.table.access.places import Place, place_of
from pnfarm.table.axis_codes import FAULT_SLOTS, NUMBER_MASK
from pnfarm.table.image import IMAGE, LOST_CLOSED, LOST_EXPIRED, LOST_NEVER, LOST_NOT, LOST_STOP
from pnfarm.table.signals import ACTUAL_SLOTS, PKW_HEAD, PKW_VALUE, SETPOINT_SLOTS
from pnfarm.table.trace import SOURCE_IMAGE_AGE, SOURCE_IMAGE_INTEGER
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from pnfarm.drives.telegrams.telegram import Signal
    from pnfarm.station.axis import Axis

__all__ = ["OF_IMAGE", "TraceSignal", "choose_signals", "chooses_any", "code_of", "is_glob", "label_of", "signals_of"]

#: Bits of :data:`pnfarm.station.signals.SIGNALS` that a field has.
_BITS = ("in_operation", "homed", "task_active", "target_reached")
_STATES = {0: "boot", **{number: f"S{number}" for number in range(1, 6)}}
_CONNECTION = {
    LOST_NOT: "exchanging",
    LOST_NEVER: "never",
    LOST_EXPIRED: "expired",
    LOST_STOP: "stop",
    LOST_CLOSED: "closed",
}
#: What a value of a signal of this ``form`` is called; numbers of faults are named as their manual does.
_LABELS: Mapping[str, Mapping[int, str]] = {"state": _STATES, "connection": _CONNECTION}
_NS = 1e-9
#: Signals that the profile and the manuals define as signed numbers, where no parameter of the model says so.
_SIGNED = frozenset(
    {
        "NSOLL_A", "NSOLL_B", "NIST_A", "NIST_B", "ITIST_GLATT", "XERR", "XSOLL_A", "XIST_A", "XIST_ERROR", "TARPOS_A",
        "MDI_TARPOS", "HOME_DIST", "REF_SPEED", "ACT_SPEED", "REF_TORQUE", "ACT_TORQUE", "IL_CMD_FIELDBUS",
        "JOG_SPEED_1", "JOG_SPEED_2",
    }
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class TraceSignal:
    """One signal of a drive or a device.

    ``unit`` is empty for words, codes and counts.  ``bit`` selects a bit of the word at ``place``.  ``form``: ``real``,
    ``word``, ``bit``, or a code: ``state``, ``connection``, ``fault``.
    """

    name: str
    unit: str
    doc: str
    place: Place
    form: str = "real"
    bit: int | None = None
    #: Further names under which it is found.
    aliases: tuple[str, ...] = field(default=())

    @property
    def is_real(self) -> bool:
        """Whether it is a quantity, not a word, a bit or a code."""
        return self.form == "real"

    def as_dict(self) -> dict[str, str]:
        """For JSON."""
        return {"signal": self.name, "unit": self.unit, "form": self.form, "doc": self.doc}


def label_of(form: str, value: int) -> str | None:
    """The name of a code: ``S4``, ``closed``, ``702``, ``32-1``; None for a form without names."""
    if form == "fault":
        return fault_label(value)
    names = _LABELS.get(form)
    return None if names is None else names.get(value, str(value))


def code_of(form: str, text: str) -> int | None:
    """The code of a name (:func:`label_of`), in any case; None if there is none."""
    return next((code for code, name in _LABELS.get(form, {}).items() if name.lower() == text.lower()), None)


def _image(key: str, *, scale: float = 1.0, source: int = SOURCE_IMAGE_INTEGER) -> Place:
    return place_of(IMAGE, key, source=source, scale=scale)


def _of_axis(
    name: str, unit: str, doc: str, field: str, form: str = "real", aliases: tuple[str, ...] = (), **place: Any
) -> TraceSignal:
    return TraceSignal(name, unit, doc, place_of(AXIS, field, **place), form, aliases=aliases)


def _fault_signals() -> Iterator[TraceSignal]:
    for slot in range(FAULT_SLOTS):
        name, doc = (f"fault_{slot + 1}", f"active fault number {slot + 1}, 0 = none") if slot else (
            "fault",
            "oldest active fault, by the manual's number; 0 = none",
        )  # fmt: skip
        yield _of_axis(name, "", doc, "faults.code", "fault", element=slot, mask=NUMBER_MASK)


#: Those of the process image, which a device has as well.
OF_IMAGE: Mapping[str, TraceSignal] = {
    signal.name: signal
    for signal in (
        TraceSignal("connected", "", "1 while a controller in RUN sends valid set points", _image("valid"), "bit"),
        TraceSignal(
            "connection", "", "why there are no valid set points, or that there are", _image("lost"), "connection"
        ),
        TraceSignal(
            "frame_age",
            "s",
            "time since the last frame with set points; -1 before the first",
            _image("frame_ns", scale=_NS, source=SOURCE_IMAGE_AGE),
        ),
        TraceSignal(
            "frame_interval",
            "s",
            "time between the last two of them, 0 after the first",
            _image("interval_ns", scale=_NS),
        ),
        TraceSignal("injected", "", "number of injected faults in force", _image("injected"), "word"),
    )
}
#: Signals of every drive.
_ALWAYS: tuple[TraceSignal, ...] = (
    _of_axis("setpoint", "rpm", "velocity that the controller requests", "ramp.setpoint", aliases=("set_velocity",)),
    _of_axis("command", "rpm", "velocity command after the ramp", "ramp.command"),
    _of_axis("velocity", "rpm", "actual velocity of the shaft", "motor.velocity", aliases=("actual_velocity",)),
    _of_axis(
        "position", "revolutions", "actual position, from the home position on", "motor.position", less="homing.origin"
    ),
    _of_axis(
        "following_error",
        "revolutions",
        "commanded minus actual position, in position mode",
        "positioning.following_error",
    ),
    _of_axis("current", "A", "torque-building current", "motor.current"),
    _of_axis("torque", "N m", "torque of the motor", "motor.torque"),
    _of_axis("bus_voltage", "V", "voltage of the DC bus", "supply.voltage"),
    _of_axis("thermal_load", "", "thermal load of the motor, 1 = its limit", "motor.thermal_load"),
    _of_axis("state", "", "state of the drive, S1 to S5 as 1 to 5, 0 while it boots", "drive.state", "state"),
    _of_axis("powered", "", "1 while the control supply is on", "powered", "bit"),
    *_fault_signals(),
    _of_axis("warning", "", "active warning, by the manual's number; 0 = none", "warnings.code", "fault"),
    *OF_IMAGE.values(),
)


def signals_of(station: Axis) -> dict[str, TraceSignal]:
    """Every signal of a drive by its name, with the telegram that is in force now."""
    found = {signal.name: signal for signal in _ALWAYS}
    for name in _BITS:
        place = SIGNALS[name].place(station)
        assert place is not None
        found[name] = TraceSignal(name, "", SIGNALS[name].doc, place, "bit")
    words = {
        name.upper(): TraceSignal(name, "", word.doc, word.place(), "word")
        for name, word in profile_words(station.model).items()
    }
    for signal in _mapped(station):
        name = signal.name.lower()
        if signal.name == "STW1":
            words["STW1_RECEIVED"] = _word(station, signal, "stw1_received", "control word 1 as received")
        elif signal.name not in words and name not in found:
            doc = "set point of the telegram" if signal.setpoint else "actual value of the telegram"
            words[signal.name] = _word(station, signal, name, f"{doc}, {signal.bits} bits as on the wire")
    for word, traced in words.items():
        found[traced.name] = traced
        for bit in _bits(station, word, traced):
            found[bit.name] = bit
    return found


def _mapped(station: Axis) -> list[Signal]:
    """The signals of the telegram, both directions, each once, without the parameter channel."""
    every = (*station.store.mapping(setpoint=True), *station.store.mapping(setpoint=False))
    unique = {signal.name: signal for signal in every if signal is not None}
    return [signal for signal in unique.values() if signal.slot not in {PKW_HEAD, PKW_VALUE}]


def _word(station: Axis, signal: Signal, name: str, doc: str) -> TraceSignal:
    slots = SETPOINT_SLOTS if signal.setpoint else ACTUAL_SLOTS
    place = place_of(
        IMAGE,
        "received" if signal.setpoint else "sent",
        source=SOURCE_IMAGE_INTEGER,
        element=slots[signal.name],
        mask=(1 << signal.bits) - 1,
        signed=_is_signed(station, signal),
    )
    return TraceSignal(name, "", doc, place, "word")


def _is_signed(station: Axis, signal: Signal) -> bool:
    """Whether the signal is a signed number: its own row says so, a parameter of its name, or the profile."""
    if signal.signed or signal.name.removesuffix("_BACK") in _SIGNED:
        return True
    names = station.model.parameter_names
    pnu = names.get(signal.name.upper(), names.get(signal.drive_signal.upper()) if signal.drive_signal else None)
    known = station.model.parameters.get(pnu) if pnu is not None else None
    return known is not None and known.signed


def _bits(station: Axis, word: str, traced: TraceSignal) -> Iterator[TraceSignal]:
    """The bits of a word: of those that the manual names bits of, and of all control and status words."""
    known = word.removesuffix("_RECEIVED")
    own = profile_words(station.model).get(known.lower())
    names = station.model.profidrive.bit_names(known, station.store.telegram_number) or (own.names if own else ())
    if own is None and not names and not re.search("STW|ZSW", known):
        return
    if word == "STW1_RECEIVED":
        names = names or STW1_BITS
    used: set[str] = set()
    for bit in range(own.bits if own else 16):
        name = names[bit] if bit < len(names) and names[bit] and names[bit] not in used else f"bit_{bit}"
        used.add(name)
        aliases = (f"{traced.name}.{bit}", *((f"{traced.name}.bit_{bit}",) if name != f"bit_{bit}" else ()))
        doc = f"bit {bit} of {traced.name}"
        yield TraceSignal(f"{traced.name}.{name}", "", doc, traced.place, "bit", bit, aliases)


def is_glob(name: str) -> bool:
    """Whether it may choose several signals."""
    return re.search(r"[*?\[]", name) is not None


def chooses_any(known: Mapping[str, TraceSignal], name: str) -> bool:
    """Whether a name or a glob chooses any of the signals."""
    return bool(_chosen(known, name.strip()))


def choose_signals(owner: str, known: Mapping[str, TraceSignal], wanted: Iterable[str]) -> list[TraceSignal]:
    """Those of ``owner`` that names and globs (``zsw1.*``) choose, in their order, each once.

    Raises :class:`ConfigError` for one that it does not have, with what it has.
    """
    chosen: dict[str, TraceSignal] = {}
    for text in wanted:
        found = _chosen(known, text.strip())
        if not found:
            every = [*known, *(alias for signal in known.values() for alias in signal.aliases)]
            raise ConfigError(
                f"{owner} has no signal {shown(text)}{did_you_mean(text.strip().lower(), every)}; "
                f"allowed are {_allowed(known)}"
            )
        chosen |= {signal.name: signal for signal in found}
    return list(chosen.values())


def _chosen(known: Mapping[str, TraceSignal], text: str) -> list[TraceSignal]:
    """What a name or a glob chooses, as it is written, else in small letters."""
    for name in dict.fromkeys((text, text.lower())):
        if is_glob(name):
            found = [signal for signal in known.values() if fnmatchcase(signal.name, name)]
        else:
            found = [known[name]] if name in known else [one for one in known.values() if name in one.aliases]
        if found:
            return found
    return []


def _allowed(known: Mapping[str, TraceSignal]) -> str:
    """The names, with the bits of a word as ``zsw1.*``."""
    words = {name.partition(".")[0] for name in known if "." in name}
    return ", ".join(f"{name} and {name}.*" if name in words else name for name in known if "." not in name)
