"""Links to which drives and controllers are attached."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Discriminator, Field, model_validator

from pnfarm.config.section import Section
from pnfarm.config.values import Duration, Interface
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

__all__ = [
    "LINK_KINDS", "USUAL_BAUD", "LineWay", "Link", "MacvlanLink", "MemoryLink", "SerialLink", "TapLink", "VethLink",
]  # fmt: skip

#: Rate of a line where the file says none.
USUAL_BAUD = 1_500_000
_HOST_PORT = re.compile(r"(?:\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


def _host_and_port(value: str) -> str:
    found = _HOST_PORT.fullmatch(value)
    if found is None or int(found[1]) > 0xFFFF:
        raise Problem(f"is {shown(value)}", "HOST:PORT")
    return value


def _reachable(value: str) -> str:
    if value.rpartition(":")[2].strip("0") == "":
        raise Problem(f"is {shown(value)}, and port 0 is reserved", "a port from 1 to 65535")
    return value


HostPort = Annotated[str, AfterValidator(_host_and_port)]
FarHostPort = Annotated[str, AfterValidator(_host_and_port), AfterValidator(_reachable)]


class LineWay(Section):
    """The way to a serial line: one of `pty`, `port`, `connect`, `listen` and `rfc2217`; left out, a pty."""

    pty: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="A pair of pseudo terminals that the farm makes: the path of a symbolic link to its far end, or "
        "`auto` for none; the log has the path.",
    )
    port: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="A serial port, such as the /dev/ttyUSB0 of an RS-485 adapter, or a pty's far end."
    )
    connect: FarHostPort | None = Field(default=None, description="TCP, octets as they are, to this HOST:PORT.")
    listen: HostPort | None = Field(default=None, description="TCP from a client, at this HOST:PORT.")
    rfc2217: FarHostPort | None = Field(
        default=None, description="A serial port behind a terminal server that speaks RFC 2217, at this HOST:PORT."
    )
    baud: Annotated[int, Field(ge=9_600, le=12_000_000)] | Literal["auto"] = Field(
        default=USUAL_BAUD,
        description="Bits per second; a pty and TCP have no rate, and take their times from it.  `auto`, for a port "
        "only: the master's rate, found by trying.",
    )
    latest_answer: Literal["auto", "tsdr", "any"] | Duration = Field(
        default="auto",
        description="Time after a request within which a drive's answer must begin; a later one is withheld and "
        "counted. `tsdr`: what the bus permits at this rate; `any`: none is withheld. `auto`: `tsdr` on a port up to "
        "1.5 Mbit/s and on a pty up to 500 kbit/s, otherwise `any`.",
        examples=["auto", "5ms"],
    )

    @property
    def rate(self) -> int:
        """The rate to begin with."""
        return USUAL_BAUD if self.baud == "auto" else self.baud

    @model_validator(mode="after")
    def _one_way(self) -> LineWay:
        given = [key for key in ("pty", "port", "connect", "listen", "rfc2217") if getattr(self, key) is not None]
        if len(given) > 1:
            raise Problem(f"has {' and '.join(given)}", "one of pty, port, connect, listen, rfc2217")
        if self.latest_answer == 0:
            raise Problem("has `latest_answer: 0`, but every answer takes some time", "tsdr, any, or such as 5ms")
        if self.baud == "auto" and self.port is None and self.rfc2217 is None:
            raise Problem("has `baud: auto`, but no port whose rate can be tried", "port or rfc2217, or a rate")
        return self


class _WithLines(Section):
    """A link beside which drives of other buses have a serial line."""

    lines: dict[str, LineWay] = Field(
        default_factory=dict,
        description="Serial lines for drives of buses that have one, by the name of the bus.",
        examples=[{"profibus": {"pty": "auto"}}],
    )


class MacvlanLink(_WithLines):
    """One macvlan per drive on an interface of this machine: the drives are on the real network."""

    kind: Literal["macvlan"]
    parent: Interface = Field(description="Parent interface, such as eth1; it must be up.")
    send: Literal["auto", "parent", "own", "xdp"] = Field(
        default="auto",
        description="Where cyclic frames and LLDP leave: each drive's own interface, or the parent, which costs less "
        "but does not reach another macvlan on it. `auto`: the parent, unless the peer is such a macvlan. `xdp`: as "
        "auto, and through the parent by AF_XDP, which costs another fifth less; `tcpdump` on the parent does not show "
        "these frames. With a capture, own.",
    )


class VethLink(_WithLines):
    """One veth pair per drive, joined by a bridge: a farm and a controller on one machine."""

    kind: Literal["veth"]
    bridge: Interface | None = Field(
        default=None, description="Existing bridge to join; left out, the farm makes its own."
    )


class TapLink(_WithLines):
    """One TAP per drive: for virtual machines, or where no other interface can be made.  Slower."""

    kind: Literal["tap"]
    bridge: Interface | None = Field(default=None, description="Existing bridge to join; left out, the TAPs join none.")


class MemoryLink(Section):
    """No network and no rights: the drives and the file's controller in one process, on one clock."""

    kind: Literal["memory"]
    baud: Annotated[int, Field(ge=9_600, le=12_000_000)] = Field(
        default=USUAL_BAUD, description="Rate of serial lines, bit/s."
    )


class SerialLink(LineWay):
    """One serial line that all drives share, and nothing else."""

    kind: Literal["serial"]


Link = Annotated[MacvlanLink | VethLink | TapLink | MemoryLink | SerialLink, Discriminator("kind")]


#: By the value of `kind`, as messages list them.
LINK_KINDS: dict[str, type[MacvlanLink | VethLink | TapLink | MemoryLink | SerialLink]] = {
    "macvlan": MacvlanLink,
    "veth": VethLink,
    "tap": TapLink,
    "memory": MemoryLink,
    "serial": SerialLink,
}
