"""The type of one drive as the API shows it."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from pnfarm.api.schemas.log_entry import LogEntry  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.web.bodies import Schema

__all__ = ["Drive"]


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
        default_factory=list, description="The fault buffer by situation, newest first; only for a single drive."
    )
    events: list[LogEntry] = Field(
        default_factory=list, description="Last events, oldest first; only for a single drive, not in a list of drives."
    )
