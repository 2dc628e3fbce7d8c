"""What a slave needs of the station behind it, and what happens to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pnfarm.protocols.profibus.wire.dp import NO_MASTER, DpState

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.wire.dp import Parameters

__all__ = [
    "AcyclicClosed", "AcyclicOpened", "AddressSet", "BaudFound", "BaudLost", "ClearChanged", "ConfigurationRefused",
    "ExchangeBegan", "Left", "ParametersRefused", "ParametersTaken", "RecordRefusedError", "SlaveEvent", "SlaveOptions",
    "SlaveUser",
]  # fmt: skip


class RecordRefusedError(Exception):
    """A record cannot be read or written; the codes go into the negative response."""

    def __init__(self, code1: int, code2: int = 0) -> None:
        super().__init__(f"0x{code1:02x} 0x{code2:02x}")
        self.code1 = code1
        self.code2 = code2


@dataclass(slots=True)
class SlaveOptions:
    """What a slave is; injections replace some of it.

    ``silence_ns``: without a good telegram for so long, the slave seeks the baud rate again.  ``address_changes``:
    whether Set_Slave_Add is taken.  ``class_one``: whether it has records within its cyclic connection;
    ``connections``: of masters of class 2.  ``class_two_exchanged``: their requests
    are taken with DSAP and SSAP exchanged, too.
    """

    ident: int
    supports_freeze: bool = True
    supports_sync: bool = True
    supports_fail_safe: bool = False
    address_changes: bool = True
    v1: bool = True
    class_one: bool = True
    connections: int = 4
    longest_record: int = 240
    send_timeout_ns: int = 1_000_000_000
    class_two_exchanged: bool = False
    silence_ns: int = 5_000_000_000


class SlaveUser(Protocol):
    """The station behind a slave.  ``client``: 0 within the cyclic connection, else a connection of class 2."""

    def check_parameters(self, parameters: Parameters) -> str | None:
        """Why the user's part of Set_Prm does not fit, None if it does."""

    def check_configuration(self, identifiers: bytes) -> bool:
        """Whether these identifiers fit; if so, they are in force once the answer has left."""

    def configuration(self) -> bytes:
        """The identifiers in force (Get_Cfg)."""

    @property
    def output_octets(self) -> int:
        """Length of the outputs in force."""

    def take_outputs(self, data: bytes, now: int) -> None:
        """Outputs of that length."""

    def clear_outputs(self, now: int) -> None:
        """The master is in Clear, or sends empty outputs."""

    def inputs(self) -> bytes:
        """Inputs as they are now."""

    def exchanged(self, now: int) -> None:
        """A Data_Exchange was answered, also one whose outputs wait for Sync, or whose inputs Freeze holds."""

    def diagnosis(self) -> tuple[bool, bool, bytes]:
        """Whether there is an error (Ext_Diag), whether data exchange makes no sense (Stat_Diag), extended octets."""

    def read_record(self, slot: int, index: int, length: int, client: int, now: int) -> bytes | None:
        """A record; None while it is not ready.  Raises :class:`RecordRefusedError`."""

    def write_record(self, slot: int, index: int, data: bytes, client: int, now: int) -> bool:
        """Write a record; False while it is not done yet.  Raises :class:`RecordRefusedError`."""

    def client_gone(self, client: int) -> None:
        """Its connection ended: drop what it asked for."""


@dataclass(frozen=True, slots=True)
class SlaveEvent:
    """Something happened to a slave."""


@dataclass(frozen=True, slots=True)
class BaudFound(SlaveEvent):
    """A telegram without error was heard: the slave answers from now on."""


@dataclass(frozen=True, slots=True)
class BaudLost(SlaveEvent):
    """No telegram without error for a while: the slave seeks the baud rate."""


@dataclass(frozen=True, slots=True)
class ParametersTaken(SlaveEvent):
    """Set_Prm fits; the slave waits for its configuration."""

    master: int
    parameters: Parameters
    #: 0 without one.
    watchdog_ns: int


@dataclass(frozen=True, slots=True)
class ParametersRefused(SlaveEvent):
    """Set_Prm does not fit (Prm_Fault); ``ident`` is the ident number that it names."""

    master: int
    why: str
    ident: int


@dataclass(frozen=True, slots=True)
class ConfigurationRefused(SlaveEvent):
    """Chk_Cfg does not fit (Cfg_Fault)."""

    master: int
    identifiers: bytes


@dataclass(frozen=True, slots=True)
class ExchangeBegan(SlaveEvent):
    """The first Data_Exchange."""

    master: int


@dataclass(frozen=True, slots=True)
class Left(SlaveEvent):
    """The slave waits for parameters again; ``why`` is one of the slugs of :mod:`pnfarm.protocols.profibus.slave`.

    ``before``: the state that it left; ``master`` is :data:`NO_MASTER` where none had parametrised it.
    """

    why: str
    before: DpState
    master: int = NO_MASTER
    #: Whether outputs had come.
    exchanged: bool = False


@dataclass(frozen=True, slots=True)
class ClearChanged(SlaveEvent):
    """The master went to Clear, or back to Operate."""

    clear: bool


@dataclass(frozen=True, slots=True)
class AddressSet(SlaveEvent):
    """Set_Slave_Add: the slave has this address from now on."""

    address: int
    locks: bool
    master: int = NO_MASTER


@dataclass(frozen=True, slots=True)
class AcyclicOpened(SlaveEvent):
    """A master of class 2 has a connection."""

    master: int
    sap: int


@dataclass(frozen=True, slots=True)
class AcyclicClosed(SlaveEvent):
    """It ended; ``reason``: instance and reason as in an Abort."""

    master: int
    sap: int
    reason: int
