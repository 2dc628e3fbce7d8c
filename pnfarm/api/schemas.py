"""Types of the API's bodies: for its OpenAPI description, and to check requests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, Field

from pnfarm.api.log_entry import LogEntry  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.web.bodies import Schema

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "Clock",
    "Controller",
    "ControllerView",
    "Drive",
    "DriveFault",
    "Engine",
    "FarmView",
    "FieldError",
    "Findings",
    "Health",
    "LineView",
    "ParameterList",
    "ParameterValue",
    "ParameterWrite",
    "Problem",
    "Reactions",
    "Ready",
    "Reset",
    "Targets",
    "Version",
    "problems_of",
]


class FieldError(Schema):
    """One field of a body."""

    field: str
    what: str
    allowed: str = ""
    line: str = Field(default="", description="Of a scenario's text.")


class Problem(BaseModel):
    """RFC 9457."""

    type: str = Field(description="Always about:blank; see the title.")
    title: str = Field(description="The status's phrase.")
    status: int
    detail: str = Field(description="What is wrong and what would be right, one sentence.")
    instance: str = Field(description="The path.")
    error_number: int | None = Field(default=None, description="PROFIdrive's error number of a refused parameter.")
    errors: list[FieldError] | None = Field(default=None, description="One entry for each wrong field.")


class DriveFault(Schema):
    number: int = Field(description="The manual's number: 702 is F702.")
    name: str


class KeptFault(Schema):
    number: int
    label: str = Field(description="The number as the manual writes it.")
    name: str


class Controller(Schema):
    name: str
    ip: str = Field(description="Its address; empty on a serial line.")
    mac: str


class Neighbour(Schema):
    port: str = Field(description="The drive's own port.")
    station: str = Field(description="Name of station, or MAC address, of the neighbour.")
    chassis: str = Field(description="Chassis id.")
    port_id: str = Field(description="The neighbour's port.")
    system_name: str | None
    mac: str
    ip: str | None = Field(description="Management address.")
    seen_seconds_ago: float


class Drive(Schema):
    """One drive as it is now."""

    name: str = Field(description="Name in the farm file.")
    station_name: str = Field(description="Present name of station; DCP may have changed it.")
    model: str
    behaviour: dict[str, str] = Field(
        description="Readings chosen in the farm file, by open point; the others have their defaults."
    )
    mac: str
    ip: str | None = Field(description="Address and prefix length.")
    gateway: str | None
    ip_conflict: str | None = Field(description="MAC address of a station that uses the same IP address.")
    station_address: int | None = Field(description="Address on a serial line; null on a network.")
    powered: bool
    state: str = Field(description="S1..S5 of the PROFIdrive state machine; boot, or off.")
    status: list[str] = Field(description="Which hold of ready, enabled, in_operation, at_rest, homed, task_active ...")
    zsw1: str = Field(description="Status word 1 of PROFIdrive, hexadecimal; 0 on a bus without it.")
    zsw1_bits: list[str]
    stw1: str = Field(description="Control word 1 of PROFIdrive, hexadecimal; 0 on a bus without it.")
    stw1_bits: list[str]
    telegram: int
    ar_state: str = Field(description="State of the connection in its bus's words; NO_AR without one.")
    connected: bool = Field(description="A connection exchanges cyclic data.")
    controller: Controller | None
    cycle_seconds: float | None
    watchdog_seconds: float | None = Field(description="Data hold time of the controller's data.")
    connected_seconds: float | None
    frames_sent: int
    frames_suppressed: int = Field(description="Cyclic frames that an injected fault suppressed.")
    frames_received: int
    frames_discarded: dict[str, int] = Field(description="By reason.")
    watchdog_expirations: int
    watchdog_expirations_by_farm: int = Field(description="Those of them that the farm's own lateness caused.")
    connects: int
    aborts: dict[str, int] = Field(description="By reason.")
    aborts_by_farm: int = Field(description="Those of them that the farm's own lateness caused.")
    fault: DriveFault | None = Field(description="The first active fault.")
    faults: list[DriveFault] = Field(description="All active faults, oldest first.")
    last_fault: DriveFault | None = Field(description="The active fault, or the one acknowledged last.")
    neighbours: list[Neighbour] = Field(description="Neighbour at the other end of the cable, by LLDP.")
    fault_counts: dict[str, int] = Field(description="By number.")
    warning: DriveFault | None
    setpoint_rpm: float
    velocity_rpm: float
    position_revolutions: float
    pitch_millimetres: float | None = Field(
        description="Of a linear motor: travel for one revolution; null for a rotary motor."
    )
    current_amperes: float
    following_error_revolutions: float
    torque_newton_metres: float
    bus_volts: float = Field(description="Voltage of the DC link; 0 for a drive without one.")
    thermal_load: float = Field(description="Thermal load of the motor, 1 = its limit (I2t).")
    signalling: bool = Field(description="The signal lamp flashes, as requested by DCP.")
    lamps: dict[str, str] = Field(
        description="Lamps of the network interface by name: on, off or their flashing; empty if the manual has none."
    )
    details: dict[str, Any] = Field(description="What only drives on its bus have.")
    signalled_seconds_ago: float | None = Field(description="Time since the last DCP signal request.")
    realism: dict[str, float | list[float]] = Field(
        description="Realism settings with units in the names: noise, latency, boot time, drift."
    )
    faults_injected: list[str] = Field(description="Ids of the active injected faults.")
    fault_memory: list[list[KeptFault]] = Field(
        default_factory=list,
        description="The fault buffer by situation, newest first; only for a single drive.",
    )
    events: list[LogEntry] = Field(
        default_factory=list,
        description="Last events, oldest first; only for a single drive, not in a list of drives.",
    )


class Bucket(Schema):
    up_to_seconds: float | None = Field(description="Upper bound; null for the rest.")
    count: int


class Distribution(Schema):
    mean_seconds: float | None
    buckets: list[Bucket] = Field(description="Buckets that are not empty.")


class ByCause(Schema):
    controller: int
    farm: int = Field(description="While the farm itself was later than its budget.")


class LateFrame(Schema):
    seconds_ago: float
    late_seconds: float
    engine_late_seconds: float = Field(description="How late the farm's engine had been since the frame before.")


class ChangedBit(Schema):
    bit: int
    name: str
    value: int
    after_seconds: float


class Reaction(Schema):
    code: str
    kind: str = Field(description="What was injected; none if nothing was.")
    seconds_ago: float
    reaction_seconds: float | None = Field(description="Until the controller withdrew the enable.")
    acknowledged_seconds: float | None
    stw1: list[ChangedBit] = Field(description="First change of each bit of STW1 since the fault.")


class StartUpView(Schema):
    controller: str | None = Field(description="Its station name; null before it asked for a connection.")
    attempts: int = Field(description="Connects, also refused ones.")
    complete: bool
    after_loss_seconds: float | None = Field(description="From the loss of the connection before it to data exchange.")
    phases: dict[str, float] = Field(
        description="Seconds for identify, address, connect, parameters, ready, data, each from the one before, the "
        "first one from the loss; a phase that the controller left out is not there."
    )


class SignOfLife(Schema):
    monitored: bool
    errors: int
    tolerance: int


class ControllerView(Schema):
    """What a drive's controller did, seen from the drive, since the farm started."""

    drive: str
    cycle_seconds: float | None
    intervals: Distribution
    jitter: Distribution = Field(description="Deviation of the intervals from the agreed cycle.")
    missed_updates: int
    late_frames: ByCause = Field(description="Frames more than half a cycle late.")
    last_late_frame: LateFrame | None = Field(description="In the present connection.")
    watchdog_expirations: ByCause
    attempts: int = Field(description="Connects, also refused ones.")
    refused: int
    connects: int
    start_ups: list[StartUpView] = Field(description="The newest ones, oldest first.")
    faults: list[Reaction] = Field(description="The newest fault situations, oldest first.")
    sign_of_life: SignOfLife | None = Field(description="Null without STW2 in the telegram.")


class Engine(Schema):
    cycles: int
    overruns: int
    lateness_max_seconds: float
    frames_sent: int
    frames_received: int
    frames_unknown: int
    frames_malformed: int
    send_errors: int
    events_lost: int


class LineView(Schema):
    """A serial line that all drives on one bus share."""

    name: str = Field(description="The name of the bus.")
    way: str = Field(description="pty, port, connect or listen.")
    where: str = Field(description="What the other end connects to.")
    up: bool = Field(description="Whether the line is connected, as far as the farm can detect it.")
    baud: int
    telegrams_received: int
    telegrams_sent: int
    octets_received: int
    octets_sent: int
    octets_lost: dict[str, int] = Field(description="Octets that could not be sent, by reason.")
    interruptions: dict[str, int] = Field(
        description="How often the connection broke or could not be opened, by reason."
    )
    dropped: dict[str, int] = Field(
        description="Received data that are not telegrams, by reason; garbage counts octets."
    )
    counts: dict[str, int] = Field(description="Requests of some kinds: repeated, diagnosis, refused.")
    answers_withheld: int = Field(description="Answers that would have begun later than allowed.")
    reply_seconds_mean: float | None = Field(description="From a request's last octet to its answer, in this process.")


class ShardView(Schema):
    """Which part of a farm these drives are."""

    index: int = Field(description="From 1.")
    count: int


class Other(Schema):
    host: str
    shard: str = Field(description="Empty for the whole farm.")


class StandingView(Schema):
    """The database of the drives' memory, and the lease of these drives in it."""

    memory: str = Field(description="The database, without password.")
    memory_up: bool = Field(description="Whether the drives can save.")
    memory_reason: str = Field(description="Why not; empty if it can.")
    lease: str = Field(description="held, lost or waiting: without it being held, the drives are mute.")
    renewed_seconds_ago: float | None
    ttl_seconds: float | None = Field(description="After so long without a renewal, others may run the drives.")
    mute_after_seconds: float | None = Field(description="After so long without a renewal, the drives are mute.")
    held_by: Other | None = Field(description="Who runs the drives instead.")


class FarmView(Schema):
    farm: str
    shard: ShardView | None = Field(description="Null where the whole farm runs here.")
    standing: StandingView | None = Field(description="Null where the memory is in a folder, or there is none.")
    link: str
    lines: list[LineView]
    engine: Engine
    drives: list[Drive]


class ParameterWrite(Schema):
    """A parameter's new value."""

    value: int = Field(description="Raw value as on the wire.")


class ParameterValue(Schema):
    """A parameter of one drive; numbers are raw, as on the wire."""

    drive: str
    pnu: int
    subindex: int
    name: str
    value: int
    values: list[int] | None = Field(description="All elements of an array.")
    minimum: int
    maximum: int
    default: int
    unit: str
    writable: bool
    changed: bool = Field(description="Whether the value differs from the model's default.")


class ListedParameter(Schema):
    """A parameter in a list; numbers are raw, as on the wire."""

    pnu: int
    number: str = Field(description="As the maker writes it.")
    name: str
    value: int | None = Field(description="Of an array, the first element; null where none can be read.")
    elements: int = Field(description="0 unless it is an array.")
    unit: str
    factor: float = Field(description="Times the raw number is the value in the unit.")
    minimum: int
    maximum: int
    default: int
    writable: bool
    after_power_on: bool = Field(description="A write takes effect with the next power cycle.")
    source: str = Field(description="Where the manual has it, or why it is assumed.")
    note: str
    changed: bool = Field(description="Whether the value differs from the model's default.")


class ParameterList(Schema):
    drive: str
    count: int = Field(description="How many there are in all that match.")
    parameters: list[ListedParameter]


class LatenessBucket(Schema):
    up_to_seconds: float | None = Field(description="Null: beyond all of them.")
    count: int = Field(description="Ticks.")


class Health(Schema):
    """How late the farm itself is."""

    engine: Engine
    lateness: list[LatenessBucket] = Field(description="Of the engine's ticks, since the start.")
    lateness_measured: bool = Field(description="False on a memory link, where no tick can be late.")
    lateness_mean_seconds: float
    last_seconds: float = Field(description="How far back the following look.")
    engine_late_seconds: float = Field(description="Sum over late ticks.")
    loop_late_seconds: float = Field(description="Longest delay of the event loop.")
    stolen_seconds: float = Field(description="Time in which the engine's thread was ready and got no CPU.")


class Finding(Schema):
    """As `pnfarm doctor` has it."""

    name: str
    ok: bool | None = Field(description="Null: works, but not at its best, or unknown.")
    detail: str
    remedy: str


class Findings(Schema):
    findings: list[Finding]


class ReactionStep(Schema):
    what: Literal["injected", "wire", "fault", "control", "acknowledged", "lost", "start-up"]
    text: str
    seconds: float = Field(description="After the fault, or after the loss of the connection.")


class Timeline(Schema):
    """What a controller did about a fault, or about a lost connection."""

    drive: str
    what: Literal["fault", "connection"]
    kind: str = Field(description="What was injected; none where nothing was.")
    code: str = Field(description="The fault's number as the manual writes it; empty for a connection.")
    name: str = Field(description="Of the fault, or of the controller.")
    seconds_ago: float
    reaction_seconds: float | None = Field(description="Until the enable was withdrawn, or a start-up began.")
    recovered_seconds: float | None = Field(description="Until it was acknowledged, or data flowed again.")
    steps: list[ReactionStep]


class Reactions(Schema):
    reactions: list[Timeline]


class ClearedFault(Schema):
    id: str
    kind: str
    drives: list[str]


class Reset(Schema):
    cleared: list[str] = Field(description="Ids of the faults that were cleared.")
    faults: list[ClearedFault] = Field(description="What was cleared, and on which drives.")


class Refusal(Schema):
    drive: str
    why: str = Field(description="Why this drive refuses the fault.")


class Targets(Schema):
    dry_run: bool = Field(description="Always true: nothing was changed.")
    kind: str
    spec: dict[str, Any] = Field(description="The fault as it would be, with the seed that chose the drives.")
    drives: list[str] = Field(description="Drives that it would hit.")
    cannot: list[Refusal] = Field(description="Drives that refuse it: with any of them nothing is injected.")
    left_out: list[str] = Field(description="Drives that match and that share or most leaves out.")


class Clock(Schema):
    kind: Literal["farm", "hub"]
    farm: str
    pnfarm: str = Field(description="Version.")
    instance: str = Field(description="Another one in each run: then event numbers and the farm's clock restart.")
    farm_seconds: float = Field(description="The farm's clock.")
    wall_seconds: float = Field(description="Seconds since the epoch, by this machine's clock.")
    newest_event: int = Field(description="Sequence number of the newest entry of the event log.")
    drives: int


class Version(Schema):
    pnfarm: str
    python: str
    api: str


class Ready(Schema):
    ready: bool
    cycles: int
    last_tick_seconds_ago: float


#: Error responses, merged into each operation's responses.
PROBLEMS: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "An error",
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
}

_PROBLEM = PROBLEMS["default"]["content"]
#: Status -> when it is answered.
_WHEN = {
    "401": "The token is missing or wrong",
    "403": "Not permitted: a token that only reads, or a page of another origin",
    "404": "Nothing has this name, number or id",
    "409": "Not in the present state",
    "422": "The request is wrong; `errors` says field by field what is allowed",
}


def problems_of(method: str, path: str, operation: Mapping[str, Any]) -> dict[str, Any]:
    """The error responses of an operation, by status; ``default`` stays for the rare ones, such as overload."""
    named = "{" in path or any(found["name"] == "drive" for found in operation.get("parameters", ()))
    found = ["401", "403"]
    if named:
        found.append("404")
    if named and (method != "get" or "/params/" in path or path.endswith("/report")):
        found.append("409")
    if method != "get" or "parameters" in operation:
        found.append("422")
    return {status: {"description": _WHEN[status], "content": _PROBLEM} for status in found}
