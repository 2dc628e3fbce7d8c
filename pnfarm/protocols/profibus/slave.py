"""One slave, telegrams in, answers out: FDL responder and DP-V0.

Records are those of :mod:`~pnfarm.protocols.profibus.acyclic`.

EN 50170 part 2: 4.7 (FDL), 8.2 and 8.3 (DP); guideline 2.082 (DP-V1).  Where the standard leaves it open, the slave
does as chips in the field do, as far as that is known: what they would not answer is not answered.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import auto
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError, InternalError
from pnfarm.protocols.named import Named
from pnfarm.protocols.profibus.acyclic import ClassOne, ClassTwo
from pnfarm.protocols.profibus.slave_user import (
    AddressSet,
    BaudFound,
    BaudLost,
    ClearChanged,
    ConfigurationRefused,
    ExchangeBegan,
    Left,
    ParametersRefused,
    ParametersTaken,
)
from pnfarm.protocols.profibus.wire.dp import (
    MOST_DIAGNOSIS,
    NO_MASTER,
    Control,
    DpState,
    GlobalControl,
    Parameters,
    PrmStatus,
    SetAddress,
    StationStatus,
    V1Status1,
    V1Status3,
    diagnosis_octets,
)
from pnfarm.protocols.profibus.wire.telegram import (
    BROADCAST,
    FCB,
    FCV,
    REQUEST,
    Answer,
    Request,
    Sap,
    ShortAck,
    Telegram,
    Token,
)
from pnfarm.protocols.profibus.wire.timing import LEAST_TSDR_BITS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.protocols.profibus.slave_user import SlaveEvent, SlaveOptions, SlaveUser
    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = [
    "BAD_LENGTH", "CONFIGURED_WRONG", "LEFT", "PARAMETERS_AGAIN", "PARAMETERS_WRONG", "UNLOCKED", "WATCHDOG", "Slave",
]  # fmt: skip

# Why a slave left what it did.
WATCHDOG: Final = "watchdog"
UNLOCKED: Final = "unlocked"
PARAMETERS_WRONG: Final = "wrong-parameters"
PARAMETERS_AGAIN: Final = "parametrised-again"
CONFIGURED_WRONG: Final = "wrong-configuration"
BAD_LENGTH: Final = "wrong-length"
LEFT: Final = "left"

#: An unprocessed telegram's reason, for counters.
_NOT_HERE: Final = "no-service"
_SDN: Final = frozenset({Request.SDN_LOW, Request.SDN_HIGH})
#: FC of requests that want data: the bits that show this.
_ASKS: Final = frozenset({REQUEST | Request.SRD_LOW, REQUEST | Request.SRD_HIGH})
_ASKS_BITS: Final = REQUEST | 0x0F
_SDA: Final = frozenset({Request.SDA_LOW, Request.SDA_HIGH})
# Bits of a diagnosis, looked up once: an answer is due at once.
(
    _STATION_NOT_READY, _CFG_FAULT, _EXT_DIAG, _NOT_SUPPORTED, _PRM_FAULT, _PRM_REQ, _STAT_DIAG, _ALWAYS_1, _WD_ON,
    _FREEZE_MODE, _SYNC_MODE, _EXT_DIAG_OVERFLOW,
) = (
    int(bit)
    for bit in (
        StationStatus.STATION_NOT_READY, StationStatus.CFG_FAULT, StationStatus.EXT_DIAG, StationStatus.NOT_SUPPORTED,
        StationStatus.PRM_FAULT, StationStatus.PRM_REQ, StationStatus.STAT_DIAG, StationStatus.ALWAYS_1,
        StationStatus.WD_ON, StationStatus.FREEZE_MODE, StationStatus.SYNC_MODE, StationStatus.EXT_DIAG_OVERFLOW,
    )
)  # fmt: skip
_NO_WATCHDOG: Final = 0


class _Sign(Named):
    """What can happen to a slave's state."""

    PARAMETERS = auto()
    NO_PARAMETERS = auto()
    CONFIGURATION = auto()
    NO_CONFIGURATION = auto()
    LEAVE = auto()


_W, _C, _D = DpState.WAIT_PRM, DpState.WAIT_CFG, DpState.DATA_EXCH
#: (state, sign) -> next state (8.2, figure of the states of a slave).
TRANSITIONS: Final[Mapping[tuple[DpState, _Sign], DpState]] = {
    **{(state, _Sign.PARAMETERS): _C for state in (_W, _C, _D)},
    **{(state, _Sign.NO_PARAMETERS): _W for state in (_W, _C, _D)},
    **{(state, _Sign.CONFIGURATION): _D for state in (_C, _D)},
    **{(state, _Sign.NO_CONFIGURATION): _W for state in (_C, _D)},
    **{(state, _Sign.LEAVE): _W for state in (_W, _C, _D)},
}


@dataclass(slots=True)
class _Remembered:
    """Of one master: FCB of its last request, and what was answered."""

    fcb: int
    answer: Line | None


@dataclass(slots=True)
class _Cyclic:
    """Of the present parametrisation."""

    master: int = NO_MASTER
    parameters: Parameters | None = None
    watchdog_ns: int = _NO_WATCHDOG
    heard_ns: int = 0
    exchanged: bool = False
    clear: bool = False
    frozen: bytes | None = None
    #: Outputs in force, and those that wait for the next Sync.
    held: bytes | None = None
    waiting: bytes | None = None
    sync: bool = False
    freeze: bool = False


@dataclass(slots=True)
class _Faults:
    """Bits of the last Set_Prm and Chk_Cfg that did not fit."""

    parameters: bool = False
    configuration: bool = False
    unsupported: bool = False


class Slave:
    """``address`` is the station's; see the module's docstring.

    The bus's device feeds it every telegram of the line with :meth:`receive`, calls :meth:`handle_timeout` at
    :meth:`next_deadline`, and takes :meth:`take_events`.
    """

    def __init__(self, address: int, user: SlaveUser, options: SlaveOptions) -> None:
        self.address = address
        self.user = user
        self.options = options
        self.state = DpState.WAIT_PRM
        self.faults = _Faults()
        self.address_locked = False
        #: Requests that were not carried out, by reason.
        self.dropped: Counter[str] = Counter()
        #: Requests that came again, and were answered as before.
        self.repeated = 0
        #: Set by injections: why a Set_Prm or Chk_Cfg is refused, whatever it says.
        self.refuse_parameters: str | None = None
        self.refuse_set_up: Callable[[], str | None] | None = None
        self.refuse_configuration = False
        #: Diagnoses that were read; Set_Prm and Chk_Cfg that did not fit.
        self.diagnoses = self.refusals = 0
        #: Whether a good telegram was heard lately.
        self.found = False
        self.class_one = ClassOne(self)
        self.class_two = ClassTwo(self)
        self._cyclic = _Cyclic()
        self._pending_diagnosis = False
        self._remembered: dict[int, _Remembered] = {}
        self._heard_ns = 0
        self._events: list[SlaveEvent] = []
        self._min_tsdr_bits = LEAST_TSDR_BITS
        self._new_address: int | None = None
        #: Called when the next poll may not be like the one before.
        self.changed: Callable[[], None] = lambda: None

    # -- state for the drive -----------------------------------------------------------------------------------------

    @property
    def master(self) -> int:
        """Address of the master that parametrised it, :data:`NO_MASTER` for none."""
        return self._cyclic.master

    @property
    def watchdog_ns(self) -> int:
        """Time of its watchdog, 0 without one."""
        return self._cyclic.watchdog_ns

    @property
    def exchanging(self) -> bool:
        """Whether outputs come."""
        return self.state is DpState.DATA_EXCH and self._cyclic.exchanged

    @property
    def clear(self) -> bool:
        """Whether the master is in Clear."""
        return self._cyclic.clear

    @property
    def min_tsdr_bits(self) -> int:
        """No answer begins sooner after the last bit of its request."""
        return self._min_tsdr_bits

    @property
    def v1_enabled(self) -> bool:
        """Whether the master asked for DP-V1."""
        parameters = self._cyclic.parameters
        return self.options.v1 and parameters is not None and bool(parameters.v1[0] & V1Status1.DPV1_ENABLE)

    def take_events(self) -> list[SlaveEvent]:
        """What has happened since the last call."""
        events, self._events = self._events, []
        return events

    @property
    def quiet(self) -> bool:
        """Whether nothing has happened since then."""
        return not self._events

    def note(self, event: SlaveEvent) -> None:
        """Something happened."""
        self.changed()
        self._events.append(event)

    def diagnosis_changed(self) -> None:
        """There is something new to report: the master is asked to read the diagnosis."""
        self.changed()
        self._pending_diagnosis = True

    def heard(self, now: int) -> None:
        """A good telegram for another station was on the line then."""
        self._heard_ns = max(self._heard_ns, now)

    def search(self) -> None:
        """Forget the baud rate: the next good telegram finds it again."""
        if self.found:
            self.changed()
            self.found = False
            self._events.append(BaudLost())

    # -- time --------------------------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        due = [self.class_two.next_deadline()]
        cyclic = self._cyclic
        if cyclic.watchdog_ns and cyclic.master != NO_MASTER:
            due.append(cyclic.heard_ns + cyclic.watchdog_ns)
        if self.found and self.options.silence_ns:
            due.append(self._heard_ns + self.options.silence_ns)
        return min((time for time in due if time is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        """Watchdog, baud rate, connections of class 2."""
        cyclic = self._cyclic
        if cyclic.watchdog_ns and cyclic.master != NO_MASTER and now - cyclic.heard_ns >= cyclic.watchdog_ns:
            self.leave(WATCHDOG)
        if self.found and self.options.silence_ns and now - self._heard_ns >= self.options.silence_ns:
            self.search()
        self.class_two.handle_timeout(now)

    # -- telegrams ---------------------------------------------------------------------------------------------------

    def receive(self, telegram: Line, now: int) -> Line | None:
        """The answer, None for a telegram that gets none."""
        self.changed()
        self._heard_ns = now
        if not self.found:
            self.found = True
            self._events.append(BaudFound())
        # what nearly all telegrams are comes first
        if (
            type(telegram) is Telegram
            and telegram.function & _ASKS_BITS in _ASKS
            and telegram.destination == self.address
        ):
            return self._once(telegram, now)
        if isinstance(telegram, (ShortAck, Token)) or not telegram.is_request:
            return None
        if telegram.destination == BROADCAST:
            if telegram.code in _SDN:
                self._without_answer(telegram, now)
            return None
        if telegram.destination != self.address:
            return None
        if telegram.code in _SDN:
            self._without_answer(telegram, now)
            return None
        if telegram.code == Request.FDL_STATUS:
            return self._short(telegram, Answer.OK)
        if telegram.code in _SDA:
            self.dropped[_NOT_HERE] += 1
            return self._short(telegram, Answer.RS)
        # functions that chips of slaves do not know get no answer
        self.dropped["unknown-function"] += 1
        return None

    def poll(self, source: int, function: int, data: bytes, now: int) -> bytes | None:
        """Inputs for a Data_Exchange that is like the ones before: :meth:`receive` in its shortest form.

        None, and nothing done, where it is anything else: a repetition, a request of another master, a diagnosis to
        tell, Clear, Sync, Freeze, a change of state.
        """
        cyclic = self._cyclic
        if (
            self.state is not DpState.DATA_EXCH
            or source != cyclic.master
            or not cyclic.exchanged
            or cyclic.clear
            or cyclic.sync
            or cyclic.frozen is not None
            or self._pending_diagnosis
            or self._events
            or not self.found
            or function & _ASKS_BITS not in _ASKS
            or len(data) != self.user.output_octets
        ):
            return None
        known, fcb = self._remembered.get(source), function & FCB
        if known is None or (function & FCV and known.fcb == fcb):
            return None
        self.user.take_outputs(data, now)
        inputs = self.user.inputs()
        self.user.exchanged(now)
        self.polled(source, fcb, data, inputs, now)
        return inputs

    def polled(self, source: int, fcb: int, outputs: bytes, inputs: bytes, now: int) -> None:
        """Such a Data_Exchange was answered with these inputs."""
        self._heard_ns = self._cyclic.heard_ns = now
        self._cyclic.held = outputs
        known = self._remembered[source]
        known.fcb = fcb
        known.answer = Telegram(source, self.address, Answer.DL, None, None, inputs)

    def _once(self, telegram: Telegram, now: int) -> Line | None:
        """A repeated request is answered as before (4.7.1.2: FCB, FCV)."""
        fcb = telegram.function & FCB
        known = self._remembered.get(telegram.source)
        if telegram.function & FCV and known is not None and known.fcb == fcb:
            self.repeated += 1
            self._alive(telegram.source, now)
            return known.answer
        answer = self._answer(telegram, now)
        if known is None:
            # addresses have seven bits, so that there are no more masters than these
            self._remembered[telegram.source] = _Remembered(fcb, answer)
        else:
            known.fcb, known.answer = fcb, answer
        if self._new_address is not None:
            self.address, self._new_address = self._new_address, None
        return answer

    def _answer(self, telegram: Telegram, now: int) -> Line:
        self._alive(telegram.source, now)
        if telegram.dsap is None and telegram.ssap is None:
            return self._data_exchange(telegram, now)
        match telegram.dsap, telegram.ssap:
            case Sap.SLAVE_DIAGNOSIS, Sap.MASTER:
                return self._data(telegram, self._diagnosis(telegram.source))
            case Sap.SET_PARAMETERS, Sap.MASTER:
                return self._set_parameters(telegram, now)
            case Sap.CHECK_CONFIGURATION, Sap.MASTER:
                return self._check_configuration(telegram)
            case Sap.GET_CONFIGURATION, Sap.MASTER:
                return self._data(telegram, self.user.configuration())
            case Sap.READ_INPUTS, Sap.MASTER if self.state is DpState.DATA_EXCH:
                return self._data(telegram, self._inputs())
            case Sap.READ_OUTPUTS, Sap.MASTER if self.exchanging:
                return self._data(telegram, self._cyclic.held or bytes(self.user.output_octets))
            case Sap.SET_SLAVE_ADDRESS, Sap.MASTER if self._takes_address():
                return self._set_address(telegram)
            case Sap.MSAC1, Sap.MSAC1 if self._class_one_open(telegram.source):
                return self.class_one.request(telegram, now)
            case (sap, Sap.MASTER_2) if self.options.v1:
                return self.class_two.request(telegram, sap, now)
            case (Sap.MASTER_2, sap) if self.options.v1 and self.options.class_two_exchanged:
                return self.class_two.request(telegram, sap, now)
        self.dropped[_NOT_HERE] += 1
        return self._short(telegram, Answer.RS)

    def _alive(self, master: int, now: int) -> None:
        if master == self._cyclic.master:
            self._cyclic.heard_ns = now

    # -- answers -----------------------------------------------------------------------------------------------------

    @staticmethod
    def _short(telegram: Telegram, answer: Answer) -> Telegram:
        return Telegram(telegram.source, telegram.destination, answer)

    @staticmethod
    def _data(telegram: Telegram, data: bytes, answer: Answer = Answer.DL) -> Line:
        """Access points of an answer are those of the request, exchanged."""
        if not data:
            return ShortAck()
        return Telegram(telegram.source, telegram.destination, answer, telegram.ssap, telegram.dsap, data)

    def answer_data(self, telegram: Telegram, data: bytes) -> Line:
        """An answer with data of the services of DP-V1."""
        return self._data(telegram, data)

    def answer_without(self, telegram: Telegram, answer: Answer) -> Line:
        """An answer of theirs without."""
        return self._short(telegram, answer)

    # -- Data_Exchange -----------------------------------------------------------------------------------------------

    def _data_exchange(self, telegram: Telegram, now: int) -> Line:
        cyclic = self._cyclic
        if self.state is not DpState.DATA_EXCH or telegram.source != cyclic.master:
            self.dropped[_NOT_HERE] += 1
            return self._short(telegram, Answer.RS)
        data = telegram.data
        wanted = self.user.output_octets
        parameters = cyclic.parameters
        fail_safe = (
            wanted > 0
            and not data
            and self.options.supports_fail_safe
            and parameters is not None
            # without DP-V1 its GSD file alone says that it takes such outputs
            and (not self.options.v1 or bool(parameters.v1[0] & V1Status1.FAIL_SAFE))
        )
        if len(data) != wanted and not fail_safe:
            self.leave(BAD_LENGTH)
            return self._short(telegram, Answer.RS)
        if not cyclic.exchanged:
            cyclic.exchanged = True
            self._events.append(ExchangeBegan(cyclic.master))
        if fail_safe or cyclic.clear:
            cyclic.held, cyclic.waiting = bytes(wanted), None
            self.user.clear_outputs(now)
        elif not cyclic.sync:
            cyclic.held = data
            self.user.take_outputs(data, now)
        else:
            cyclic.waiting = data
        inputs = self._inputs()
        self.user.exchanged(now)
        if not self._pending_diagnosis:
            return self._data(telegram, inputs)
        # one octet that means nothing carries the priority where there are no inputs (8.3.6)
        return self._data(telegram, inputs or b"\0", Answer.DH)

    def _inputs(self) -> bytes:
        return self._cyclic.frozen if self._cyclic.frozen is not None else self.user.inputs()

    # -- diagnosis ---------------------------------------------------------------------------------------------------

    def _diagnosis(self, master: int) -> bytes:
        """Bits of a slave's own: Master_Lock and others are set by the master that reads it (8.3.1)."""
        self.diagnoses += 1
        cyclic, faults = self._cyclic, self.faults
        is_error, is_static, extended = self.user.diagnosis()
        status = (
            _ALWAYS_1
            | _STATION_NOT_READY * (self.state is not DpState.DATA_EXCH)
            | _CFG_FAULT * faults.configuration
            | _EXT_DIAG * is_error
            | _NOT_SUPPORTED * faults.unsupported
            | _PRM_FAULT * faults.parameters
            | _PRM_REQ * (self.state is DpState.WAIT_PRM)
            | _STAT_DIAG * is_static
            | _WD_ON * bool(cyclic.watchdog_ns)
            | _FREEZE_MODE * cyclic.freeze
            | _SYNC_MODE * cyclic.sync
            | _EXT_DIAG_OVERFLOW * (len(extended) > MOST_DIAGNOSIS - 6)
        )
        if cyclic.master in {master, NO_MASTER}:
            self._pending_diagnosis = is_static
        return diagnosis_octets(status, cyclic.master, self.options.ident, extended[: MOST_DIAGNOSIS - 6])

    # -- parameters and configuration --------------------------------------------------------------------------------

    def _set_parameters(self, telegram: Telegram, now: int) -> Line:
        try:
            parameters = Parameters.parse(telegram.data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return ShortAck()
        cyclic = self._cyclic
        if cyclic.master not in {NO_MASTER, telegram.source}:
            # it belongs to another master, whose address the diagnosis has
            self.dropped["locked"] += 1
            return ShortAck()
        if parameters.status & PrmStatus.UNLOCK_REQ:
            if cyclic.master != NO_MASTER:
                self.leave(UNLOCKED)
            return ShortAck()
        if not parameters.status & PrmStatus.LOCK_REQ:
            # only the time of the answer changes (8.3.3, table of Lock_Req and Unlock_Req)
            self._set_min_tsdr(parameters)
            return ShortAck()
        wrong = self._parameters_wrong(parameters)
        if wrong is not None:
            self.leave(PARAMETERS_WRONG, sign=_Sign.NO_PARAMETERS)
            self.faults.parameters = True
            self.refusals += 1
            self._events.append(ParametersRefused(telegram.source, wrong, parameters.ident))
            return ShortAck()
        if self.state is DpState.DATA_EXCH:
            self.leave(PARAMETERS_AGAIN)
        self.faults = _Faults()
        self._set_min_tsdr(parameters)
        watchdog_ns = parameters.watchdog_ns(v1=self.options.v1)
        self._cyclic = _Cyclic(telegram.source, parameters, watchdog_ns, now)
        self._go(_Sign.PARAMETERS)
        self._events.append(ParametersTaken(telegram.source, parameters, watchdog_ns))
        return ShortAck()

    def _parameters_wrong(self, parameters: Parameters) -> str | None:
        options = self.options
        self.faults.unsupported = False
        if self.refuse_parameters is not None:
            return self.refuse_parameters
        if self.refuse_set_up is not None and (refused := self.refuse_set_up()) is not None:
            return refused
        if parameters.ident != options.ident:
            return f"ident number 0x{parameters.ident:04X} instead of 0x{options.ident:04X}"
        unsupported = _unsupported(parameters, options)
        if unsupported:
            self.faults.unsupported = True
            return f"{' and '.join(unsupported)} not supported"
        if parameters.status & PrmStatus.WD_ON and 0 in parameters.factors:
            return "a watchdog with a factor of 0"
        return self.user.check_parameters(parameters)

    def _set_min_tsdr(self, parameters: Parameters) -> None:
        if parameters.min_tsdr:
            self._min_tsdr_bits = max(LEAST_TSDR_BITS, parameters.min_tsdr)

    def _check_configuration(self, telegram: Telegram) -> Line:
        if self.state is DpState.WAIT_PRM or telegram.source != self._cyclic.master:
            self.dropped[_NOT_HERE] += 1
            return self._short(telegram, Answer.RS)
        before = self.user.configuration()
        if self.refuse_configuration or not self.user.check_configuration(telegram.data):
            self.leave(CONFIGURED_WRONG, sign=_Sign.NO_CONFIGURATION)
            self.faults.configuration = True
            self.refusals += 1
            self._events.append(ConfigurationRefused(telegram.source, telegram.data))
            return ShortAck()
        if telegram.data != before:
            # what was held or frozen is of another length
            cyclic = self._cyclic
            cyclic.held = cyclic.waiting = cyclic.frozen = None
            cyclic.sync = cyclic.freeze = False
        self._go(_Sign.CONFIGURATION)
        return ShortAck()

    def _takes_address(self) -> bool:
        return self.state is DpState.WAIT_PRM and self.options.address_changes and not self.address_locked

    def _set_address(self, telegram: Telegram) -> Line:
        try:
            wanted = SetAddress.parse(telegram.data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return ShortAck()
        if wanted.ident != self.options.ident or wanted.address > 125:
            self.dropped["wrong-ident"] += 1
            return ShortAck()
        self._new_address = wanted.address
        self.address_locked = wanted.locks
        self._events.append(AddressSet(wanted.address, wanted.locks, telegram.source))
        return ShortAck()

    # -- Global_Control ----------------------------------------------------------------------------------------------

    def _without_answer(self, telegram: Telegram, now: int) -> None:
        if telegram.dsap != Sap.GLOBAL_CONTROL or telegram.ssap != Sap.MASTER:
            self.dropped[_NOT_HERE] += 1
            return
        try:
            control = GlobalControl.parse(telegram.data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        cyclic = self._cyclic
        if self.state is not DpState.DATA_EXCH or telegram.source != cyclic.master or cyclic.parameters is None:
            return
        if control.groups and not control.groups & cyclic.parameters.group:
            return
        self._alive(telegram.source, now)
        command = control.command
        clear = bool(command & Control.CLEAR_DATA)
        if clear != cyclic.clear:
            cyclic.clear = clear
            self._events.append(ClearChanged(clear))
            if clear:
                cyclic.held, cyclic.waiting = bytes(self.user.output_octets), None
                self.user.clear_outputs(now)
        allowed = cyclic.parameters.status
        if allowed & PrmStatus.SYNC_REQ:
            if command & Control.UNSYNC:
                cyclic.sync = False
            elif command & Control.SYNC:
                cyclic.sync = True
            if command & (Control.SYNC | Control.UNSYNC) and cyclic.waiting is not None:
                cyclic.held, cyclic.waiting = cyclic.waiting, None
                self.user.take_outputs(cyclic.held, now)
        if allowed & PrmStatus.FREEZE_REQ:
            if command & Control.UNFREEZE:
                cyclic.freeze, cyclic.frozen = False, None
            elif command & Control.FREEZE:
                cyclic.freeze, cyclic.frozen = True, self.user.inputs()

    # -- the state ---------------------------------------------------------------------------------------------------

    def _class_one_open(self, source: int) -> bool:
        mine = self.state is DpState.DATA_EXCH and source == self._cyclic.master
        return mine and self.v1_enabled and self.options.class_one

    def _go(self, sign: _Sign) -> None:
        """The only place that changes the state."""
        following = TRANSITIONS.get((self.state, sign))
        if following is None:
            raise InternalError(f"a slave in {self.state.name} got {sign.name}")
        self.state = following

    def leave(self, why: str = LEFT, *, sign: _Sign = _Sign.LEAVE) -> None:
        """Wait for parameters again, as after power-on."""
        self.changed()
        cyclic, before = self._cyclic, self.state
        self._go(sign)
        self._cyclic = _Cyclic()
        self._pending_diagnosis = False
        self.class_one.reset()
        if before is not DpState.WAIT_PRM:
            self._events.append(Left(why, before, cyclic.master, cyclic.exchanged))


def _unsupported(parameters: Parameters, options: SlaveOptions) -> list[str]:
    """What a Set_Prm asks for and the slave lacks; the octets of DP-V1 count where it is enabled.

    Those of a slave without it are its user's.
    """
    asked, (one, _, three) = parameters.status, parameters.v1
    v1 = options.v1 and bool(one & V1Status1.DPV1_ENABLE)
    lacks = {
        "freeze": asked & PrmStatus.FREEZE_REQ and not options.supports_freeze,
        "sync": asked & PrmStatus.SYNC_REQ and not options.supports_sync,
        "fail-safe outputs": v1 and one & V1Status1.FAIL_SAFE and not options.supports_fail_safe,
        "slave-to-slave communication": v1 and one & V1Status1.PUBLISHER,
        "isochronous mode": v1 and three & V1Status3.ISOCHRONOUS,
    }
    return [name for name, is_lacking in lacks.items() if is_lacking]
