"""Why frames and PDUs are dropped, in words: every reason that a machine counts.

A reason is a short slug, stable enough for a metric's label; this module has its meaning.  Reasons that machines build
at run time are a prefix (``arp-short``) or an event in a state (``response-in-idle``).
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["PREFIXES", "REASONS", "discard_text"]

#: Reason -> what happened.
REASONS: Mapping[str, str] = MappingProxyType(
    {
        # any format
        "short": "ends before its format does",
        "trailing": "octets after its end",
        "bad-length": "lengths inside contradict each other",
        "bad-type": "of an unexpected type",
        "bad-version": "of an unknown version",
        "bad-checksum": "checksum wrong",
        "bad-count": "another number of entries than announced",
        "bad-drep": "number format of the call is unknown",
        "bad-format": "parameter format is unknown",
        "bad-layout": "impossible frame layout",
        "bad-offset": "array does not begin at 0",
        "bad-padding": "padding is not zero",
        "bad-tower": "address in the endpoint mapper's tower is wrong",
        "foreign": "answers another request",
        "unsupported": "requests what the endpoint mapper does not have",
        # cyclic frames
        "wrong-length": "cyclic frame of another length than agreed at Connect",
        "wrong-source": "cyclic frame from another station than the controller",
        "old-counter": "cyclic frame whose cycle counter does not advance: late or repeated",
        "data-invalid": "cyclic frame whose data status says that its data are invalid",
        "unknown-frame-id": "real-time frame that belongs to none of the drive's connections",
        "transfer-status": "cyclic frame whose transfer status is not 0",
        "impaired": "cyclic frame kept back by an injected fault",
        # acyclic frames, before any machine
        "other-destination": "addressed to another station",
        "arp-for-another": "ARP request for another address",
        "identify-for-another": "DCP Identify for another station",
        "other-protocol": "of a protocol that a drive does not support",
        "connect-flood": "call of a station that requested a connection too often within a second",
        # DCP
        "silent": "DCP silenced by an injected fault",
        "not-a-request": "DCP response, which a drive does not expect",
        "hello": "DCP Hello of another station",
        "wrong-frame-id": "DCP service under another service's frame id",
        "held-by-other-client": "DCP Set while another client holds the transaction",
        "filter": "DCP Identify with a filter that is not understood",
        "superseded": "DCP Identify whose station asked again before its answer was due",
        "response-full": "DCP answer had no room for this block",
        "request": "DCP request, which a client does not expect",
        "unknown-xid": "DCP answer without a request",
        "duplicate": "DCP answer that came twice",
        "unasked-get": "DCP answer of a station that was not asked",
        # IP
        "no-address": "IP packet while the drive has no address",
        "other-address": "IP packet for another address",
        "bad-source": "sender's MAC address is a group's",
        "arp-bad-sender": "ARP packet whose sender is a group or broadcast address",
        "ipv4-bad-source": "IP packet from a group or broadcast address",
        "ipv4-protocol": "IP packet that is neither UDP nor ICMP",
        "closed-port": "UDP datagram for a port that is not open",
        "udp-bad-checksum": "UDP datagram with a wrong checksum",
        "icmp-other": "ICMP message other than an echo request",
        "no-route": "no route to the destination: no gateway",
        "unresolved": "no station answered the ARP request for the destination",
        "address-changed": "the drive's address changed before it could be sent",
        "queue-full": "too many packets are waiting already",
        "fragment-bad-length": "IP fragment with an impossible length",
        "fragment-displaced": "IP fragments given up for newer ones",
        "fragment-overlap": "IP fragments that overlap",
        "fragment-timeout": "IP fragments whose rest did not arrive",
        # calls
        "maybe-or-broadcast": "call without an answer, which PROFINET does not have",
        "unexpected-type": "PDU that this end of a call does not receive",
        "old-sequence": "call older than one that was answered",
        "late-answer": "answer that came after the call was given up",
        "held-octets": "call refused: too many octets are held already",
        "fragments-differ": "fragment that contradicts an earlier one",
        "duplicate-fragment": "fragment that came twice",
        "fragment-number": "fragment with an impossible number",
        "too-long": "longer than it may be",
        "request-too-long": "call given up: it has too many fragments",
        "stale-fack": "acknowledges fragments that were not sent",
        "calls-max": "call given up: too many are waiting already",
        "evicted": "call given up before its end: newer ones needed its place",
        "expired-receiving": "call given up: the rest of its fragments did not arrive",
        "expired-executing": "call given up: the drive had no answer for too long",
        "expired-replying": "answer given up: its client did not take all fragments",
        "late-call-result": "result of a call that was given up",
        "unknown-activity": "answer to no call of ours",
        "stale-sequence": "answer to an earlier call",
        "call-is-over": "answer to a call that has ended",
        # connections
        "rta-unknown-reference": "alarm or abort for a connection that does not exist",
        "rta-of-another-ar": "alarm or abort of another connection",
        "rta-of-another-station": "alarm or abort from another station",
        "alarm-of-nobody": "alarm from a station without a connection",
        "ready-out-of-turn": "ApplicationReady before the parameters ended",
        "plug-before-data": "a submodule plugged before data are exchanged: the start-up parametrises it",
        "answer-of-a-void-round": "answer about the parameters of a submodule that was pulled again",
        "ready-twice": "ApplicationReady that came twice",
        "farewell-unconfirmed": "Release that was not answered",
        "out-of-turn": "arrived when it was not expected",
        # alarms
        "closed": "the alarm channel is closed",
        "late-ack": "acknowledges what is not outstanding",
        "length": "of the wrong length for its type",
        "nack": "the other end did not accept it; it is repeated",
        "no-tack": "data that require no acknowledgement",
        "peer-counts-once": "the other end counts both priorities together: all alarms use one",
        "reference": "alarm references of another connection",
        "sequence": "out of sequence",
        "type": "of a type that alarm frames do not have",
        "version": "of another version",
        "withheld": "kept back by an injected fault",
        # telegrams of PROFIBUS
        "no-delimiter": "begins with an octet that begins no telegram",
        "bad-fcs": "telegram whose frame check sequence is wrong",
        "garbage": "octets of a line that belong to no telegram",
        "locked": "parameters from another master than the one that locked the slave",
        "wrong-ident": "parameters for a slave with another ident number",
        "no-end": "telegram that does not end with 0x16",
        "no-gsd": "file that is no GSD file",
        "no-ident": "GSD file without ident number",
        "no-slave": "GSD file of no slave",
        "no-module": "module that the GSD file does not have",
        "too-many": "more modules than the station has slots",
        "unknown-function": "telegram whose function a slave does not have",
        "busy": "request of DP-V1 while an earlier one waits for its answer",
        "no-connection": "request of DP-V1 for a connection that does not exist",
        "no-connection-free": "initiation of a DP-V1 connection when all are in use",
        # LLDP
        "aged-out": "no more frames from the neighbour",
        "bad-order": "parts in another order than prescribed",
        "link-down": "the link went down",
        "own-frame": "the drive's own LLDP frame",
        "own-lldp": "LLDP frame of another drive of the farm",
        "shutdown": "the neighbour announced its shutdown",
        "too-many-neighbours": "more neighbours than a port keeps",
        # SNMP
        "address-refused": "from an address that no station can have",
        "bad-community": "SNMP message with a wrong community",
        "bad-tag": "value of another type than prescribed",
        "bad-value": "value out of its type's range",
        "source-port-0": "datagram from port 0, which cannot be answered",
        "too-deep": "nested too deeply",
        "too-large": "larger than it may be",
        "unexpected-pdu": "SNMP message that a manager never sends",
        # calls, and files for engineering tools
        "rerun-fragment": "fragment of a call that was answered already",
        "doctype": "XML with a document type",
        "encoding": "XML of an encoding that is not read",
        "missing-element": "XML without an element that must be there",
        "not-xml": "not XML",
        "bad-entry": "entry of an EDS file that cannot be read",
        "bad-section": "section of an EDS file that cannot be read",
        "bad-text": "text of an EDS file that cannot be read",
        # EtherNet/IP
        "bad-segment": "path with a segment that cannot be read or leads elsewhere",
        "connection": "message of a class 3 connection that is not open",
        "delayed": "ListIdentity while too many answers wait already",
        "held-answers": "TCP connection closed: its peer sent requests without waiting for answers",
        "inactivity": "TCP connection closed: no whole message for the inactivity timeout",
        "long": "message longer than a drive holds",
        "options": "encapsulation message with options other than 0",
        "replies": "TCP connection closed: more answers to one input than are held",
        "status": "encapsulation request with a status other than 0",
        "streams": "TCP connection closed: as many as a drive has are open",
        # streams and datagrams
        "address-stays": "an address could not be taken away with the supply",
        "slow-reader": "stream closed: its peer does not read what it asked for",
        "unanswered": "stream closed: its peer did not acknowledge what was sent",
        "stream-closed": "octets for a stream that is closed",
        "stream-refused": "stream refused: as many as are allowed are open",
        "unasked-datagram": "datagram to no request",
        "unasked-frame": "frame to no request",
        "unasked-stream": "octets of a stream that is given up",
        # links
        "cable-pulled": "the cable is pulled",
        "interface-down": "the interface is down",
        "no-lease": "not sent: the lease of these drives is not held",
        "address-not-renewed": "address that the kernel did not keep for longer: its interface is down",
        "other-vlan": "frame of another VLAN",
        "receive-overflow": "the kernel's receive queue was full",
        "refused": "the kernel refused to send it",
        "unknown-port": "for a port that the link does not have",
    }
)

#: Beginning of a reason -> what it is about; a reason of a format, or a name, follows.
PREFIXES: Mapping[str, str] = MappingProxyType(
    {
        "accept-": "stream could not be accepted: ",
        "connect-": "stream could not be opened: ",
        "arp-": "ARP packet: ",
        "datagram-": "datagram could not be passed on: ",
        "group-": "multicast group could not be joined: ",
        "ipv4-": "IP packet: ",
        "udp-": "UDP datagram: ",
        "icmp-": "ICMP message: ",
        "rta-": "alarm or abort: ",
        "alarm-out-of-turn-": "unexpected alarm PDU: ",
        "alarm-": "alarm: ",
        "out-of-turn-": "unexpected alarm PDU: ",
        "cancel-": "cancellation of a call: ",
        "args-": "arguments of a call: ",
        "fack-": "acknowledgement of fragments: ",
        "status-": "status of a refused call: ",
        "reject-": "call rejected: ",
        "expired-": "call given up after too long, in state ",
        "no-call-for-": "belongs to no call: ",
    }
)
_IN_STATE = "-in-"


def discard_text(reason: str) -> str:
    """The meaning of a reason; for an unknown one, its slug as words."""
    known = REASONS.get(reason)
    if known is not None:
        return known
    event, between, state = reason.partition(_IN_STATE)
    if between:
        return f"{event.replace('-', ' ')} arrived in state {state.upper()}"
    for prefix, about in PREFIXES.items():
        if reason.startswith(prefix):
            rest = reason.removeprefix(prefix)
            return about + REASONS.get(rest, rest.replace("-", " ").replace("_", " "))
    return reason.replace("-", " ")
