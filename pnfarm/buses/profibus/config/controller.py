"""The controller's section on PROFIBUS: the master."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pnfarm.buses.profibus.config.drive import Address
from pnfarm.buses.profibus.config.foreign import GsdDevice
from pnfarm.config.controller import ControllerSection
from pnfarm.config.values import Duration, between

__all__ = ["ProfibusController"]

#: Station addresses of slaves.
MOST_SLAVES = 125

#: The watchdog's factors: 1 to 255 times 1 to 255 times 10 ms (EN 50170 part 2, 8.3.3).
LONGEST_WATCHDOG_NS = 255 * 255 * 10_000_000
LONGEST_CYCLE_NS, LONGEST_LATENCY_NS = 10_000_000_000, 1_000_000_000

Cycle = Annotated[Duration, between(100_000, LONGEST_CYCLE_NS, "100us to 10s")]
Watchdog = Annotated[Duration, between(1_000_000, LONGEST_WATCHDOG_NS, "0ms for none, or 1ms to 650s", zero=True)]
Latency = Annotated[Duration, between(0, LONGEST_LATENCY_NS, "0ms to 1s")]


class ProfibusController(ControllerSection):
    """The built-in PROFIBUS master, of class 1 and 2."""

    last_keys: ClassVar[tuple[str, ...]] = ("program", "devices", "reconnect")
    description_file: ClassVar[str] = "GSD"

    address: Address = Field(default=1, description="Its station address.")
    cycle_ns: Cycle = Field(
        default=10_000_000,
        alias="cycle",
        description="Shortest time between two polls of a slave; a slower line polls as fast as it can.",
    )
    watchdog_ns: Watchdog = Field(
        default=200_000_000,
        alias="watchdog",
        description="Time without a poll after which a slave clears its outputs, as exact as the factors of Set_Prm "
        "allow; 0ms: never.",
    )
    telegram: int | None = Field(
        default=None, ge=0, le=65535, description="Telegram of the drives; left out, the drive's own selection."
    )
    retries: Annotated[int, Field(ge=0, le=15)] = Field(
        default=1, description="How often a request without an answer is repeated."
    )
    latency_ns: Latency = Field(
        default=20_000_000,
        alias="latency",
        description="Time beyond the bus's own that an answer may take: of a pseudo-terminal, an adapter, a network.",
    )
    access: Literal["class-1", "class-2"] = Field(
        default="class-2",
        description="How parameters are read and written: within the cyclic connection (MSAC1), or by a connection of "
        "a master of class 2 (MSAC2).",
    )
    devices: list[GsdDevice] = Field(
        default_factory=list, max_length=MOST_SLAVES, description="Further slaves, each by its GSD file."
    )
