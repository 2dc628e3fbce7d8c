"""What is behind a slave: a drive with its axis, or a station that a maker's file describes.

Below this interface nothing knows which.  A kind gives the device the slave's options and its user, and hears of what
concerns these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.protocols.profibus.slave_user import SlaveUser
from pnfarm.protocols.profibus.wire.dp import HEAD_OCTETS, MOST_DIAGNOSIS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.buses.profibus.device.lamps import LampState
    from pnfarm.buses.profibus.device.station_address import StationAddress
    from pnfarm.protocols.profibus.slave_user import SlaveOptions
    from pnfarm.protocols.profibus.wire.dp import Parameters

__all__ = ["Kind", "Meddling", "StationUser"]


class Meddling:
    """What injections do to a user; both kinds of users have it.

    ``error`` refuses records, with ``given`` called for each; ``withhold`` holds answers of a client back, and ``gone``
    is notified when a client stops waiting.
    """

    def __init__(self) -> None:
        self.error: tuple[int, int] | None = None
        self.withhold: Callable[[int, int], bool] | None = None
        self.gone: Callable[[int], None] = lambda _client: None
        self.given: Callable[[], None] = lambda: None
        #: Diagnosis that an injection adds: octets of a block, and whether data exchange makes no sense.
        self.further_diagnosis = b""
        self.static_diagnosis = False
        #: Most octets of it.
        self.most_further = MOST_DIAGNOSIS - HEAD_OCTETS

    def client_gone(self, client: int) -> None:
        self.gone(client)


class StationUser(SlaveUser, Protocol):
    """A :class:`SlaveUser` that injections can meddle with."""

    error: tuple[int, int] | None
    withhold: Callable[[int, int], bool] | None
    gone: Callable[[int], None]
    given: Callable[[], None]
    further_diagnosis: bytes
    most_further: int
    static_diagnosis: bool


class Kind(Protocol):
    """See the module's docstring.  ``number`` is the telegram in force, for the log; 0 where there is none."""

    #: Whether answers with eight octets of data go as SD3.
    fixed_length: bool
    #: Where the farm file says what octets of Set_Prm are right.
    parameters_key: tuple[str, ...]

    @property
    def user(self) -> StationUser:
        """New at each power-on."""

    @property
    def number(self) -> int: ...

    @property
    def reports_faults(self) -> bool:
        """Whether the diagnosis reports faults of the drive."""

    def check(self, kept: Mapping[str, Any]) -> None:
        """Raises :class:`KeptValueError` for a memory that is not of this kind."""

    def commission(self, kept: Mapping[str, Any]) -> None:
        """Memory is read and the farm file not yet applied."""

    def address(self, kept: Mapping[str, Any]) -> StationAddress:
        """Power-on: the address from now on."""

    def build(self, image: CyclicImage) -> SlaveOptions:
        """Power-on: what the slave is; makes the user."""

    # -- time: of answers to requests for parameters

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""

    def handle_timeout(self, now: int) -> None: ...

    # -- the slave's life

    def follow(self) -> None:
        """What the last Chk_Cfg named is in force from now on."""

    def layout(self) -> None:
        """Other cyclic data are in force."""

    def rate_known(self, baud: int) -> None:
        """The rate that was found, 0 while none is."""

    def parametrised(self, parameters: Parameters) -> str | None:
        """A Set_Prm was taken; what is wrong with it nevertheless."""

    def began(self) -> None:
        """The first Data_Exchange."""

    def cycle_known(self, mean_ns: int) -> None:
        """The mean time between polls; only while data are exchanged."""

    def expired(self) -> None:
        """The watchdog ended a data exchange."""

    def ended(self) -> None:
        """Data exchange is over, whatever ended it, or never began."""

    def difference(self, identifiers: bytes) -> tuple[int, str] | None:
        """The first slot where other identifiers differ from its own, and the farm file's name of the module that has
        them; None where the farm file names no modules.
        """

    def readdressed(self, address: int, now: int) -> None:
        """Set_Slave_Add: keep the address."""

    # -- the axis and observers

    def parameter_task(self, value: int, now: int) -> None:
        """A task of the cyclic parameter channel."""

    def diagnosis(self, name: str, slot: int, channel: int) -> bytes:
        """Blocks of a diagnosis by its name in the maker's file; raises :class:`ConfigError`."""

    def lamps(self, state: LampState) -> Mapping[str, str]:
        """Each lamp by its name, and how it is lit."""

    def details(self) -> Mapping[str, Any]:
        """What only this kind shows."""
