"""One station on PROFIBUS: its slave, its image, and what is behind them (:mod:`.kind`).

Telegrams and ``now`` in, answers and typed events out.  Slave and user are created at each power-on.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.device import events as happened
from pnfarm.buses.profibus.device import refused
from pnfarm.buses.profibus.device.fast_path import READY
from pnfarm.buses.profibus.device.image import CyclicImage
from pnfarm.buses.profibus.device.view import connection_of, details_of, losses_in_words, view_of
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus import slave_user as dp
from pnfarm.protocols.profibus.slave import PARAMETERS_AGAIN, UNLOCKED, WATCHDOG, Slave
from pnfarm.protocols.profibus.wire.dp import DpState
from pnfarm.protocols.profibus.wire.telegram import (
    BODY,
    FCB,
    Answer,
    Request,
    Sap,
    Telegram,
    emit_data,
    emit_telegram,
    parse_telegram,
)
from pnfarm.station.events import ControllerModeChanged, StartUpPhase, WatchdogExpired
from pnfarm.station.lateness import budget_ns
from pnfarm.station.visits import Caller, Refusal
from pnfarm.table.image import LOST_CLOSED, LOST_EXPIRED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.profibus.device.kind import Kind, StationUser
    from pnfarm.buses.profibus.device.parts import LineParts
    from pnfarm.engine.channels.closed_channels import ClosedChannels
    from pnfarm.protocols.profibus.slave_user import SlaveEvent
    from pnfarm.station.device import ConnectionView
    from pnfarm.station.event import Event
    from pnfarm.station.lateness import Lateness
    from pnfarm.station.station import Station

__all__ = ["ProfibusDevice"]

#: How long after the last poll that was answered a master's next ones may lie before it gives the slave up: a time, or
#: so many cycles.
RETRIES_NS, RETRY_CYCLES = 100_000_000, 4
#: Where the master's cycle is not known yet.
SHORTEST_CYCLE_NS = 1_000_000


def _searches(telegram: Telegram, address: int) -> bool:
    """Whether a master asks the slave at this address whether it is there."""
    if telegram.destination != address or not telegram.is_request:
        return False
    return telegram.dsap == Sap.SLAVE_DIAGNOSIS or telegram.code == Request.FDL_STATUS


class ProfibusDevice:
    """See :class:`pnfarm.station.device.Device`."""

    def __init__(self, station: Station, services: DeviceServices, kind: Kind) -> None:
        self.station = station
        self.port = station.port
        self.kind = kind
        self._lateness = services.lateness
        self.image = CyclicImage(station.image, self._cycle_known)
        self.connects = 0
        #: Those before the last power-on.
        self.connects_before = 0
        #: Connections that ended without a release, by reason; those that the farm's own lateness ended.
        self.lost: Counter[str] = Counter()
        self.lost_by_farm: Counter[str] = Counter()
        self.watchdog_expirations = 0
        self.watchdog_expirations_by_farm = 0
        #: Telegrams that were dropped, by reason, of the slaves before the last power-on.
        self.dropped: dict[str, int] = {}
        self._counted_before: Counter[str] = Counter()
        self.boots = 0
        self.connected_ns = 0
        self.address_from = ""
        self._rate = getattr(station.port, "rate", None)
        self._baud = getattr(station.port, "baud", 0)
        #: What the slaves of the line share; set by the segment.
        self.line: LineParts | None = None
        self._answers: list[bytes] = []
        #: Counts parametrisations: which of them is in force.
        self.number = 0
        #: Whether the connection of this number came to data exchange.
        self._exchanged = True
        #: Set by an injection: the line has another rate for this slave, which hears nothing but garbage.
        self.deaf = False
        self._due: int | None = None
        self._only_polled = False
        self._watchdog_ns = 0
        self.slave: Slave
        self._built = False

    # -- life --------------------------------------------------------------------------------------------------------

    def check(self, kept: Mapping[str, Any]) -> None:
        self.kind.check(kept)

    def commission(self, kept: Mapping[str, Any]) -> None:
        self.kind.commission(kept)

    def build(self, kept: dict[str, Any]) -> None:
        if self._built:
            self.dropped = self.discards()
            self._counted_before = self.counted()
        self._built = True
        self.boots += 1
        self.connects_before = self.connects
        found = self.kind.address(kept)
        self.address_from = found.origin
        options = self.kind.build(self.image)
        self.slave = Slave(found.address, self.user, options)
        self.slave.changed = self._not_as_before
        self._not_as_before()
        # of the slave before
        self.image.repeated()
        self._due, self._only_polled = None, False
        self.slave.address_locked = bool(kept.get("address_locked", False))
        self.connected_ns = 0
        self._line_changed()

    def _line_changed(self) -> None:
        if self.line is not None:
            self.line.changed()

    def start(self, now: int) -> list[str]:
        del now
        self._show_rate()
        return []

    def stop(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: the slave is silent at once."""
        del now
        self.catch_up_polls()
        self._not_as_before()
        self._answers.clear()
        if self.slave.state is not DpState.WAIT_PRM:
            self.slave.leave()
            self.slave.take_events()
        self.slave.class_two.close_all()
        self._ended(LOST_CLOSED)

    def leave(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: a slave has no word for it; its master sees it fall silent."""
        self.catch_up_polls()
        if self.slave.state is not DpState.WAIT_PRM:
            self.slave.leave(UNLOCKED)
        self._settle(now)

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: one telegram of the line."""
        self.catch_up_polls()
        if self.deaf:
            self.drop("garbage")
            return
        try:
            telegram = parse_telegram(data)
        except DecodeError as exc:
            self.drop(exc.reason)
            return
        slave = self.slave
        if slave.state is DpState.WAIT_PRM and type(telegram) is Telegram and _searches(telegram, slave.address):
            self.station.visits.step(Caller(str(telegram.source)), "searched", now)
        answer = slave.receive(telegram, now)
        if answer is not None:
            self._answers.append(emit_telegram(answer, fixed=self.kind.fixed_length))
        # a poll of a slave that exchanges data moves its deadlines to later times, and nothing else
        self._only_polled = (
            self._due is not None and slave.state is DpState.DATA_EXCH and slave.quiet and type(telegram) is Telegram
            and telegram.dsap is None
        )  # fmt: skip

    def poll(self, octets: bytes, now: int) -> bytes | None:
        """The answer to one whole telegram with data and without access points, where it is a plain poll.

        It moves deadlines to later times and nothing else: they are checked when the earlier ones come.
        """
        if self.deaf or self._answers or self._due is None or not self.image.input_octets:
            return None
        begin = BODY[octets[0]]
        source, function = octets[begin + 1], octets[begin + 2]
        self.catch_up_polls()
        inputs = self.slave.poll(source, function, octets[begin + 3 : -2], now)
        if inputs is None:
            return None
        answer = emit_data(source, self.slave.address, Answer.DL, inputs, fixed=self.kind.fixed_length)
        self.image.repeat(source, function & FCB, BODY[answer[0]])
        return answer

    def _not_as_before(self) -> None:
        self.image.cells[READY] = 0

    def catch_up_polls(self) -> None:
        """Tell the slave of the polls that the fast path has answered (:mod:`.fast_path`)."""
        last = self.image.repeated()
        if last is not None:
            self.slave.polled(*last)

    def put_on_line(self, octets: bytes) -> None:
        """Octets that are no answer, for an injection."""
        self._answers.append(octets)

    def pump(self, now: int) -> list[bytes]:
        if not self._answers:
            self.follow(now)
            return []
        # the chip acknowledges before its application looks at a Set_Prm or Chk_Cfg: :meth:`follow` is called after
        answers, self._answers = self._answers, []
        return answers

    def follow(self, now: int) -> None:
        """Carry out what requests changed; it is not part of the time that an answer takes."""
        self.kind.follow()
        while self.station.pump_drive(now):
            self._only_polled = False
        self._settle(now)

    def next_deadline(self) -> int | None:
        self.catch_up_polls()
        if self._only_polled:
            self._only_polled = False
            return self._due
        times = (self.slave.next_deadline(), self.kind.next_deadline())
        due = min((time for time in times if time is not None), default=None)
        if due is None or self._due is None or due < self._due:
            self._due = due
        # a deadline that moved to a later time is checked when the earlier one comes
        return self._due

    def handle_timeout(self, now: int) -> None:
        self.catch_up_polls()
        self._not_as_before()
        self._due, self._only_polled = None, False
        if self.line is not None:
            # telegrams for others are not given to it, and keep the rate as well
            self.slave.heard(self.line.heard_ns)
        self.slave.handle_timeout(now)
        self.kind.handle_timeout(now)

    def telegram_changed(self, axis: int) -> None:
        del axis
        self.kind.layout()

    # -- the slave's events ------------------------------------------------------------------------------------------

    def _settle(self, now: int) -> None:
        for event in self.slave.take_events():
            self._take(event, now)

    def _take(self, event: SlaveEvent, now: int) -> None:
        visits = self.station.visits
        match event:
            case dp.BaudFound():
                self._line_changed()
                self._show_rate()
                self.note(now, happened.BaudRateFound(self.baud))
            case dp.BaudLost():
                self._line_changed()
                self._show_rate()
                self.note(now, happened.BaudRateLost())
            case dp.ParametersTaken(master, parameters, watchdog_ns):
                # one that never came to data exchange goes on: a master may try for hours
                self.number += self._exchanged
                self._exchanged = False
                self._watchdog_ns = watchdog_ns
                wrong = self.kind.parametrised(parameters)
                visits.opened(Caller(str(master)), self.number, 0, watchdog_ns, now)
                visits.take(StartUpPhase("parameters", self.number), now)
                self.note(now, happened.ParametersTaken(master, watchdog_ns, connection=self.number))
                if wrong is not None:
                    doubt = Refusal(f"Set_Prm accepted although it is wrong: {wrong}", works=True)
                    visits.refused(Caller(str(master)), [doubt], final=False)
                    self.note(now, happened.ParametersDoubted(master, wrong))
            case dp.ParametersRefused(master, why):
                refusal = refused.of_parameters(event, self.slave.options.ident, self.kind)
                visits.refused(Caller(str(master)), [refusal], attempt=True)
                self.note(now, happened.ParametersRefused(master, why))
            case dp.ConfigurationRefused(master, identifiers):
                refusal = refused.of_configuration(event, self.user.configuration(), self.kind)
                visits.refused(Caller(str(master)), [refusal])
                self.note(now, happened.ConfigurationRefused(master, identifiers))
            case dp.ExchangeBegan(master):
                self._began(master, now)
            case dp.Left():
                self._left(event, now)
            case dp.ClearChanged(clear):
                self.note(now, ControllerModeChanged(run=not clear))
            case dp.AddressSet(address, locks, master):
                visits.step(Caller(str(master)), "addressed", now)
                self._line_changed()
                self._readdressed(address, now, locks=locks)
            case dp.AcyclicOpened(master, sap):
                self.note(now, happened.AcyclicConnectionOpened(master, sap))
            case dp.AcyclicClosed(master, sap, reason):
                self.note(now, happened.AcyclicConnectionEnded(master, sap, f"0x{reason:02X}"))
            case _:
                pass

    def _began(self, master: int, now: int) -> None:
        self.connects += 1
        self._exchanged = True
        self.connected_ns = now
        self.image.begin()
        self.kind.began()
        self.note(now, happened.DataExchangeBegan(master, self.kind.number, connection=self.number))

    def _cycle_known(self, mean_ns: int) -> None:
        if self.connected_ns:
            self.kind.cycle_known(mean_ns)

    def _left(self, event: dp.Left, now: int) -> None:
        silent = self._watchdog_ns
        own: Lateness | None = None
        if event.why == PARAMETERS_AGAIN:
            # as a master does that got no answer in its slot time: the farm may have been too late with it
            cycle, last = max(self.cycle_ns, SHORTEST_CYCLE_NS), int(self.station.image.frame_ns)
            until = min(now, last + max(RETRIES_NS, RETRY_CYCLES * cycle))
            # the last poll itself may have been answered too late
            budget = budget_ns(cycle, cycle)
            own = self._lateness.between(last - cycle, until, budget, by_loop=True, by_lines=True)
        if event.why == WATCHDOG:
            budget = budget_ns(self.cycle_ns, silent)
            own = self._lateness.between(now - silent, now, budget, by_loop=True, by_lines=True)
            self.watchdog_expirations += 1
            self.watchdog_expirations_by_farm += own.late
            self.note(now, WatchdogExpired(silent, own, connection=self.number))
        self._ended(LOST_EXPIRED if event.why == WATCHDOG else LOST_CLOSED)
        if not event.exchanged:
            # the log has data exchange only
            self.station.visits.closed(self.number, event.why)
            return
        if event.why == UNLOCKED:
            self.note(now, happened.SlaveReleased(event.master, connection=self.number))
            return
        self.lost[event.why] += 1
        if own is not None and own.late:
            self.lost_by_farm[event.why] += 1
        self.note(now, happened.DataExchangeLost(event.why, event.master, lateness=own, connection=self.number))
        if event.why == WATCHDOG:
            self.kind.expired()

    def _ended(self, why: int) -> None:
        """Data exchange is over, whatever ended it."""
        if self.connected_ns or int(self.station.image.valid):
            self.image.stop(why)
        self.connected_ns = self._watchdog_ns = 0
        self.kind.ended()

    def _readdressed(self, address: int, now: int, *, locks: bool) -> None:
        """Set_Slave_Add."""
        self.station.kept["address_locked"] = locks
        self.kind.readdressed(address, now)
        self.note(now, happened.AddressChanged(address, "master"))

    def _show_rate(self) -> None:
        self.kind.rate_known(self.baud if self.slave.found else 0)

    # -- events of the engine ----------------------------------------------------------------------------------------

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        """See :class:`pnfarm.station.device.Device`: it has no rows."""
        del kind, row, when, value, now
        return False

    def catch_up(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`."""

    def fault_raised(self, axis: int, number: int) -> None:
        """See :class:`pnfarm.station.device.Device`: the master is asked to read the diagnosis."""
        del axis, number
        if self.kind.reports_faults:
            self.slave.diagnosis_changed()

    def faults_cleared(self, axis: int) -> None:
        del axis
        if self.kind.reports_faults:
            self.slave.diagnosis_changed()

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: a task of the cyclic parameter channel."""
        del axis
        self.kind.parameter_task(value, now)

    # -- state for observers -----------------------------------------------------------------------------------------

    @property
    def baud(self) -> int:
        """The rate of its line, as the link has it, bit/s."""
        return self._baud if self._rate is None else self._rate()

    @property
    def user(self) -> StationUser:
        """What the slave asks; recreated at each power-on."""
        return self.kind.user

    @property
    def name(self) -> str:
        return self.station.configured_name

    @property
    def cycle_ns(self) -> int:
        """Time between the last two polls; 0 before there were two."""
        return int(self.station.image.interval_ns)

    @property
    def connected(self) -> bool:
        """Whether outputs come."""
        return self.slave.exchanging

    def connection(self) -> ConnectionView | None:
        return connection_of(self)

    def counted(self) -> Counter[str]:
        """Requests of some kinds since the start: repeated, diagnosis, refused."""
        slave = self.slave
        now = Counter(repeated=slave.repeated, diagnosis=slave.diagnoses, refused=slave.refusals)
        return now + self._counted_before

    def losses(self) -> Mapping[str, int]:
        return self.lost

    def losses_by_farm(self) -> Mapping[str, int]:
        return self.lost_by_farm

    def losses_in_words(self) -> Mapping[str, int]:
        return losses_in_words(self)

    @property
    def closed(self) -> ClosedChannels:
        """See :class:`pnfarm.station.device.Device`: all counts are here, as there are no rows."""
        return self.image.counts

    @property
    def channel_rows(self) -> tuple[list[int], list[int]]:
        return [], []

    def discards(self) -> dict[str, int]:
        total = Counter(self.dropped)
        if self._built:
            total.update(self.slave.dropped)
        return dict(total)

    def drop(self, reason: str) -> None:
        """Something of the line that is no telegram."""
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    def view(self, now: int) -> dict[str, Any]:
        del now
        return view_of(self)

    def details(self) -> dict[str, Any]:
        return details_of(self)

    def note(self, now: int, event: Event) -> None:
        """Something happened to this drive."""
        self.station.note(now, event)
