"""Every metric of a farm, gathered from the table's columns at the time of the scrape.

Gathering is short and runs in the event loop, where the stations are; writing the text is long and may run in
another thread (:meth:`Scrape.text`).  :class:`FarmCollector` is also a collector for prometheus_client's registries.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.registry import Collector

from pnfarm.buses.registry import bus
from pnfarm.drives.description.parts import fault_label
from pnfarm.firmware.axis import AXIS
from pnfarm.metrics.device_signals import SignalFamily
from pnfarm.metrics.families import OTHER, Family, Histogram, Room, Values
from pnfarm.metrics.lines import LineFamilies
from pnfarm.metrics.recovery import REACTION_EDGES_NS, RECONNECT_EDGES_NS, Recovery
from pnfarm.table.axis_codes import NUMBER_MASK
from pnfarm.table.channel import DISCARDS, INTERVAL_BUCKETS, INTERVAL_EDGES_NS, JITTER_BUCKETS, JITTER_EDGES_NS, OPEN
from pnfarm.table.engine_row import LATENESS_EDGES_NS
from pnfarm.table.observed import PEAK_WINDOW_NS
from pnfarm.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from prometheus_client.metrics_core import Metric

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.station import Station

#: Counts by the values of a family's labels.
Counts: TypeAlias = "dict[tuple[str, ...], int]"

__all__ = ["FarmCollector", "Scrape", "connection_numbers"]

#: Bounds of the intervals' histogram that are shown: how exact the controller is, the jitter's histogram shows.
SHOWN_INTERVALS_NS = (
    500_000, 1_000_000, 1_250_000, 2_000_000, 4_000_000, 5_000_000, 8_000_000, 12_000_000, 16_000_000, 20_000_000,
    32_000_000, 64_000_000, 128_000_000, 512_000_000,
)  # fmt: skip
#: First bucket of the table's histogram in each shown one.
_STARTS = (0, *(INTERVAL_EDGES_NS.index(edge) + 1 for edge in SHOWN_INTERVALS_NS))
#: A model with more faults than this has the series of each from its first occurrence on.
MOST_FAULTS = 24
#: What the open consumers of a drive, and the closed ones, count: the column's shape in each row.
_OF_CONSUMERS: dict[str, tuple[int, ...]] = {
    "received": (),
    "intervals": (INTERVAL_BUCKETS,),
    "interval_sum_ns": (),
    "jitters": (JITTER_BUCKETS,),
    "jitter_sum_ns": (),
    "missed": (),
    "discarded": (len(DISCARDS),),
}
#: Values of the label ``cause`` (:data:`pnfarm.station.lateness.Cause`).
CAUSES = ("controller", "farm")


def connection_numbers(bus_name: str) -> dict[str, int]:
    """``pnfarm_ar_state`` by the bus's word for a connection's state; 0 is "no connection"."""
    return {word: number for number, word in enumerate(bus(bus_name).connection_states, start=1)}


class Scrape:
    """One snapshot of the farm."""

    def __init__(self, parts: list[tuple[Family, Values]], lock: threading.Lock) -> None:
        self._parts = parts
        self._lock = lock

    def families(self) -> list[Family]:
        """What it has values of."""
        return [family for family, _ in self._parts]

    def text(self) -> bytes:
        """In exposition format; may be called in any thread."""
        with self._lock:
            return ("\n".join(family.text(values) for family, values in self._parts) + "\n").encode()

    def metrics(self, wanted: str = "") -> Iterator[Metric]:
        """As prometheus_client's objects; only that whose name, or a sample's, is ``wanted``, if it is given."""
        return (
            family.metric(values)
            for family, values in self._parts
            if not wanted or wanted.startswith(family.name.removesuffix("_total"))
        )


class FarmCollector(Collector):
    """Metrics of one farm.

    Make it before the farm runs: the histograms of the controller's reaction are fed from then on.
    """

    def __init__(self, core: FarmCore) -> None:
        self._core = core
        self._lock = threading.Lock()
        self._recovery = Recovery(core)
        self._room = Room()
        #: Values of the reactions, and of how many reactions and samples they are.
        self._reaction_values: Values = []
        self._reacted = (-1, 0)
        self._names = [axis.configured_name for axis in core.axes]
        self._nodes = [station.configured_name for station in core.stations]
        #: The place of its station for each process image, -1 for none.
        self._node_of: Any = np.full(core.columns.image.shape[0], -1)
        for place, station in enumerate(core.stations):
            for row in (station.index, *(axis.index for axis in station.axes)):
                self._node_of[row] = place
        self._families()
        self._lines = LineFamilies(core)
        self._signals = SignalFamily(core)
        #: The process's own metrics (CPU, memory, open files), in addition to the farm's.
        self.process = CollectorRegistry()
        ProcessCollector(registry=self.process)

    def close(self) -> None:
        """Stop listening to events."""
        self._recovery.close()

    # -- families ----------------------------------------------------------------------------------------------------

    def _per_drive(self, name: str, kind: str, documentation: str, of: Sequence[str] | None = None) -> Family:
        """A series for each axis, or for each of those ``of``."""
        family = Family(f"pnfarm_{name}", kind, documentation, ("drive",), room=self._room)
        for drive in self._names if of is None else of:
            family.add(drive)
        return family

    def _per_node(self, name: str, kind: str, documentation: str) -> Family:
        """A series for each station."""
        return self._per_drive(name, kind, documentation, self._nodes)

    def _counted(self, name: str, documentation: str, labels: Sequence[str], bounded: str) -> Family:
        """A counter whose label ``bounded`` may take many values."""
        return Family(f"pnfarm_{name}", "counter", documentation, labels, room=self._room, bounded=(bounded,))

    def _histogram(self, name: str, documentation: str, edges_ns: Sequence[int], of: Sequence[str]) -> Histogram:
        family = Histogram(f"pnfarm_{name}", documentation, edges_ns, ("drive",), room=self._room)
        for drive in of:
            family.add(drive)
        return family

    def _families(self) -> None:
        drive, node = self._per_drive, self._per_node
        self._build = Family("pnfarm_build_info", "gauge", "Version of pnfarm; always 1.", ("version",))
        self._build.add(__version__)
        self._shard = Family(
            "pnfarm_shard_info",
            "gauge",
            "Which part of a farm these drives are; always 1, and 1/1 for the whole farm.",
            ("farm", "shard", "shards"),
        )
        shard = self._core.shard
        index, count = (1, 1) if shard is None else (shard.index, shard.count)
        self._shard.add(self._core.name, str(index), str(count))
        #: The memory's database and the lease, as :meth:`_standing` has their values.
        self._of_standing = [
            Family(f"pnfarm_{name}", kind, documentation)
            for name, kind, documentation in (
                ("memory_up", "gauge", "Whether the drives' non-volatile memory can be written, as far as is known."),
                ("memory_losses_total", "counter", "Times that the database of the drives' memory was lost."),
                (
                    "memory_saves_refused_total",
                    "counter",
                    "Saves that the database of the drives' memory did not accept.",
                ),
                (
                    "lease_held",
                    "gauge",
                    "Whether the drives may send: 1 also without a lease, 0 while they are mute.",
                ),
                (
                    "lease_renewed_seconds_ago",
                    "gauge",
                    "Time since the newest renewal of the lease, 0 without a lease.",
                ),
            )
        ]
        self._info = Family(
            "pnfarm_drive_info",
            "gauge",
            "Model and bus of a drive, to join on; always 1.",
            ("drive", "model", "bus"),
            room=self._room,
        )
        self._axis_info = Family(
            "pnfarm_axis_info",
            "gauge",
            "The station of an axis with a name of its own, to join on; always 1.",
            ("drive", "station"),
            room=self._room,
        )
        for axis in self._core.axes:
            self._info.add(axis.configured_name, axis.model.name, axis.model.bus)
        for station in self._core.stations:
            for axis in station.axes:
                if axis.configured_name != station.configured_name:
                    self._axis_info.add(axis.configured_name, station.configured_name)
        #: Family and column; without its supply a drive has no values, only its motor turns on.
        self._axis: list[tuple[Family, str]] = [
            (drive(f"axis_{name}", "gauge", documentation), column)
            for name, column, documentation in (
                ("velocity_rpm", "motor.velocity", "Shaft speed of the motor (VL.FB)."),
                (
                    "position_revolutions",
                    "motor.position",
                    "Shaft position from the home position; before homing, from power-on (PL.FB).",
                ),
                ("current_amperes", "motor.current", "Torque-producing current of the motor (IL.FB)."),
                (
                    "following_error_revolutions",
                    "positioning.following_error",
                    "Commanded minus actual position (PL.ERR).",
                ),
                ("torque_newton_metres", "motor.torque", "Torque of the motor."),
                ("bus_volts", "supply.voltage", "Voltage of the DC link (VBUS.VALUE)."),
                ("thermal_load_ratio", "motor.thermal_load", "Thermal load of the motor, 1 = its limit (I2t)."),
                ("setpoint_rpm", "ramp.setpoint", "Velocity that the controller requests (NSOLL_A)."),
                ("stw1", "profidrive.stw1", "Control word 1 in force (STW1) as a number."),
                ("zsw1", "profidrive.zsw1", "Status word 1 (ZSW1) as a number."),
                ("state", "drive.state", "PROFIdrive state: 1..5 for S1..S5, 0 while the drive boots."),
            )
        ]
        self._life_errors = drive(
            "sign_of_life_errors_total", "counter", "Frames whose sign of life (STW2) did not follow the last one's."
        )
        self._fault_active = drive("axis_fault_active", "gauge", "Number of the active fault (PNU 947), 0 = none.")
        self._fault_total = self._counted(
            "axis_faults_total", "Faults of the drive by number (702 = F702).", ("drive", "code"), "code"
        )
        buses = dict.fromkeys(station.bus for station in self._core.stations)
        self._states = {name: connection_numbers(name) for name in buses}
        states = "; ".join(", ".join(f"{n} {word}" for word, n in words.items()) for words in self._states.values())
        self._ar_state = node("ar_state", "gauge", f"State of the connection (CMDEV): 0 none, {states}.")
        self._exchanging = node("ar_exchanging", "gauge", "1 while the connection is completely set up, on any bus.")
        self._ar_cycle = node("ar_cycle_seconds", "gauge", "Cycle of the connection's IO data, 0 without one.")
        self._connects = node("ar_connects_total", "counter", "Connections that reached DATA.")
        self._aborts = self._counted(
            "ar_aborts_total",
            "Connections that were aborted, by reason; cause farm: while the farm itself was late.",
            ("drive", "reason", "cause"),
            "reason",
        )
        self._received = node("frames_received_total", "counter", "Valid cyclic frames (RT_CLASS_1) received.")
        self._sent = node("frames_sent_total", "counter", "Cyclic frames (RT_CLASS_1) sent.")
        self._discarded = self._counted(
            "frames_discarded_total", "Frames and PDUs that the drive dropped.", ("drive", "reason"), "reason"
        )
        for axis in self._core.axes:
            name = axis.configured_name
            faults = [fault for fault in axis.model.faults.values() if not fault.warning]
            for fault in faults if len(faults) <= MOST_FAULTS else ():
                self._fault_total.add(name, str(fault.number))
            self._fault_total.add(name, OTHER)
        for station in self._core.stations:
            name = station.configured_name
            for cause in CAUSES:
                for reason in (*bus(station.bus).usual_losses, OTHER):
                    self._aborts.add(name, reason, cause)
            for slug in (*DISCARDS, OTHER):
                self._discarded.add(name, slug)
        self._watchdog = Family(
            "pnfarm_watchdog_expirations_total",
            "counter",
            "Data hold timer (watchdog) ran out; cause farm: while the farm itself was later than its budget.",
            ("drive", "cause"),
            room=self._room,
        )
        for name in self._nodes:
            for cause in CAUSES:
                self._watchdog.add(name, cause)
        self._interval = self._histogram(
            "controller_frame_interval_seconds",
            "Time between two valid frames of the controller: how regular it is.",
            SHOWN_INTERVALS_NS,
            self._nodes,
        )
        self._jitter = self._histogram(
            "controller_jitter_seconds",
            "Deviation of the time between two valid frames from the agreed cycle; missing frames are not counted.",
            JITTER_EDGES_NS,
            self._nodes,
        )
        self._missed = node(
            "controller_missed_updates_total", "counter", "Frames that the controller left out, by its cycle counter."
        )
        self._peaks = [
            (
                drive(
                    f"axis_{name}_{extreme}_rpm",
                    "gauge",
                    f"{word} {title} of the last {PEAK_WINDOW_NS // 1_000_000_000} s at least.",
                ),
                f"{name}_{extreme}",
                choose,
            )
            for name, title in (("velocity", "shaft speed of the motor"), ("setpoint", "velocity set point"))
            for extreme, word, choose in (("min", "Smallest", np.minimum), ("max", "Largest", np.maximum))
        ]
        self._reaction = Histogram(
            "pnfarm_controller_fault_reaction_seconds",
            "Time from a fault to the controller's withdrawal of the enable (STW1), by fault and by what was injected.",
            REACTION_EDGES_NS,
            ("drive", "code", "kind"),
            room=self._room,
            bounded=("code", "kind"),
        )
        self._reconnect = self._histogram(
            "controller_reconnect_seconds",
            "Time from a fault or the loss of a connection until the controller had brought the drive back.",
            RECONNECT_EDGES_NS,
            self._names,
        )
        self._lateness = Histogram(
            "pnfarm_engine_lateness_seconds", "How late the engine's ticks began.", LATENESS_EDGES_NS
        )
        self._cycles = Family("pnfarm_engine_cycles_total", "counter", "Ticks of the engine.")
        self._overruns = Family(
            "pnfarm_engine_overruns_total", "counter", "Ticks so late that at least one frame's cycle was skipped."
        )
        self._faults_active = Family(
            "pnfarm_faults_active", "gauge", "Drives on which a fault of this kind is in force.", ("kind",)
        )
        self._drive_faults_active = drive("drive_faults_active", "gauge", "Injected faults in force on the drive.")
        self._activations = self._counted(
            "fault_activations_total", "Times that an injected fault acted.", ("kind", "drive"), "kind"
        )
        for kind in self._core.injections.kinds:
            self._faults_active.add(kind)
        for name in self._names:
            self._reaction.add(name, OTHER, OTHER)
        for name in dict.fromkeys((*self._names, *self._nodes)):
            self._activations.add(OTHER, name)

    # -- current values --------------------------------------------------------------------------------------------

    def gather(self) -> Scrape:
        """Read everything; call it in the thread of the stations."""
        core = self._core
        stations = core.stations
        count = len(core.axes)
        axis = core.columns.axis[:count]
        parts: list[tuple[Family, Values]] = [(self._build, [1]), (self._shard, [1]), (self._info, [1] * count)]
        parts.append((self._axis_info, [1] * len(self._axis_info)))
        powered = axis["powered"] != 0
        for family, column in self._axis:
            value = AXIS.read(axis, column)
            if column == "motor.position":
                value = value - AXIS.read(axis, "homing.origin")
            parts.append((family, np.where(powered | column.startswith("motor."), value, 0).tolist()))
        observed = core.columns.observed[:count]
        parts += [
            (
                family,
                np.where(
                    powered | column.startswith("velocity"), choose(observed[column], observed[f"last_{column}"]), 0
                ).tolist(),
            )
            for family, column, choose in self._peaks
        ]
        parts.append((self._life_errors, axis.life.errors.tolist()))
        parts.append((self._fault_active, np.where(powered, axis.faults.code[:, 0] & NUMBER_MASK, 0).tolist()))
        parts.append(self._fault_total.counted(self._fault_counts()))
        parts += self._connections(stations)
        parts += self._channels(stations)
        recovery = self._recovery
        parts += [
            self._reactions(),
            (self._reconnect, self._reconnect.values(recovery.reconnects, recovery.reconnect_sums_ns)),
        ]
        engine = core.columns.engine
        parts += [
            (self._lateness, self._lateness.values(engine["lateness"], engine["lateness_sum_ns"])),
            (self._cycles, engine["cycles"].tolist()),
            (self._overruns, engine["overruns"].tolist()),
        ]
        active: Counts = {(kind,): number for kind, number in core.injections.active().items()}
        activations: Counts = dict(core.injections.activations().items())
        parts.append(self._faults_active.counted(active))
        parts.append((self._drive_faults_active, core.columns.image["injected"][:count].tolist()))
        parts.append(self._activations.counted(activations))
        parts += self._standing()
        parts += self._lines.gather() + self._signals.gather()
        return Scrape(parts, self._lock)

    def collect(self) -> Iterator[Metric]:
        """For a registry of prometheus_client."""
        return self.gather().metrics()

    def process_text(self) -> bytes:
        """The process's own metrics in exposition format."""
        return generate_latest(self.process)

    def _standing(self) -> list[tuple[Family, Values]]:
        """The memory's database and the lease."""
        holder = self._core.leaseholder
        up, losses, refused, held, renewed = 1.0, 0.0, 0.0, 1.0, 0.0
        if holder is not None:
            state = holder.state
            up, losses, refused = float(state.ready), float(state.standing.losses), float(state.standing.refused)
            held, renewed = float(state.may_speak()), state.renewed_seconds_ago() or 0.0
        values = (up, losses, refused, held, renewed)
        return [(family, [value]) for family, value in zip(self._of_standing, values, strict=True)]

    def _reactions(self) -> tuple[Family, Values]:
        """Histograms by fault; one that is new is made while there is room for it."""
        family = self._reaction
        # most are empty for ever: nothing is gathered while no controller reacts
        if self._reacted == (self._recovery.reacted, len(family)):
            return family, self._reaction_values
        places = [(family.place(*labels), reaction) for labels, reaction in self._recovery.reactions.items()]
        series = len(family) // family.samples
        counts = np.zeros((series, len(REACTION_EDGES_NS) + 1), np.int64)
        sums = np.zeros(series, np.int64)
        for place, reaction in places:
            counts[place] += reaction.counts
            sums[place] += reaction.sum_ns
        self._reaction_values = family.values(counts, sums)
        self._reacted = (self._recovery.reacted, len(family))
        return family, self._reaction_values

    def _fault_counts(self) -> Counts:
        return {
            (station.configured_name, fault_label(number)): count
            for station in self._core.axes
            for number, count in station.fault_counts.items()
        }

    def _connections(self, stations: Sequence[Station]) -> list[tuple[Family, Values]]:
        states: list[float] = []
        exchanging: list[float] = []
        cycles: list[float] = []
        aborts: Counts = {}
        watchdog: list[float] = []
        for station in stations:
            connection = station.device.connection()
            known = connection is not None and station.powered
            numbers = self._states[station.bus]
            states.append(numbers.get(connection.state, 0) if connection is not None and known else 0)
            exchanging.append(float(connection is not None and known and connection.exchanging))
            cycles.append(connection.cycle_ns / 1e9 if connection is not None and connection.cyclic else 0)
            own = station.device.losses_by_farm()
            for reason, count in station.device.losses().items():
                aborts[station.configured_name, reason, "controller"] = count - own.get(reason, 0)
            for reason, count in own.items():
                aborts[station.configured_name, reason, "farm"] = count
            expired, own_expired = station.device.watchdog_expirations, station.device.watchdog_expirations_by_farm
            watchdog += (expired - own_expired, own_expired)
        return [
            (self._ar_state, states),
            (self._exchanging, exchanging),
            (self._ar_cycle, cycles),
            (self._connects, [station.device.connects for station in stations]),
            self._aborts.counted(aborts),
            (self._watchdog, watchdog),
        ]

    def _channels(self, stations: Sequence[Station]) -> list[tuple[Family, Values]]:
        """Open channels by column, closed ones from their stations."""
        count = len(stations)
        columns = self._core.columns
        engine = columns.engine[0]
        sums: dict[str, Any] = {
            name: np.zeros((count, *shape), np.int64) for name, shape in {**_OF_CONSUMERS, "sent": ()}.items()
        }
        for place, station in enumerate(stations):
            for name, numbers in sums.items():
                numbers[place] = getattr(station.device.closed, name)
        providers = columns.ppm[: int(engine.ppm_rows)]
        live = providers["active"] == OPEN
        np.add.at(sums["sent"], self._node_of[providers["image"][live]], providers["sent"][live])
        consumers = columns.cpm[: int(engine.cpm_rows)]
        live = consumers["active"] == OPEN
        nodes = self._node_of[consumers["image"][live]]
        for name in _OF_CONSUMERS:
            np.add.at(sums[name], nodes, consumers[name][live])
        intervals = np.add.reduceat(sums["intervals"], _STARTS, axis=1)
        by_reason: Counts = {}
        for station, cyclic in zip(stations, sums["discarded"].tolist(), strict=True):
            name = station.configured_name
            for reason, dropped in station.device.discards().items():
                by_reason[name, reason] = dropped
            for reason, dropped in zip(DISCARDS, cyclic, strict=True):
                by_reason[name, reason] = by_reason.get((name, reason), 0) + dropped
        return [
            (self._received, sums["received"].tolist()),
            (self._sent, sums["sent"].tolist()),
            self._discarded.counted(by_reason),
            (self._interval, self._interval.values(intervals, sums["interval_sum_ns"])),
            (self._jitter, self._jitter.values(sums["jitters"], sums["jitter_sum_ns"])),
            (self._missed, sums["missed"].tolist()),
        ]
