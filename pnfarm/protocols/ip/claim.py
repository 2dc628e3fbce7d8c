"""Address conflict detection: the state of one address claim (RFC 5227, as far as a PROFINET device can wait for it).

A controller connects milliseconds after it set an address, so the address is used at once; only its announcement
waits until an ARP probe has stayed unanswered for a second.  States:

===========  =======  =====================================================================================
state        in use
===========  =======  =====================================================================================
NONE         no       no address
PROBING      yes      probed, not announced
BOUND        yes      announced
CONTESTED    yes      another station uses it as well; it is defended, because connections depend on it
RECHECKING   yes      no conflict for a while: probed whether the other station is gone
REFUSED      no       another station had it first
REPROBING    no       probed whether the other station is gone
===========  =======  =====================================================================================
"""

from __future__ import annotations

from enum import StrEnum, auto
from typing import TYPE_CHECKING
from zlib import crc32

from pnfarm.protocols.named import Named

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = ["RECHECK_NS", "SPREAD_NS", "TRANSITIONS", "WAIT_NS", "AddressClaim", "ClaimSign", "ClaimState"]

#: Time to wait for an answer to the probe (RFC 5227, 1.1: ANNOUNCE_WAIT is two such seconds).
WAIT_NS = 10**9
#: Time without a conflicting packet after which the address is probed again.
RECHECK_NS = 10 * 10**9
#: Two hosts that lost the same address to each other must not probe again at the same time for ever: each probe is
#: delayed by up to this much, by a different part of it each time.
SPREAD_NS = 3 * 10**9
_SPREAD_STEP_NS = 10**6


class ClaimState(StrEnum):
    NONE = "NONE"
    PROBING = "PROBING"
    BOUND = "BOUND"
    CONTESTED = "CONTESTED"
    RECHECKING = "RECHECKING"
    REFUSED = "REFUSED"
    REPROBING = "REPROBING"


class ClaimSign(Named):
    """Inputs of the claim's state machine."""

    CLAIM = auto()  # the address was set: probe first
    CONFIGURE = auto()  # the address was already the device's own, as at power-on
    GIVE_UP = auto()
    OBJECTION = auto()  # another station uses the address, or probes for it at the same time
    QUIET = auto()  # the time is over without a conflict


_S, _E = ClaimState, ClaimSign

#: (state, sign) -> (next state, what the host does).
TRANSITIONS: dict[tuple[ClaimState, ClaimSign], tuple[ClaimState, str]] = {
    **{(state, _E.CLAIM): (_S.PROBING, "ask") for state in _S},
    **{(state, _E.CONFIGURE): (_S.BOUND, "announce") for state in _S},
    **{(state, _E.GIVE_UP): (_S.NONE, "") for state in _S},
    (_S.PROBING, _E.OBJECTION): (_S.REFUSED, "refuse"),
    (_S.PROBING, _E.QUIET): (_S.BOUND, "announce"),
    (_S.BOUND, _E.OBJECTION): (_S.CONTESTED, "defend"),
    (_S.CONTESTED, _E.OBJECTION): (_S.CONTESTED, "defend"),
    (_S.CONTESTED, _E.QUIET): (_S.RECHECKING, "ask"),
    (_S.RECHECKING, _E.OBJECTION): (_S.CONTESTED, "defend"),
    (_S.RECHECKING, _E.QUIET): (_S.BOUND, "settle"),
    (_S.REFUSED, _E.QUIET): (_S.REPROBING, "ask"),
    (_S.REPROBING, _E.OBJECTION): (_S.REFUSED, ""),
    (_S.REPROBING, _E.QUIET): (_S.BOUND, "take"),
}

_WAITS = {
    _S.PROBING: WAIT_NS,
    _S.RECHECKING: WAIT_NS,
    _S.REPROBING: WAIT_NS,
    _S.CONTESTED: RECHECK_NS,
    _S.REFUSED: RECHECK_NS,
}


class AddressClaim:
    """The claim of one host; ``mac`` makes its delays differ from those of other hosts."""

    def __init__(self, mac: bytes) -> None:
        self.state = ClaimState.NONE
        self.ip: IPv4Address | None = None
        self.deadline: int | None = None
        self._mac = mac
        self._rechecks = 0

    def sign(self, sign: ClaimSign, now: int) -> str:
        """The only writer of the state; returns the host's action, or "" for none."""
        row = TRANSITIONS.get((self.state, sign))
        if row is None:
            return ""
        self.state, action = row
        wait = _WAITS.get(self.state)
        if wait is None:
            self.deadline = None
        else:
            self.deadline = now + wait + (self._spread() if wait == RECHECK_NS else 0)
        return action

    def _spread(self) -> int:
        """A pseudo-random time, the same in every run: derived from MAC address and count."""
        self._rechecks += 1
        drawn = crc32(self._mac + self._rechecks.to_bytes(8, "big"))
        return drawn * _SPREAD_STEP_NS % SPREAD_NS
