"""Kinds of faults on modules, and on how late acyclic answers come."""

from __future__ import annotations

from typing import Any

from pnfarm.faults.kind import FaultKind, ParamSpec

__all__ = ["MODULE_KINDS", "SLOT", "SUBSLOT"]

_WORD: dict[str, Any] = {"low": 0, "high": 0xFFFF}
_LONG: dict[str, Any] = {"low": 1, "high": 0xFFFF_FFFF}
_EACH = frozenset({"probability", "seed", "count", "for"})
_HELD = frozenset({"for", "cycles"})

SLOT = ParamSpec("whole number", "The slot; left out, the telegram's.", **_WORD)
SUBSLOT = ParamSpec("whole number", "The subslot; left out, the one that carries the set points.", **_WORD)
_ONE_SUBSLOT = ParamSpec("whole number", "One submodule; left out, the whole module.", **_WORD)
_DELAY = ParamSpec("duration", "How late, at least.", default="500ms")
_JITTER = ParamSpec("duration", "Up to so much later still, at random.", default="0ms")

MODULE_KINDS = (
    FaultKind(
        "module-missing",
        "connection",
        "A module, or one submodule of it, is not there.  A controller that is connected gets a pull alarm and BAD "
        "data, one that connects finds it in the ModuleDiffBlock.  A plug alarm tells of its return.",
        "pulling the module",
        "module",
        {"slot": SLOT, "subslot": _ONE_SUBSLOT},
        takes=_HELD,
        preset={"missing": True},
    ),
    FaultKind(
        "module-wrong",
        "connection",
        "Another module, or submodule, stands in the slot than the controller expects.  One that is connected gets "
        "the alarm 'wrong submodule plugged' and BAD data, one that connects finds it in the ModuleDiffBlock.",
        "plugging the wrong module",
        "module",
        {
            "slot": SLOT,
            "subslot": _ONE_SUBSLOT,
            "telegram": ParamSpec("whole number", "The module of this telegram of the model.", **_WORD),
            "ident": ParamSpec(
                "whole number",
                "A module ident, with `subslot` a submodule ident; left out, one that the drive does not have.",
                **_LONG,
            ),
            "substitute": ParamSpec(
                "yes or no", "It works in the place of what the controller expects.", default=False
            ),
        },
        takes=_HELD,
        preset={"missing": False},
    ),
    FaultKind(
        "watchdog-expire",
        "connection",
        "The drive behaves as if its data hold timer had run out, although the controller's frames come: the "
        "connection ends (ERR-RTA-PDU), and the drive takes its fault for that.",
        "one broken connection; without `count` and `for` it happens once",
        "watchdog-expire",
        takes=_EACH,
    ),
    FaultKind(
        "rpc-delay",
        "connection",
        "What the drive sends over UDP for connections, parameters and control (RPC) leaves late, in order.",
        "a datagram that is late",
        "rpc-delay",
        {"delay": _DELAY, "jitter": _JITTER},
        takes=_EACH,
    ),
    FaultKind(
        "record-delay",
        "records",
        "The drive takes long over a Read or Write; when it is asked again meanwhile, it says that it works on it.",
        "an answer that is late",
        "record-delay",
        {"delay": _DELAY, "jitter": _JITTER},
        takes=_EACH,
    ),
)
