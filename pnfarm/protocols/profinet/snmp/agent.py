"""The SNMP agent of a drive: versions 1 and 2c, as PROFINET's conformance class B requires.

Theory: a manager sends a message to UDP port 161; its community gives its rights, its PDU the request.  The agent
holds nothing between two messages but its counters, so there is no state machine and no deadline:
:meth:`SnmpAgent.receive` answers at once, or drops the message silently, as the standard requires where it is
not for this agent.

The two versions differ in what goes wrong (RFC 3584, clause 4): version 1 has five errors and no Counter64; version 2c
reports a missing object as an exception in its place, and the rest of the answer is valid.  An answer that is too long
for one datagram is cut (GetBulk) or refused (all others, tooBig).

A Set is judged as a whole before anything changes.  What a manager wrote comes out as :class:`SystemTextSet`; who owns
the agent keeps the text and shows it in the next view.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.rpc.fragments import Datagram, Peer
from pnfarm.protocols.profinet.snmp.mib import TEXT_LIMIT, Mib, MibSnapshot
from pnfarm.protocols.profinet.snmp.mib_lldp import LLDP_SCALARS, LLDP_TABLES
from pnfarm.protocols.profinet.snmp.mib_system import INTERFACE_TABLES, SYSTEM_SCALARS, WRITABLE, Statistic
from pnfarm.protocols.profinet.wire.snmp.message import (
    COUNTER64,
    END_OF_MIB_VIEW,
    GET,
    GET_BULK,
    GET_NEXT,
    NO_SUCH_INSTANCE,
    NO_SUCH_OBJECT,
    OCTET_STRING,
    RESPONSE,
    SET,
    SNMP_PORT,
    VERSION_1,
    ErrorStatus,
    Oid,
    OtherPdu,
    Pdu,
    SnmpMessage,
    Value,
    VarBind,
    emit_response,
    emit_varbind,
    parse_snmp,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.protocols.profinet.snmp.view import SnmpView, SystemText

__all__ = ["MAXIMUM_MESSAGE", "PRIVATE", "PUBLIC", "SnmpAgent", "SystemTextSet"]

#: RFC 3417, 3.2: octets of the longest message that one Ethernet frame carries; longer ones are neither sent nor taken.
MAXIMUM_MESSAGE = 1472
#: The communities of a PROFINET device: to read, and to read and write.
PUBLIC = b"public"
PRIVATE = b"private"
#: What every station shows.
_SCALARS, _TABLES = (*SYSTEM_SCALARS, *LLDP_SCALARS), (*INTERFACE_TABLES, *LLDP_TABLES)

#: Octets around the list of variables, at most: three long headers, version, the community's header, three numbers.
_ENVELOPE = 3 * 4 + 3 + 4 + 3 * 6
#: The context tags of SNMPv1's trap and of version 2's inform and trap.
_TRAPS = frozenset({0xA4, 0xA6, 0xA7})

#: RFC 3584, 4.4: what version 1 says in place of an error of version 2; everything else is genErr.
_VERSION_1_ERRORS = {
    ErrorStatus.TOO_BIG: ErrorStatus.TOO_BIG,
    ErrorStatus.WRONG_VALUE: ErrorStatus.BAD_VALUE,
    ErrorStatus.WRONG_ENCODING: ErrorStatus.BAD_VALUE,
    ErrorStatus.WRONG_TYPE: ErrorStatus.BAD_VALUE,
    ErrorStatus.WRONG_LENGTH: ErrorStatus.BAD_VALUE,
    ErrorStatus.INCONSISTENT_VALUE: ErrorStatus.BAD_VALUE,
    ErrorStatus.NO_SUCH_NAME: ErrorStatus.NO_SUCH_NAME,
    ErrorStatus.NO_ACCESS: ErrorStatus.NO_SUCH_NAME,
    ErrorStatus.NOT_WRITABLE: ErrorStatus.NO_SUCH_NAME,
    ErrorStatus.NO_CREATION: ErrorStatus.NO_SUCH_NAME,
    ErrorStatus.INCONSISTENT_NAME: ErrorStatus.NO_SUCH_NAME,
    ErrorStatus.AUTHORIZATION_ERROR: ErrorStatus.NO_SUCH_NAME,
}
#: The counter of each error of version 1.
_OUT_ERRORS = {
    ErrorStatus.TOO_BIG: Statistic.OUT_TOO_BIGS,
    ErrorStatus.NO_SUCH_NAME: Statistic.OUT_NO_SUCH_NAMES,
    ErrorStatus.BAD_VALUE: Statistic.OUT_BAD_VALUES,
    ErrorStatus.GEN_ERR: Statistic.OUT_GEN_ERRS,
}


@dataclass(frozen=True, slots=True)
class SystemTextSet:
    """A manager wrote sysContact, sysName or sysLocation."""

    which: SystemText
    text: str


class SnmpAgent:
    """One agent.  ``view`` gives what it shows at a time; see the module's docstring.

    ``maximum_size`` bounds messages both ways.  ``dropped`` counts messages without an answer by reason: those of
    :class:`~pnfarm.errors.DecodeError`, ``too-long``, ``bad-community``, ``unexpected-pdu``, ``silent`` (even the error
    is too long).  ``statistics`` is the snmp group.
    """

    def __init__(
        self,
        view: Callable[[int], SnmpView],
        *,
        read_community: bytes = PUBLIC,
        write_community: bytes = PRIVATE,
        maximum_size: int = MAXIMUM_MESSAGE,
    ) -> None:
        self.dropped: Counter[str] = Counter()
        self.statistics: Counter[int] = Counter()
        self.mib = Mib(view, _SCALARS, _TABLES)
        self._writers = {read_community: False, write_community: True}
        self._maximum_size = maximum_size
        self._outbox: list[Datagram] = []
        self._events: list[SystemTextSet] = []
        #: Whether what is written can be kept.
        self.can_keep: Callable[[], bool] = lambda: True

    def receive(self, peer: Peer, data: bytes, now: int) -> None:
        """One datagram that came to :data:`SNMP_PORT`."""
        self.statistics[Statistic.IN_PKTS] += 1
        if len(data) > self._maximum_size:
            self.dropped["too-long"] += 1
            return
        try:
            message = parse_snmp(data)
        except DecodeError as exc:
            bad_version = exc.reason == "bad-version"
            self.statistics[Statistic.IN_BAD_VERSIONS if bad_version else Statistic.IN_ASN_PARSE_ERRS] += 1
            self.dropped[exc.reason] += 1
            return
        may_write = self._writers.get(message.community)
        if may_write is None:
            self.statistics[Statistic.IN_BAD_COMMUNITY_NAMES] += 1
            self.dropped["bad-community"] += 1
            return
        pdu = message.pdu
        if isinstance(pdu, OtherPdu) or pdu.tag == RESPONSE or (pdu.tag == GET_BULK and message.version == VERSION_1):
            if pdu.tag == RESPONSE:
                self.statistics[Statistic.IN_GET_RESPONSES] += 1
            elif pdu.tag in _TRAPS:
                self.statistics[Statistic.IN_TRAPS] += 1
            self.dropped["unexpected-pdu"] += 1
            return
        answer = self._answer(message, pdu, may_write, now)
        if len(answer) > self._maximum_size:
            self.statistics[Statistic.SILENT_DROPS] += 1
            self.dropped["silent"] += 1
            return
        self.statistics[Statistic.OUT_PKTS] += 1
        self.statistics[Statistic.OUT_GET_RESPONSES] += 1
        self._outbox.append(Datagram(SNMP_PORT, peer, answer))

    def to_send(self, now: int) -> list[Datagram]:
        """The answers since the last call."""
        del now
        datagrams, self._outbox = self._outbox, []
        return datagrams

    def events(self) -> list[SystemTextSet]:
        """What managers wrote since the last call."""
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        """Never: a message is answered when it comes."""
        return None

    def handle_timeout(self, now: int) -> None:
        """Nothing is ever due."""

    # -- answers -----------------------------------------------------------------------------------------------------

    def _answer(self, message: SnmpMessage, pdu: Pdu, may_write: bool, now: int) -> bytes:
        if pdu.tag == SET:
            return self._set(message, pdu, may_write)
        snapshot = self.mib.at(now, self.statistics)
        if pdu.tag == GET_BULK:
            return self._get_bulk(message, pdu, snapshot)
        return self._get(message, pdu, snapshot)

    def _get(self, message: SnmpMessage, pdu: Pdu, snapshot: MibSnapshot) -> bytes:
        """Get and GetNext (RFC 3416, 4.2.1 and 4.2.2; RFC 3584, 4.2.2.1 and 4.2.2.2 for version 1)."""
        self.statistics[Statistic.IN_GET_REQUESTS if pdu.tag == GET else Statistic.IN_GET_NEXTS] += 1
        version_1 = message.version == VERSION_1
        varbinds: list[bytes] = []
        room = self._maximum_size
        for index, asked in enumerate(pdu.varbinds, 1):
            if pdu.tag == GET_NEXT:
                found = _next(snapshot, asked.name, version_1)
            else:
                found = _exact(snapshot, asked.name, version_1)
            if version_1 and found.value.tag in {NO_SUCH_OBJECT, NO_SUCH_INSTANCE, END_OF_MIB_VIEW}:
                return self._refuse(message, pdu, ErrorStatus.NO_SUCH_NAME, index)
            varbinds.append(emit_varbind(found))
            room -= len(varbinds[-1])
            if room < 0:
                break
        answer = emit_response(message, replace(pdu, tag=RESPONSE, error_status=0, error_index=0), varbinds)
        if len(answer) > self._maximum_size:
            return self._refuse(message, pdu, ErrorStatus.TOO_BIG, 0)
        self.statistics[Statistic.IN_TOTAL_REQ_VARS] += len(varbinds)
        return answer

    def _get_bulk(self, message: SnmpMessage, pdu: Pdu, snapshot: MibSnapshot) -> bytes:
        """RFC 3416, 4.2.3: as many variables as fit."""
        self.statistics[Statistic.IN_GET_NEXTS] += 1  # it has no counter of its own
        single = min(max(pdu.non_repeaters, 0), len(pdu.varbinds))
        names = [asked.name for asked in pdu.varbinds[single:]]
        room = self._maximum_size - _ENVELOPE - len(message.community)
        varbinds: list[bytes] = []

        def fits(found: VarBind) -> bool:
            nonlocal room
            octets = emit_varbind(found)
            room -= len(octets)
            if room < 0:
                return False
            varbinds.append(octets)
            return True

        full = not all(fits(_next(snapshot, asked.name, version_1=False)) for asked in pdu.varbinds[:single])
        repetitions = max(pdu.max_repetitions, 0) if names and not full else 0
        while repetitions:
            repetitions -= 1
            ended = True
            for place, name in enumerate(names):
                found = _next(snapshot, name, version_1=False)
                if not fits(found):
                    repetitions = 0
                    break
                ended = ended and found.value.tag == END_OF_MIB_VIEW
                names[place] = found.name
            if ended:
                break
        self.statistics[Statistic.IN_TOTAL_REQ_VARS] += len(varbinds)
        return emit_response(message, Pdu(RESPONSE, pdu.request_id), varbinds)

    def _set(self, message: SnmpMessage, pdu: Pdu, may_write: bool) -> bytes:
        """All or nothing (RFC 3416, 4.2.5); the texts are independent, so nothing can fail once all are found good."""
        self.statistics[Statistic.IN_SET_REQUESTS] += 1
        if not may_write:
            self.statistics[Statistic.IN_BAD_COMMUNITY_USES] += 1
        for index, wanted in enumerate(pdu.varbinds, 1):
            error = _judge(wanted) if may_write else ErrorStatus.NO_ACCESS
            if error is not None:
                return self._refuse(message, pdu, error, index)
        if not self.can_keep():
            return self._refuse(message, pdu, ErrorStatus.COMMIT_FAILED, 1)
        for wanted in pdu.varbinds:
            text = wanted.value.content
            if isinstance(text, bytes):  # checked by _judge
                self._events.append(SystemTextSet(WRITABLE[wanted.name], text.decode("ascii")))
        self.statistics[Statistic.IN_TOTAL_SET_VARS] += len(pdu.varbinds)
        return self._response(message, pdu, ErrorStatus.NO_ERROR, 0)

    def _refuse(self, message: SnmpMessage, pdu: Pdu, error: ErrorStatus, index: int) -> bytes:
        """An error in the form of the manager's version."""
        if message.version == VERSION_1:
            error = _VERSION_1_ERRORS.get(error, ErrorStatus.GEN_ERR)
        elif error == ErrorStatus.TOO_BIG:
            pdu = replace(pdu, varbinds=())  # RFC 3416, 4.2.1
        counter = _OUT_ERRORS.get(error)
        if counter is not None:
            self.statistics[counter] += 1
        return self._response(message, pdu, error, index)

    @staticmethod
    def _response(message: SnmpMessage, pdu: Pdu, error: ErrorStatus, index: int) -> bytes:
        """The request with another tag, and the error; its variables are as they came."""
        response = Pdu(RESPONSE, pdu.request_id, error, index)
        return emit_response(message, response, [emit_varbind(varbind) for varbind in pdu.varbinds])


def _exact(snapshot: MibSnapshot, name: Oid, version_1: bool) -> VarBind:
    value = snapshot.get(name)
    if value is None or (version_1 and value.tag == COUNTER64):
        missing = NO_SUCH_INSTANCE if snapshot.layout.has_type(name) else NO_SUCH_OBJECT
        return VarBind(name, Value(missing))
    return VarBind(name, value)


def _next(snapshot: MibSnapshot, name: Oid, version_1: bool) -> VarBind:
    """The first variable after ``name``; version 1 skips those of a type that it does not have."""
    names = snapshot.layout.names
    for place in range(snapshot.layout.after(name), len(names)):
        value = snapshot.get(names[place])
        if value is not None and not (version_1 and value.tag == COUNTER64):
            return VarBind(names[place], value)
    return VarBind(name, Value(END_OF_MIB_VIEW))


def _judge(wanted: VarBind) -> ErrorStatus | None:
    """Why one variable cannot be set, in the order of RFC 3416, 4.2.5; None if it can."""
    if wanted.name not in WRITABLE:
        of_text = any(wanted.name[: len(name) - 1] == name[:-1] for name in WRITABLE)
        return ErrorStatus.NO_CREATION if of_text else ErrorStatus.NOT_WRITABLE
    text = wanted.value.content
    if wanted.value.tag != OCTET_STRING or not isinstance(text, bytes):
        return ErrorStatus.WRONG_TYPE
    if len(text) > TEXT_LIMIT:
        return ErrorStatus.WRONG_LENGTH
    return None if text.isascii() else ErrorStatus.WRONG_VALUE
