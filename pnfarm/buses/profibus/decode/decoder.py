"""PROFIBUS's part of the capture decoder: telegrams of a line, one to a packet (LINKTYPE_PROFIBUS_DL).

An answer names neither its service nor, where it is short, its station: what was asked last decides.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.decoding.channel import limited
from pnfarm.buses.decoding.decoder import FamilyDecoder, SharedState
from pnfarm.buses.profibus.decode.channels import Cyclic
from pnfarm.buses.profibus.decode.names import (
    address_text,
    configuration_text,
    control_text,
    diagnosis_text,
    is_set_up,
    model_by_ident,
    parameters_text,
)
from pnfarm.buses.profibus.decode.observed import Observed
from pnfarm.buses.profibus.decode.records import Records
from pnfarm.captures.decoder import LineDecoder
from pnfarm.captures.packet import Description, Packet
from pnfarm.captures.stations import Bounded
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.dp import Diagnosis, GlobalControl, Parameters, SetAddress
from pnfarm.protocols.profibus.wire.telegram import (
    BROADCAST,
    FCB,
    FCV,
    Answer,
    Request,
    Sap,
    ShortAck,
    Telegram,
    Token,
    parse_telegram,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.captures.decoder import PlannedDrive
    from pnfarm.captures.packet import Capture
    from pnfarm.captures.reading import CapturedFrame
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = ["FAMILIES", "LINK_TYPE", "ProfibusDecoder"]

#: LINKTYPE_PROFIBUS_DL of tcpdump.org: a telegram from its start delimiter to its end delimiter.
LINK_TYPE: Final = 257
#: Words of `pnfarm decode --only`: cyclic data, services of DP-V0, records, and what FDL does by itself.
FAMILIES: Final = ("cyclic", "dp", "dpv1", "fdl")

_SERVICES: Final[Mapping[int, str]] = MappingProxyType(
    {
        Sap.SET_SLAVE_ADDRESS: "Set_Slave_Add", Sap.READ_INPUTS: "RD_Inp", Sap.READ_OUTPUTS: "RD_Outp",
        Sap.GLOBAL_CONTROL: "Global_Control", Sap.GET_CONFIGURATION: "Get_Cfg", Sap.SLAVE_DIAGNOSIS: "Slave_Diag",
        Sap.SET_PARAMETERS: "Set_Prm", Sap.CHECK_CONFIGURATION: "Chk_Cfg",
    }
)  # fmt: skip
_EXCHANGE: Final = "Data_Exchange"
_SRD: Final = frozenset({Request.SRD_LOW, Request.SRD_HIGH})
_HIGH: Final = frozenset({Answer.DH, Answer.RDH})
_CODES: Final[Mapping[int, str]] = MappingProxyType(
    {
        Answer.OK: "positive", Answer.UE: "UE: user error", Answer.RR: "RR: no resource",
        Answer.RS: "RS: no service activated", Answer.NR: "NR: no data", Answer.DL: "data", Answer.DH: "data",
        Answer.RDL: "data, RR: no resource", Answer.RDH: "data, RR: no resource",
    }
)  # fmt: skip
#: In place of an EtherType, of which a line has none.
_NO_TYPE: Final = 0


def _station(address: int) -> bytes:
    """A station as an address of two octets: one of six is Ethernet's."""
    return bytes((0, address))


@dataclass(slots=True)
class _Asked:
    """A request that was not answered yet."""

    telegram: Telegram
    service: str
    at_ns: int


@dataclass(slots=True)
class _Slave:
    """What the capture has shown of one slave so far."""

    model: Model | None = None
    #: Whether the model is a farm file's, whatever the ident number.
    described: bool = False
    identifiers: bytes = b""
    cyclic: Cyclic | None = None
    watchdog_ns: int = 0
    class_one: Records = field(default_factory=Records)
    told: dict[str, int] = field(default_factory=dict)
    #: FCB of the last request of each master.
    last: dict[int, tuple[int, bytes]] = field(default_factory=dict)

    def identify(self, ident: int) -> None:
        """What is at the address now may be another device than before."""
        if not self.described:
            self.model = model_by_ident(ident)


#: Nothing of a line is kept by these keys but who is observed.
Shared = SharedState[Any, Any, Any, Observed]


class ProfibusDecoder(FamilyDecoder[Shared], LineDecoder):
    """See :class:`~pnfarm.captures.decoder.LineDecoder`."""

    link_type = LINK_TYPE

    def __init__(self, capture: Capture) -> None:
        super().__init__(SharedState(capture))
        self._asked: _Asked | None = None
        self._slaves: Bounded[int, _Slave] = Bounded(128)
        self._class_two: Bounded[tuple[int, int, int], Records] = Bounded(256)
        #: Of the line itself.
        self._told: dict[str, int] = {}
        capture.stations.name_line(_station(BROADCAST), "all")

    def packet(self, frame: CapturedFrame) -> Packet:
        """See :class:`~pnfarm.captures.decoder.LineDecoder`; a short acknowledgement is of who was asked."""
        source = destination = b""
        try:
            telegram = parse_telegram(frame.data)
        except DecodeError:
            pass
        else:
            match telegram:
                case Telegram() | Token():
                    source, destination = _station(telegram.source), _station(telegram.destination)
                case ShortAck() if self._asked is not None:
                    asked = self._asked.telegram
                    source, destination = _station(asked.destination), _station(asked.source)
                case _:
                    pass
        if frame.interface and frame.direction is not None:
            own = source if frame.direction == _OUTBOUND else destination
            if own and own != _station(BROADCAST):
                self.shared.stations.guess(own, frame.interface)
        return Packet(frame.time_ns, destination, source, _NO_TYPE, frame.data, frame.cut)

    def family_of(self, packet: Packet) -> str | None:
        """Families of telegrams; a frame of a network is another bus's."""
        if packet.ethertype != _NO_TYPE or len(packet.source) not in {0, 2}:
            return None
        try:
            telegram = parse_telegram(packet.payload)
        except DecodeError:
            return "fdl"
        return self._family(telegram)

    def _family(self, telegram: Line) -> str:
        if isinstance(telegram, Telegram) and telegram.is_request:
            return _family_of(_service(telegram))
        return "fdl" if isinstance(telegram, Token) or self._asked is None else _family_of(self._asked.service)

    def describe(self, family: str, packet: Packet) -> Iterator[Description]:
        """Most telegrams give no line."""
        del family
        try:
            telegram = parse_telegram(packet.payload)
        except DecodeError as exc:
            if packet.cut:
                raise
            yield from self._broken(packet, exc)
            return
        match telegram:
            case Token():
                yield from limited(
                    self._told, "token", f"of the right to send, {telegram.source} to {telegram.destination}"
                )
            case ShortAck():
                yield from self._acknowledged(packet.time_ns)
            case Telegram() if telegram.is_request:
                yield from self._requested(telegram, packet.time_ns)
            case Telegram():
                yield from self._answered(telegram, packet.time_ns)

    def polled_ns(self, address: int) -> int:
        """The mean time between two polls of a slave; 0 where there were not two."""
        slave = self._slaves.get(address)
        return slave.cyclic.outputs.cycle_ns if slave is not None and slave.cyclic is not None else 0

    def cyclic_channels(self) -> Iterator[CyclicChannel]:
        for slave in self._slaves.values():
            if slave.cyclic is not None:
                yield from slave.cyclic.channels()

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:
        """``plan`` of each drive is a :class:`~pnfarm.buses.profibus.controller.plan.DevicePlan`."""
        del controller, mac
        for drive in drives:
            plan = drive.plan.slave
            slave = self._slave(plan.address)
            slave.model, slave.described, slave.identifiers = drive.model, True, plan.identifiers
            self.shared.stations.learn(_station(plan.address), name=plan.name, model=drive.model)

    def learn(self, station: Any, model: Model | None) -> None:
        if station.address is not None:
            slave = self._slave(station.address)
            slave.model, slave.described = model, True
            self.shared.stations.learn(_station(station.address), name=station.name, model=model)

    def learn_controller(self, section: Any) -> None:
        self.shared.stations.learn(_station(section.address), name=section.name)

    # -- telegrams ---------------------------------------------------------------------------------------------------

    def _slave(self, address: int) -> _Slave:
        return self._slaves.made(address, _Slave)

    def _broken(self, packet: Packet, exc: DecodeError) -> Iterator[Description]:
        octets = packet.payload
        shown = octets[:24].hex(" ") + (" ..." if len(octets) > 24 else "")
        text, reason = f"{exc.detail or exc.reason}: {shown}", exc.reason
        yield from limited(self._told, "no telegram", text, {"reason": reason}, counts={"malformed": reason})

    def _requested(self, telegram: Telegram, now: int) -> Iterator[Description]:
        yield from self._unanswered(now)
        service = _service(telegram)
        slave = self._slave(telegram.destination)
        if telegram.code not in _SRD | {Request.FDL_STATUS}:
            self._asked = None
            yield from self._command(telegram, service)
            return
        self._asked = _Asked(telegram, service, now)
        if telegram.code in _SRD and self._again(telegram, slave):
            yield from limited(slave.told, "repeated", f"{service}.req, with the same FCB", counts={"repeated": ""})
            return
        if service == _EXCHANGE:
            yield from self._cyclic(telegram.source, telegram.destination, slave).sent(telegram.data, now)
        elif service.startswith("FDL"):
            yield from limited(slave.told, f"{service}.req", "")
        elif service in _SERVICES.values():
            yield from self._dp_request(telegram, service, slave)
        else:
            yield from self._records(telegram.source, telegram.destination, _connection(telegram), slave).request(
                telegram.data, slave.model
            )

    @staticmethod
    def _again(telegram: Telegram, slave: _Slave) -> bool:
        """Whether the request is a repetition: FCB as in the one before, and the same octets."""
        this = telegram.function & FCB, bytes((telegram.dsap or 0, telegram.ssap or 0)) + telegram.data
        before = slave.last.get(telegram.source)
        slave.last[telegram.source] = this
        return bool(telegram.function & FCV) and this == before

    def _unanswered(self, now: int) -> Iterator[Description]:
        asked, self._asked = self._asked, None
        if asked is None:
            return
        slave = self._slave(asked.telegram.destination)
        if asked.service.startswith("FDL"):
            # a master looks for new stations at every address
            return
        text = f"of {asked.telegram.destination} to {asked.service}.req, {(now - asked.at_ns) / 1e6:.3g} ms"
        counts, family = {"unanswered": asked.service}, _family_of(asked.service)
        # the telegram that shows it may be for another slave
        ends = _station(asked.telegram.source), _station(asked.telegram.destination)
        for one in limited(slave.told, "no answer", text, counts=counts, family=family):
            yield replace(one, ends=ends)

    def _command(self, telegram: Telegram, service: str) -> Iterator[Description]:
        """A request that gets no answer, or one of a function that slaves lack."""
        if service == "Global_Control":
            control = GlobalControl.parse(telegram.data)
            yield from limited(self._told, f"{service} {int(control.command)}", control_text(control))
        elif telegram.dsap is not None:
            yield from limited(self._told, f"{service}.req", telegram.data.hex(" "))
        else:
            yield from limited(self._told, f"function {telegram.code}", telegram.data.hex(" "))

    def _dp_request(self, telegram: Telegram, service: str, slave: _Slave) -> Iterator[Description]:
        data, text = telegram.data, ""
        match telegram.dsap:
            case Sap.SET_PARAMETERS:
                parameters = Parameters.parse(data)
                text = parameters_text(parameters)
                slave.watchdog_ns = parameters.watchdog_ns()
                if self.shared.observed is not None and is_set_up(parameters):
                    self.shared.observed.parametrised(telegram.destination, telegram.source, parameters)
                slave.identify(parameters.ident)
                if slave.cyclic is not None:
                    slave.cyclic.begin()
                counts = {"connects": ""} if is_set_up(parameters) else {"releases": ""}
                yield Description(f"{service}.req", text, {"ident": parameters.ident}, counts)
                return
            case Sap.CHECK_CONFIGURATION:
                slave.identifiers = data
                if self.shared.observed is not None:
                    self.shared.observed.configured(telegram.destination, data)
                text = configuration_text(data, slave.model)
            case Sap.SET_SLAVE_ADDRESS:
                text = address_text(SetAddress.parse(data))
            case _:
                text = data.hex(" ")
        yield from limited(slave.told, f"{service}.req", text)

    def _acknowledged(self, now: int) -> Iterator[Description]:
        asked, self._asked = self._asked, None
        if asked is None:
            yield from limited(self._told, "acknowledgement", "without a request")
            return
        self._note_answer(asked)
        if asked.service == _EXCHANGE:
            request = asked.telegram
            slave = self._slave(request.destination)
            yield from self._cyclic(request.source, request.destination, slave).answered(b"", now)
        elif asked.service in {"Set_Prm", "Chk_Cfg", "Set_Slave_Add"}:
            yield Description(f"{asked.service}.res", "acknowledged")

    def _answered(self, telegram: Telegram, now: int) -> Iterator[Description]:
        asked, self._asked = self._asked, None
        if asked is None or (asked.telegram.destination, asked.telegram.source) != (
            telegram.source,
            telegram.destination,
        ):
            yield from limited(self._told, "answer", f"of {telegram.source} without a request")
            return
        slave = self._slave(telegram.source)
        service, code = asked.service, telegram.code
        self._note_answer(asked)
        if service.startswith("FDL"):
            yield from limited(slave.told, f"{service}.res", _CODES.get(code, f"code 0x{code:X}"))
        elif not telegram.data:
            reason = _CODES.get(code, f"code 0x{code:X}")
            yield from limited(slave.told, f"{service}.res", reason, counts={"errors": f"{service}: {reason}"})
        elif service == _EXCHANGE:
            cyclic = self._cyclic(telegram.destination, telegram.source, slave)
            yield from cyclic.answered(telegram.data, now)
            if code in _HIGH:
                yield from limited(slave.told, "asks for a diagnosis", "answer of high priority")
        elif service == "Slave_Diag":
            yield from self._diagnosis(telegram, slave)
        elif service in _SERVICES.values():
            text = configuration_text(telegram.data, slave.model) if service == "Get_Cfg" else telegram.data.hex(" ")
            if service == "Get_Cfg" and self.shared.observed is not None:
                self.shared.observed.told(telegram.source, telegram.data)
            yield from limited(slave.told, f"{service}.res", text)
        else:
            records = self._records(telegram.destination, telegram.source, _connection(asked.telegram), slave)
            yield from records.answer(telegram.data, slave.model)

    def _note_answer(self, asked: _Asked) -> None:
        """Masters answer FDL_Status, too."""
        if self.shared.observed is not None and not asked.service.startswith("FDL"):
            self.shared.observed.answered(asked.telegram.destination)

    def _diagnosis(self, telegram: Telegram, slave: _Slave) -> Iterator[Description]:
        diagnosis = Diagnosis.parse(telegram.data)
        if self.shared.observed is not None:
            self.shared.observed.diagnosed(telegram.source, diagnosis)
        slave.identify(diagnosis.ident)
        yield from limited(
            slave.told, "Slave_Diag.res", diagnosis_text(diagnosis),
            {"status": int(diagnosis.status), "ident": diagnosis.ident, "extended": diagnosis.extended.hex()},
        )  # fmt: skip

    # -- what belongs to a slave -------------------------------------------------------------------------------------

    def _cyclic(self, master: int, address: int, slave: _Slave) -> Cyclic:
        found = slave.cyclic
        if found is None:
            found = slave.cyclic = Cyclic(_station(master), _station(address), self.shared.capture)
        if not found.outputs.begun:
            telegram = None
            if slave.model is not None:
                known = slave.model.profidrive.telegrams.values()
                telegram = next((one for one in known if one.identifiers == slave.identifiers), None)
            found.lay_out(slave.model, telegram)
            found.outputs.hold_ns = slave.watchdog_ns
        return found

    def _records(self, master: int, address: int, connection: int | None, slave: _Slave) -> Records:
        if connection is None:
            return slave.class_one
        return self._class_two.made((master, address, connection), Records)


#: Direction of a captured telegram that the interface's own station sent.
_OUTBOUND: Final = 2


def _family_of(service: str) -> str:
    if service == _EXCHANGE:
        return "cyclic"
    if service in _SERVICES.values():
        return "dp"
    return "fdl" if service.startswith("FDL") else "dpv1"


def _service(telegram: Telegram) -> str:
    if telegram.code == Request.FDL_STATUS:
        return "FDL_Status"
    if telegram.dsap is None and telegram.ssap is None:
        return _EXCHANGE
    if telegram.ssap == Sap.MASTER and (known := _SERVICES.get(-1 if telegram.dsap is None else telegram.dsap)):
        return known
    return "MSAC1" if (telegram.dsap, telegram.ssap) == (Sap.MSAC1, Sap.MSAC1) else "MSAC2"


def _connection(telegram: Telegram) -> int | None:
    """The slave's access point of a connection of class 2; None within the cyclic connection."""
    if (telegram.dsap, telegram.ssap) == (Sap.MSAC1, Sap.MSAC1):
        return None
    exchanged = telegram.dsap == Sap.MASTER_2 and telegram.ssap != Sap.MASTER_2
    sap = telegram.ssap if exchanged else telegram.dsap
    return -1 if sap is None else sap
