"""The Message Router: one request in, one reply out (CIP volume 1, chapter 5A-3 and appendix A-4).

It finds class and instance of the path and carries out the services that need no more than reading and writing
attributes.  Services of the Connection Manager depend on who asks; it takes these itself.

=============================================  ==========================================================
error                                          general status
=============================================  ==========================================================
the path is longer than the message            0x26 path size invalid
a segment that cannot be read, no class, a     0x04 path segment error
connection point of any class but Assembly
no such class                                  0x16 object does not exist (manual 004, 6.1.4: class)
no such instance                               0x05 path destination unknown
no attribute, no service, value, read-only     the object's: 0x14, 0x08, 0x09, 0x0E (manual 004, 6.1.4)
data where none is wanted                      0x15 too much data
a reply that does not fit                      0x11 reply data too large
=============================================  ==========================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.object import Answer, CipObject, cut_or_long, refused
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.epath import Logical, LogicalSegment, parse_epath
from pnfarm.protocols.enip.wire.message import (
    REPLY,
    MessageReply,
    MessageRequest,
    emit_multiple_service,
    parse_multiple_service,
    parse_request,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable
    from ipaddress import IPv4Address

    from pnfarm.protocols.enip.wire.cpf import SocketAddress

__all__ = ["MESSAGE_ROUTER", "MessageRouter", "ObjectPath", "Origin", "OriginService", "object_path"]

MESSAGE_ROUTER: Final = 0x02
#: Octets of a reply without extended status and data.
_REPLY_HEADER: Final = 4


@dataclass(slots=True)
class Origin:
    """Who sent an unconnected request; ``items`` came with it, ``reply_items`` go with its reply."""

    stream: int
    session: int
    address: IPv4Address
    items: tuple[SocketAddress, ...] = ()
    reply_items: list[SocketAddress] = field(default_factory=list)


#: A service that depends on who asks: originator, service, data, now; None for one that depends on no originator.
OriginService = Callable[[Origin, int, bytes, int], Answer | None]


@dataclass(frozen=True, slots=True)
class ObjectPath:
    """A path within the device; instance 0 is the class."""

    class_id: int
    instance_id: int = 0
    attribute_id: int | None = None


def object_path(path: bytes) -> ObjectPath:
    """Raises :class:`DecodeError` for a path that names no class, or has segments that lead elsewhere."""
    numbers: dict[int, int] = {}
    for segment in parse_epath(path):
        if not isinstance(segment, LogicalSegment) or segment.kind in numbers:
            raise DecodeError("bad-segment", "not a path within the device")
        numbers[segment.kind] = segment.value
    if Logical.CLASS not in numbers:
        raise DecodeError("bad-segment", "no class")
    # an assembly's connection point is its instance; other classes' are no objects
    if Logical.CONNECTION_POINT in numbers and numbers[Logical.CLASS] != ASSEMBLY:
        raise DecodeError("bad-segment", "a connection point of a class without any")
    instance = numbers.get(Logical.INSTANCE, numbers.get(Logical.CONNECTION_POINT, 0))
    return ObjectPath(numbers[Logical.CLASS], instance, numbers.get(Logical.ATTRIBUTE))


class MessageRouter:
    """``origin_services`` maps a class to what takes its services first."""

    def __init__(self, objects: Iterable[CipObject]) -> None:
        self._objects: dict[int, CipObject] = {}
        self._origin_services: dict[int, OriginService] = {}
        #: Asked about each request whose class and instance exist; the answer to refuse it with, or None.
        self.refuse: Callable[[ObjectPath, int], Answer | None] | None = None
        for one in objects:
            self.add(one)

    def add(self, one: CipObject) -> None:
        """Raises :class:`ValueError` for a class that is there already."""
        if one.class_id in self._objects:
            raise ValueError(f"class 0x{one.class_id:02X} appears twice")
        self._objects[one.class_id] = one

    def add_origin_services(self, class_id: int, services: OriginService) -> None:
        self._origin_services[class_id] = services

    @property
    def classes(self) -> list[int]:
        return sorted(self._objects)

    def handle(self, message: bytes, origin: Origin | None, now: int, room: int) -> bytes | None:
        """The reply, at most ``room`` octets (at least 6); None for octets that are no request.

        ``origin`` is None for requests of a connection, which cannot open connections.
        """
        try:
            request = parse_request(message)
        except DecodeError as exc:
            if exc.reason != "short" or not message:
                return None
            return MessageReply(message[0] & ~REPLY, GeneralStatus.PATH_SIZE_INVALID).emit()
        answer = self._answer(request, origin, now, room)
        reply = MessageReply(request.service, answer.status, answer.extended, answer.data).emit()
        if len(reply) > room:
            reply = MessageReply(request.service, GeneralStatus.REPLY_DATA_TOO_LARGE).emit()
        return reply

    def _answer(self, request: MessageRequest, origin: Origin | None, now: int, room: int) -> Answer:
        try:
            path = object_path(request.path)
        except DecodeError:
            return refused(GeneralStatus.PATH_SEGMENT_ERROR)
        if (target := self._objects.get(path.class_id)) is None:
            return refused(GeneralStatus.OBJECT_DOES_NOT_EXIST)
        if path.instance_id and path.instance_id not in target.instances:
            return refused(GeneralStatus.PATH_DESTINATION_UNKNOWN)
        if self.refuse is not None and (refusal := self.refuse(path, request.service)) is not None:
            return refusal
        services = self._origin_services.get(path.class_id)
        if origin is not None and services is not None and path.instance_id:
            answer = services(origin, request.service, request.data, now)
            if answer is not None:
                return answer
        if path.class_id == MESSAGE_ROUTER and request.service == Service.MULTIPLE_SERVICE_PACKET:
            return self._multiple(request.data, origin, now, room)
        return _object_service(target, path, request, room)

    def _multiple(self, data: bytes, origin: Origin | None, now: int, room: int) -> Answer:
        """The messages in their order; where the replies fill the room, the others are refused unseen."""
        try:
            messages = parse_multiple_service(data)
        except DecodeError:
            return refused(GeneralStatus.NOT_ENOUGH_DATA)
        replies: list[bytes] = []
        left = room - _REPLY_HEADER - 2 - 2 * len(messages) - _REPLY_HEADER * len(messages)
        if left < 0:
            return refused(GeneralStatus.REPLY_DATA_TOO_LARGE)
        status = GeneralStatus.SUCCESS
        for message in messages:
            reply = self._embedded(message, origin, now, left + _REPLY_HEADER)
            left -= len(reply) - _REPLY_HEADER
            if reply[2] != GeneralStatus.SUCCESS:
                status = GeneralStatus.EMBEDDED_SERVICE_ERROR
            replies.append(reply)
        return Answer(status, emit_multiple_service(replies))

    def _embedded(self, message: bytes, origin: Origin | None, now: int, room: int) -> bytes:
        if message[0] == Service.MULTIPLE_SERVICE_PACKET:
            return MessageReply(message[0], GeneralStatus.SERVICE_NOT_SUPPORTED).emit()
        reply = self.handle(message, origin, now, room)
        return reply or MessageReply(message[0] & ~REPLY, GeneralStatus.SERVICE_NOT_SUPPORTED).emit()


def _object_service(target: CipObject, path: ObjectPath, request: MessageRequest, room: int) -> Answer:
    match request.service:
        case Service.GET_ATTRIBUTE_SINGLE:
            if path.attribute_id is None:
                return refused(GeneralStatus.PATH_SEGMENT_ERROR)
            if request.data:
                return refused(GeneralStatus.TOO_MUCH_DATA)
            return target.get(path.instance_id, path.attribute_id)
        case Service.SET_ATTRIBUTE_SINGLE:
            if path.attribute_id is None:
                return refused(GeneralStatus.PATH_SEGMENT_ERROR)
            return target.set(path.instance_id, path.attribute_id, request.data)
        case Service.GET_ATTRIBUTE_LIST:
            return _attribute_list(target, path.instance_id, request.data, room)
        case _:
            return target.service(path.instance_id, request.service, request.data)


def _attribute_list(target: CipObject, instance: int, data: bytes, room: int) -> Answer:
    """``Count u16, Number u16 ...``; answered by ``Count u16``, then ``Number u16, Status u16, Data`` for each."""
    r = Reader(data, little=True)
    try:
        numbers = [r.u16() for _ in range(r.u16())]
        r.expect_end()
    except DecodeError as exc:
        return cut_or_long(exc)
    w, status = Writer(little=True).u16(len(numbers)), GeneralStatus.SUCCESS
    for number in numbers:
        answer = target.get(instance, number)
        w.u16(number).u16(answer.status)
        if answer.ok:
            w.bytes(answer.data)
        else:
            status = GeneralStatus.ATTRIBUTE_LIST_ERROR
        if len(w) + _REPLY_HEADER > room:
            return refused(GeneralStatus.REPLY_DATA_TOO_LARGE)
    return Answer(status, w.getvalue())
