"""Kinds of injections that drives on any bus can have, as they are on EtherNet/IP; and those that it has not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.faults.kind import WORD, KindOnBus, ParamSpec, words_of
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ON_ETHERNETIP"]

_TITLE: Final = "EtherNet/IP"
#: General status that refuses something.
_STATUS: Final = {word: number for word, number in words_of(GeneralStatus).items() if number}
_LOST: Final = (
    "Logix: module fault 16#0203, connection timed out. CODESYS: the adapter goes to its error state (assumed)."
)
_TCP: Final = (
    "Lost data of TCP come 200 ms later, when TCP repeats them, and later still if they are lost again; meanwhile TCP "
    "connections can be opened, and the kernel answers ARP and ping"
)


def _on(wire: str, reports: str, params: Mapping[str, ParamSpec] | None = None) -> KindOnBus:
    return KindOnBus(_TITLE, params or {}, wire=wire, reports=reports)


def _no(why: str) -> KindOnBus:
    return KindOnBus(_TITLE, refused=why)


_FRAMES: Final = {
    "loss": _on(
        f"Cyclic packets are missing, with gaps in the sequence number. {_TCP}.",
        f"Cyclic packets: nothing below the timeout; then: {_LOST}",
    ),
    "delay": _on(
        "Cyclic packets are later by `delay` to `delay` + `jitter`, with the sequence that they had. Messages on TCP "
        "stay in order, whatever `overtake` says.",
        f"A constant delay: only the gap at its start. Gaps above the timeout: {_LOST} Overtaken packets are dropped.",
    ),
    "duplicate": _on(
        "A cyclic packet comes again, with the same sequence number; datagrams, too, streams never.",
        "Nothing: a packet whose number is not ahead of the last one's is dropped (assumed).",
    ),
    "reorder": _on(
        "Cyclic packets with an older sequence number after newer ones; datagrams, too, streams never.",
        "A packet that was overtaken is dropped for its sequence number: as one that is lost.",
    ),
    "corrupt": _on(
        "Inverted bits in a packet whose UDP checksum is as before, so that its receiver drops it: it sees a lost "
        "packet. With `mend` the checksums of IPv4 and UDP are right again, and it sees wrong data, or a packet for "
        "no receiver. In messages on TCP and in datagrams of port 44818 all checksums fit the inverted bits: the other "
        "end sees them as data; so does the drive, for cyclic packets that it gets with `mend`.",
        f"Without `mend`: as loss. With it: wrong input data, which no check finds. {_LOST}",
    ),
    "throttle": _on(
        "Packets are no closer than the rate permits; when they are more than that, cyclic ones are missing. Messages "
        "on TCP wait as long as they must.",
        f"A drive whose packets need more than the rate: {_LOST}",
    ),
    "silence": _on(f"No cyclic packet and no message of the drive. {_TCP}.", f"After the timeout: {_LOST}"),
    "timeout": _on(
        f"No cyclic packet of the drive for a little more than the originator's timeout. {_TCP}.",
        f"Once: {_LOST} The connection is opened again.",
    ),
    "link-down": _on(
        "No carrier at the drive's port: no frame in either direction. TCP connections live on as long as TCP repeats.",
        f"Port down at the switch; after the timeout: {_LOST}",
    ),
    "link-flap": _on(
        "No carrier, repeatedly.",
        f"After each timeout: {_LOST} Then the connection is opened again.",
    ),
    "mac-change": _on(
        "The frames end without notice; after the boot, ARP and cyclic packets come from the other MAC address, "
        "with the same IP address.",
        f"After the timeout: {_LOST} The drive is found by its IP address once the old ARP entry is gone (assumed).",
    ),
    "drop-cycles": _on(
        "A gap of that many packets, and in the sequence.",
        f"Fewer than the timeout multiplier: nothing. From it on: {_LOST}",
    ),
    "late-frames": _on(
        "An interval longer by `by`; the late packet has the data of its own cycle.",
        f"Nothing below the timeout; beyond it: {_LOST}",
    ),
    "wrong-length": _on(
        "A data item longer by `by` zero octets, or shorter by them; its length and those of UDP and IPv4 are right.",
        f"The packets are dropped: {_LOST}",
    ),
}

_CONNECTION: Final = {
    "ar-abort": _on(
        "The drive ends the connection: its cyclic packets end, and no message says so, because CIP has none for a "
        "target that ends one. The TCP connection stays.",
        f"After the timeout: {_LOST} The connection is opened again.",
    ),
    "connect-refuse": _on(
        "Answers to Forward_Open with the general status, and the extended status after it.",
        "Logix: module fault with the extended status (16#0113: out of connections), asking again and again. CODESYS: "
        "the adapter goes to its error state, with the status in its log (assumed).",
        {
            "status": ParamSpec(
                "whole number",
                "General status.",
                default="connection-failure",
                words=_STATUS,
                low=1,
                high=0xFF,
            ),
            "extended": ParamSpec(
                "whole number",
                "Extended status; left out, 0x0113 (out of connections) with general status 0x01, else none.",
                words=words_of(ConnectionStatus),
                **WORD,
            ),
        },
    ),
    "rpc-delay": _on(
        "Messages of the drive on TCP and UDP port 44818 are late, in order on each TCP connection.",
        "A slower start-up; MSG instructions take longer, or end by their time-out.",
    ),
    "rpc-silence": _on(
        "Whole messages of port 44818 are lost in the given direction: the drive acknowledges octets on TCP, and "
        "answers nothing.",
        "A running connection stays; MSG instructions end by their time-out, and a new connection is not made (Logix: "
        "module fault 16#0204, connection request timed out; CODESYS (assumed) the same).",
    ),
    "session-drop": _on(
        "A FIN of the drive on the TCP connection. Cyclic connections continue, those of class 3 end with it.",
        "Nothing for cyclic data: the session is set up again when it is needed. A MSG instruction on its way ends "
        "with an error (assumed).",
    ),
    "tcp-refuse": _on(
        "Each SYN to port 44818 is answered by RST; UDP is answered, ListIdentity finds the drive.",
        "A running connection stays. A new one: Logix: module fault 16#0204, connection request timed out; CODESYS: "
        "the adapter is not reached (assumed).",
    ),
    "watchdog-expire": _on(
        "The drive behaves as if the originator's packets had not come for the time of the timeout: its packets end, "
        "its TCP connection closes, and it raises F702.",
        f"{_LOST} The connection is opened again.",
    ),
    "record-error": _on(
        "Answers of the drive's objects with the general status, and the extended status if one is given. Without "
        "`class`: those of the Parameter object and both Position Controller objects. Lists of attributes are refused "
        "as a whole when `attribute` is left out, and not at all when it is given.",
        "Logix: the MSG instruction ends with the status in ERR and EXERR. CODESYS: the request ends with an error "
        "(assumed).",
        {
            "status": ParamSpec(
                "whole number", "General status.", default="device-state-conflict", words=_STATUS, low=1, high=0xFF
            ),
            "extended": ParamSpec("whole number", "Extended status; left out, none.", **WORD),
            "class": ParamSpec("whole number", "Only this class, any there is.", **WORD),
            "instance": ParamSpec("whole number", "Only this instance.", **WORD),
            "attribute": ParamSpec("whole number", "Only this attribute; with a class or an instance.", **WORD),
        },
    ),
    "record-delay": _on(
        "Answers of objects on TCP are late, and after them all that follows on the same TCP connection; answers to "
        "Forward_Open and Forward_Close are not.",
        "The bus reports nothing: MSG instructions take longer, or end by their time-out.",
    ),
}

_SHOWN: Final = "Status word 1 of the response assembly: General Fault (bit 3) is set"
_SEEN: Final = "The bus reports nothing: the program sees it in the response assembly."
_DRIVE: Final = {
    "drive-fault": _on(f"{_SHOWN}, Enabled (bit 7) falls if the fault's reaction disables the drive.", _SEEN),
    "f702": _on(f"As drive-fault: {_SHOWN}; the fault history has 702.", _SEEN),
    "drive-warning": _on(
        "Nothing: the response assembly has no bit for warnings; a parameter has the warning.",
        "The bus reports nothing: the program sees it in the parameter.",
    ),
    "fault-not-acknowledging": _on(f"{_SHOWN} and stays, whatever clears faults.", _SEEN),
    **{
        cause: _on(f"{_SHOWN}, Enabled (bit 7) falls.", _SEEN)
        for cause in ("undervoltage", "encoder-error", "following-error", "sto")
    },
    "limit-switch": _on("Status word 2: the bit of the limit; the velocity falls to 0.", _SEEN),
    "load": _on("Actual position, velocity and torque change.", _SEEN),
    "stuck-axis": _on("The actual position does not change, the actual velocity is 0.", _SEEN),
    "slow-ramp": _on("The actual velocity changes more slowly; In Motion stays longer.", _SEEN),
    "not-ready": _on("Status word 1: Enabled (bit 7) falls, and no command sets it.", _SEEN),
    "digital-input": _on(
        "The input's bits in the attributes and parameters that have them.", "The bus reports nothing."
    ),
    "power-cycle": _on(
        "The packets end without notice, TCP gets no answer; later the drive starts as after power on.",
        f"After the timeout: {_LOST} The connection is opened again.",
    ),
}

_NO_STATUS: Final = "its packets have no header with such a status"
_NO_ALARM: Final = "EtherNet/IP has no alarms, a program polls what it wants to know"
_NO_LIFE: Final = (
    "its assemblies have no sign of life; sequence-freeze with `which: count` freezes its data while packets arrive"
)
_NO_MODULES: Final = "its drive has no modules in slots; identity-change makes keying fail"
_REFUSED: Final = {
    "duplicate-ip": _no(
        "its address belongs to this machine's network stack, which answers ARP and detects no conflict; a second "
        "station would change the machine's ARP table, not the drive"
    ),
    "duplicate-name": _no("drives are found by address, and a host name may be there twice"),
    "provider-stop": _no(
        f"{_NO_STATUS}: only the controller's packets have a run/idle header, and only a controller can be idle"
    ),
    "data-invalid": _no(_NO_STATUS),
    "iops-bad": _no("its packets have no provider status"),
    "iocs-bad": _no("its packets have no consumer status"),
    "cycle-counter-freeze": _no("its packets have no cycle counter; sequence-freeze freezes their sequence"),
    "cycle-counter-jump": _no("its packets have no cycle counter; sequence-jump makes their sequence jump"),
    "wrong-frame-id": _no("its packets have no frame id; wrong-connection-id changes what they have instead"),
    "sign-of-life-freeze": _no(_NO_LIFE),
    "sign-of-life-skip": _no(_NO_LIFE),
    "sign-of-life-loss": _no(_NO_LIFE),
    "no-application-ready": _no(
        "a connection is ready with the answer to Forward_Open; rpc-silence suppresses that answer"
    ),
    "late-application-ready": _no(
        "a connection is ready with the answer to Forward_Open, which forward-open-delay makes late"
    ),
    "dcp-silence": _no("it has no DCP: drives have their addresses, and ListIdentity asks by UDP; see rpc-silence"),
    "module-missing": _no(_NO_MODULES),
    "module-wrong": _no(_NO_MODULES),
    "parameter-busy": _no(
        "each request has one answer, and none is asked for twice; record-error with object-state-conflict refuses, "
        "record-delay makes answers late"
    ),
    "alarm-storm": _no(_NO_ALARM),
    "alarm-unacknowledged": _no(_NO_ALARM),
    "diagnosis": _no(f"{_NO_ALARM}; drive-fault shows in the status of the Identity object"),
}

ON_ETHERNETIP: Mapping[str, KindOnBus] = {**_FRAMES, **_CONNECTION, **_DRIVE, **_REFUSED}
