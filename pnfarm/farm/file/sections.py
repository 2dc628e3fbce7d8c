"""The farm file as types: every key with its unit, its default and its bounds.

What one value says stands here; what several say together is checked in :mod:`pnfarm.farm.file.expand`.
Keys are the file's; where a number leaves its unit behind, the attribute carries the unit (``cycle`` -> ``cycle_ns``).
"""

from __future__ import annotations

import re
from ipaddress import ip_address
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)

from pnfarm.buses.profinet.config.clock import MAX_DATA_HOLD_FACTOR
from pnfarm.buses.profinet.config.values import Cycle
from pnfarm.config.axis import Load, Motor
from pnfarm.config.machine import Machine
from pnfarm.config.realism import DriveRealism, Realism
from pnfarm.config.section import Section
from pnfarm.config.tasks import Task
from pnfarm.config.values import (
    AUTO,
    Cidr,
    Duration,
    FarmName,
    Gateway,
    Interface,
    Listen,
    MacSetting,
    NamePattern,
    OctetString,
    Scalar,
)
from pnfarm.table.program import TARGETS
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.globs import GLOBS_SCHEMA, read_globs
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.wire.direction import Directions

__all__ = [
    "DEFAULT_CYCLE_NS",
    "DEFAULT_LISTEN",
    "DEFAULT_READY_NS",
    "FAULT_KINDS",
    "MAX_DRIVES",
    "OFF",
    "Api",
    "ControllerSection",
    "DriveGroup",
    "FarmSections",
    "ForeignDevice",
    "Impairment",
    "Link",
    "Load",
    "MacvlanLink",
    "MemoryLink",
    "Motor",
    "ParameterRecord",
    "Program",
    "Realtime",
    "Reconnect",
    "TapLink",
    "VethLink",
]

#: Drives of one farm.
MAX_DRIVES = 4094
#: AKD PROFINET manual 4.2.2: the fastest cycle of the drive that the built-in controller is for first.
DEFAULT_CYCLE_NS = 16_000_000

#: How long a device may take to be ready when neither the file nor its GSDML file says it.
DEFAULT_READY_NS = 20_000_000_000

#: Where the API is served when a file says nothing.
DEFAULT_LISTEN = "127.0.0.1:8702"
#: The word that switches a section off; ``false`` says the same, for editors that read YAML 1.1.
OFF = "off"

#: Key of the validation context: the kinds of the fault catalogue, or None where nobody asks.
FAULT_KINDS = "fault_kinds"

_U16 = 0xFFFF
_U32 = 0xFFFF_FFFF


# --- link -------------------------------------------------------------------------------------------------------


class MacvlanLink(Section):
    """One macvlan per drive on an interface of this machine: the drives stand on the real wire."""

    kind: Literal["macvlan"]
    parent: Interface = Field(description="Interface that carries the drives, such as eth1; it must be up.")
    transmit: Literal["interface", "parent"] = Field(
        default="interface",
        description="Where cyclic frames leave: each drive's own interface, or the parent, which costs less "
        "but does not reach a controller on this machine.",
    )


class VethLink(Section):
    """One veth pair per drive, joined by a bridge: a farm and a controller on one machine."""

    kind: Literal["veth"]
    bridge: Interface | None = Field(
        default=None, description="Existing bridge to join; left out, the farm makes its own."
    )


class TapLink(Section):
    """One TAP per drive: for virtual machines, or where no other interface can be made.  Slower."""

    kind: Literal["tap"]
    bridge: Interface | None = Field(
        default=None, description="Existing bridge to join; left out, the TAPs stand alone."
    )


class MemoryLink(Section):
    """No wire: drives and controller in one process, in virtual time."""

    kind: Literal["memory"]


Link = Annotated[MacvlanLink | VethLink | TapLink | MemoryLink, Discriminator("kind")]


# --- the farm's own sections ------------------------------------------------------------------------------------


class Api(Section):
    """Where the HTTP API, the metrics and the web page are served."""

    listen: Listen = Field(description="HOST:PORT; port 0 takes any free one.")
    token: str | None = Field(
        default=None,
        min_length=8,
        max_length=512,
        description="Bearer token that a client must show; left out, a port beyond loopback gets one.",
    )
    token_file: str | None = Field(
        default=None,
        min_length=1,
        max_length=4096,
        description="File of the token, relative to this file: made at the first start where there is none, and holds "
        "`token` where that is given. Left out, api-token in the folder of `state`, for a port beyond loopback.",
    )

    @field_validator("token")
    @classmethod
    def _can_be_sent(cls, token: str | None) -> str | None:
        if token is not None and not all("!" <= letter <= "~" for letter in token):
            raise Problem("has characters that no header can carry", "letters, digits and signs of ASCII, no blanks")
        return token

    @property
    def host(self) -> str:
        """The address to bind to."""
        return self.listen[0]

    @property
    def port(self) -> int:
        """The TCP port, 0 for any free one."""
        return self.listen[1]

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"


def _open_api(value: Any) -> Any:
    """The short forms: ``off``, and an address alone."""
    if value is False or value == OFF:
        return None
    if isinstance(value, (dict, Api)):
        return value
    return {"listen": value}


class Realtime(Section):
    """How the cyclic engine's thread runs.  `pnfarm doctor` says what this machine permits."""

    cpu: int | None = Field(default=None, ge=0, le=4095, description="CPU to stay on; left out, any.")
    fifo: int | None = Field(
        default=None, ge=1, le=99, description="SCHED_FIFO priority; left out, the ordinary scheduler."
    )
    nice: int | None = Field(
        default=-11,
        ge=-20,
        le=19,
        description="Niceness of the engine's thread under the ordinary scheduler; it may be refused.",
    )
    mlockall: bool = Field(default=False, description="Keep all memory in RAM.")
    timestamps: bool | None = Field(
        default=None,
        description="Let the kernel stamp each frame, so that intervals are the controller's own; without, they are as "
        "exact as the engine's ticks. Left out: with up to 128 drives, where the cost does not matter.",
    )
    timer_slack_ns: int = Field(
        default=1, ge=1, le=1_000_000_000, description="How late the kernel may wake the engine, nanoseconds."
    )


# --- drives -----------------------------------------------------------------------------------------------------


Globs = Annotated[list[str], PlainValidator(read_globs), WithJsonSchema(GLOBS_SCHEMA)]


def _read_kind(value: Any, info: ValidationInfo) -> str:
    allowed = "a kind of `pnfarm fault kinds`, such as loss or f702"
    if not isinstance(value, str) or not _KIND.fullmatch(value):
        raise Problem(f"{shown(value)} is no kind of fault", allowed)
    kinds = (info.context or {}).get(FAULT_KINDS)
    if kinds is not None and value not in kinds:
        raise Problem(f"{shown(value)} is no kind of fault{did_you_mean(value, kinds)}", allowed)
    return value


_KIND = re.compile(r"[a-z0-9][a-z0-9-]*")
FaultKind = Annotated[
    str, PlainValidator(_read_kind), WithJsonSchema({"type": "string", "pattern": f"^{_KIND.pattern}$"})
]


class Impairment(Section):
    """A fault that is there from the start; the kinds are those of `pnfarm fault kinds`."""

    kind: FaultKind = Field(description="What it does, such as loss or f702.")
    on: Globs | None = Field(default=None, description="Which drives; left out, all of the group.")
    params: dict[str, Scalar] = Field(default_factory=dict, description="The kind's own parameters.")
    probability: float | None = Field(default=None, gt=0, le=1, description="Of each occurrence.")
    seed: int | None = Field(default=None, ge=0, le=(1 << 64) - 1, description="Makes the same run twice.")
    direction: Directions | None = Field(default=None, description="Seen from the drive.")
    after_cycles: int | None = Field(default=None, ge=0, description="Healthy cycles to let pass first.")
    after_ns: Duration | None = Field(default=None, alias="after", description="Time to let pass first.")
    count: int | None = Field(default=None, ge=1, description="Occurrences, then it ends.")
    for_ns: Duration | None = Field(default=None, alias="for", description="How long, then it ends.")
    cycles: int | None = Field(default=None, ge=1, description="Cycles, then it ends.")


ParameterLists = dict[str, Annotated[str, Field(min_length=1, max_length=4096)]]
Identity = Annotated[dict[str, Any], Field(description="What the drive says it is, where it is not the model's own.")]


class DriveGroup(Section):
    """One drive, or `count` alike."""

    name: NamePattern = Field(description="Station name; {n} counts, {n:02} with leading zeros.")
    count: int = Field(default=1, ge=1, le=MAX_DRIVES, description="How many.")
    start: int = Field(default=1, ge=0, le=1_000_000, description="First number that {n} takes.")
    model: str = Field(description="Drive model, one of `pnfarm models`.", examples=["akd-profinet"])
    ip: Cidr | None = Field(
        default=None, description="First drive's address; counts up.  Left out, the drive waits for DCP."
    )
    gateway: Gateway | None = Field(default=None, description="Router of the subnet.")
    mac: MacSetting = Field(
        default=AUTO, description="auto: stable, locally administered; or the first drive's address, which counts up."
    )
    load: Load = Field(default_factory=Load)
    motor: Motor = Field(default_factory=Motor)
    machine: Machine = Field(default_factory=Machine)
    limits: Literal["strict", "lax"] = Field(
        default="strict", description="strict: refuse what the manual denies; lax: for load tests."
    )
    identity: Identity = Field(default_factory=dict)
    realism: DriveRealism = Field(
        default_factory=Realism,
        description="What makes the drives less than ideal; `on`: all that the model has, `off`: nothing. Left out, "
        "what a source gives a figure for (`pnfarm models MODEL`) on a real link and with strict limits, else nothing.",
    )
    params: dict[str, Scalar] = Field(
        default_factory=dict,
        description="Parameters at power-on, by the manual's name or by number: whole numbers as on the wire; a number "
        "with a point is that of a float parameter itself.",
        examples=[{"DRV.OPMODE": 1}],
    )
    motion_tasks: list[Task] = Field(
        default_factory=list, description="Motion tasks in the drive, as a commissioning tool leaves them there."
    )
    behaviour: dict[str, str] = Field(
        default_factory=dict,
        description="What the drive does where its manual leaves it open: reading by point; `pnfarm models MODEL` "
        "and docs/behaviour.md list them.",
        examples=[{"control-by-plc": "hold"}],
    )
    impair: list[Impairment] = Field(default_factory=list, description="Impairments from the start.")
    telegram: int | None = Field(default=None, ge=0, le=_U16, description="PROFIdrive telegram; left out, the model's.")
    hello: bool = Field(
        default=False,
        description="Whether the drive says DCP Hello at power-on; a controller's fast start-up record overrides it.",
    )
    cycle_ns: Cycle | None = Field(
        default=None, alias="cycle", description="Cycle at which the built-in controller runs these drives."
    )


# --- the built-in controller ------------------------------------------------------------------------------------


class Program(Section):
    """What the axis program does with each drive."""

    kind: Literal["constant", "ramp", "sine", "positions", "idle"] = Field(
        default="idle",
        description="Course of the speed; positions goes from target to target, position mode; idle exchanges data and "
        "leaves the drive disabled.",
    )
    speed_rpm: float = Field(
        default=100.0,
        ge=-100_000,
        le=100_000,
        description="Speed, its peak, or the velocity of a move, rpm (linear motor: pitches a minute).",
    )
    targets: list[Annotated[float, Field(ge=-10_000, le=10_000)]] = Field(
        default=[0.0, 1.0],
        min_length=1,
        max_length=TARGETS,
        description="Of positions, in turn, revolutions (linear motor: pitches) from the home position.",
    )
    acceleration: float = Field(default=10_000.0, gt=0, le=10_000_000, description="Of positions, up and down, rpm/s.")
    dwell_ns: Duration = Field(default=0, alias="dwell", description="Of positions, how long it stays in each target.")
    period_ns: Duration = Field(default=2_000_000_000, alias="period", description="Of one ramp or sine.")
    enable: bool = Field(default=True, description="Whether it takes the drive to S4 operation.")
    acknowledge_after_ns: Duration | None = Field(
        default=None, alias="acknowledge_after", description="Acknowledge a fault so long after it; left out, never."
    )


class ParameterRecord(Section):
    """A record that is written before the end of parametrisation."""

    api: int = Field(default=0, ge=0, le=_U32, description="Application process identifier; PROFIdrive's is 0x3A00.")
    slot: int = Field(ge=0, le=0x7FFF, description="Slot of the submodule, a number.")
    subslot: int = Field(ge=1, le=0x9FFF, description="Subslot of the submodule, a number.")
    index: int = Field(ge=0, le=_U16, description="Record index, a number.")
    data: OctetString = Field(description="Octets in hexadecimal.")
    on: Globs | None = Field(default=None, description="Which drives; left out, all.")


def _read_place(value: Any) -> int:
    """A key: YAML's keys come as texts."""
    text = str(value)
    number = int(text) if re.fullmatch(r"[0-9]{1,5}", text) else -1
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,4}", text):
        number = int(text, 16)
    if not 0 <= number <= _U16:
        raise Problem(f"{shown(value)} is no slot or subslot", "a number from 0 to 65535")
    return number


#: A slot or a subslot as the key of a mapping.
_Place = Annotated[int, PlainValidator(_read_place), WithJsonSchema({"type": "integer", "minimum": 0, "maximum": _U16})]


class ForeignDevice(Section):
    """A device that no model describes: its maker's GSDML file does."""

    name: NamePattern = Field(description="Its station name.")
    gsdml: str = Field(min_length=1, description="Its GSDML file, relative to this file.")
    dap: str | None = Field(
        default=None, description="ID of the access point; left out where the GSDML file has one only."
    )
    modules: dict[_Place, str | None] = Field(
        default_factory=dict, description="Slot: ID of the module in it; null for an empty slot.", examples=[{1: "DI8"}]
    )
    submodules: dict[_Place, dict[_Place, str | None]] = Field(
        default_factory=dict, description="Slot: mapping of subslot to the ID of the submodule in it."
    )
    ip: Cidr | None = Field(default=None, description="Its address; left out, the next free one of the controller's.")
    gateway: Gateway | None = Field(default=None, description="Router of the subnet.")
    cycle_ns: Cycle | None = Field(default=None, alias="cycle", description="Its cycle; left out, the controller's.")
    startup: Literal["legacy", "advanced"] | None = Field(
        default=None, description="Start-up mode; left out, the controller's, or what the GSDML file knows."
    )


class Reconnect(Section):
    """What follows a lost connection."""

    after_ns: Duration = Field(default=1_000_000_000, alias="after", description="Pause before the next Connect.")


def _open_reconnect(value: Any) -> Any:
    if value is False or value == OFF:
        return None
    if isinstance(value, (dict, Reconnect)):
        return value
    raise Problem(f"is {shown(value)}", "off, or a mapping such as {after: 1s}")


#: RemoteApplicationTimeout of a GSDML file counts seconds in 16 bits.
LEAST_READY_NS, MOST_READY_NS = 1_000_000_000, 65_535_000_000_000


def _within_ready_bounds(value: int) -> int:
    if not LEAST_READY_NS <= value <= MOST_READY_NS:
        raise Problem(f"is {format_duration(value)}", "1s to 65535s")
    return value


ReadyTime = Annotated[Duration, AfterValidator(_within_ready_bounds)]


class ControllerSection(Section):
    """The built-in PROFINET IO controller."""

    name: NamePattern = Field(default="plc", description="Its station name.")
    ip: Cidr | None = Field(default=None, description="Its address.")
    mac: MacSetting | None = Field(
        default=None, description="Its MAC address; left out, the interface's own, or a stable one on the farm's link."
    )
    interface: Interface | None = Field(default=None, description="Existing interface to use; it is not changed.")
    link: Link | None = Field(default=None, description="Link of its own; left out, the farm's.")
    cycle_ns: Cycle | None = Field(
        default=None,
        alias="cycle",
        description="Cycle of the IO data; left out, what factor and ratio say, or 16ms (a drive's slowest where that "
        "is faster).",
    )
    send_clock_factor: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = Field(
        default=None, description="Send clock in units of 31.25 us; left out, it follows from the cycle."
    )
    reduction_ratio: Literal[1, 2, 4, 8, 16, 32, 64, 128, 256, 512] | None = Field(
        default=None, description="Send clocks per frame; left out, it follows from the cycle."
    )
    watchdog_factor: int = Field(
        default=3, ge=1, le=MAX_DATA_HOLD_FACTOR, description="Missed cycles until the connection is given up."
    )
    startup: Literal["legacy", "advanced"] = Field(default="legacy", description="Start-up mode of the connection.")
    application_ready_ns: ReadyTime = Field(
        default=DEFAULT_READY_NS,
        alias="application_ready",
        description="How long a device may take from the end of parametrisation to ApplicationReady; left out, what "
        "its GSDML file names (RemoteApplicationTimeout), or 20s.",
    )
    assign_ip: bool = Field(default=True, description="Whether it gives the drives their addresses by DCP.")
    identification: bool = Field(default=True, description="Whether it reads I&M0 to I&M3 of connected drives.")
    takeover_allowed: bool = Field(default=False, description="Whether a supervisor may take submodules over.")
    telegram: int = Field(
        default=1, ge=0, le=_U16, description="Telegram of drives whose group names none; left out, their model's own."
    )
    program: Program = Field(default_factory=Program)
    records: list[ParameterRecord] = Field(default_factory=list)
    devices: list[ForeignDevice] = Field(
        default_factory=list, max_length=MAX_DRIVES, description="Devices beside the drives, each by its GSDML file."
    )
    reconnect: Annotated[Reconnect | None, BeforeValidator(_open_reconnect)] = Field(
        default_factory=Reconnect, description="`off`: stay disconnected."
    )


# --- the file ---------------------------------------------------------------------------------------------------


class FarmSections(Section):
    """A farm file; or, without `farm` and `link`, what the built-in controller needs to run foreign devices."""

    farm: FarmName | None = Field(default=None, description="The farm's name.", examples=["line-1"])
    link: Link | None = Field(default=None, description="What the drives are attached to.")
    state: str | None = Field(
        default=None,
        min_length=1,
        description="Folder of the drives' non-volatile memory, relative to this file; left out, they forget.",
        examples=["./state"],
    )
    api: Annotated[Api | None, BeforeValidator(_open_api)] = Field(
        default_factory=lambda: Api.model_validate({"listen": DEFAULT_LISTEN}),
        description="Where the HTTP API listens, HOST:PORT; `off`: nowhere.",
        examples=[DEFAULT_LISTEN, OFF],
    )
    realtime: Realtime = Field(default_factory=Realtime)
    lldp: bool = Field(
        default=True, description="Whether the drives, and the controller, tell their neighbours who they are (LLDP)."
    )
    parameter_lists: ParameterLists = Field(
        default_factory=dict,
        description="Parameters that a model's manual does not describe, for all drives of the model: model: CSV file, "
        "relative to this file. The drives keep them without effect.",
        examples=[{"hiwin-e1": "e1-parameters.csv"}],
    )
    drives: list[DriveGroup] = Field(
        default_factory=list,
        min_length=1,
        description="The drives, group by group; left out only where the controller has `devices`.",
    )
    controller: ControllerSection | None = Field(default=None, description="The built-in controller, for `pnfarm plc`.")
