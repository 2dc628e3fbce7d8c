"""The farms of a soak: a cell of drives of all models on all buses, devices and a plant, and a line in two shards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

__all__ = [
    "BRIDGE",
    "DEVICES",
    "FEWEST_OF_A_CELL",
    "IDLE",
    "LINE_DRIVES",
    "MODELS",
    "PARAMETERS",
    "SHARDS",
    "cell_text",
    "line_text",
    "on_serial_line",
]  # fmt: skip

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
#: The makers' models on PROFINET, with the cycle that they run at: slow, because a soak is about hours, not about load.
MODELS: Mapping[str, str] = {
    "akd-profinet": "32ms",
    "akd-profinet-2012": "32ms",
    "moog-msd": "32ms",
    "hiwin-e1": "4ms",
}
#: Parameters that are written at random: they are used by nothing that keeps the drive from its operation.
PARAMETERS: Mapping[str, Sequence[str]] = {
    "akd-profinet": ("AIN.CUTOFF", "AIN.DEADBAND", "AIN.OFFSET", "AOUT.OFFSET", "BODE.IAMP", "CAP0.EDGE"),
    "akd-profinet-2012": ("1004", "1005", "1006", "1007", "1001"),
    "moog-msd": ("202", "326", "925"),
    "hiwin-e1": ("925", "Pt385", "Pt533", "Pt534", "Pt537", "Pt538"),
    "profidrive": ("925",),
    "akd-ethernetip": ("AIN.CUTOFF", "AIN.DEADBAND", "AIN.OFFSET", "AOUT.OFFSET", "BODE.IAMP"),
    "moog-msd-dp": ("202", "326"),
}
#: Devices with inputs that faults and forces take hold of: those of the plant, and one of nobody's.
DEVICES: Mapping[str, Sequence[str]] = {
    "island": ("part_present", "gripper_open", "gripper_closed", "spare"),
    "slave": ("present", "parts"),
}
#: The control unit of the drive system has no motor: it rests in S1.
IDLE = frozenset({"system.cu"})
#: Addresses of the drives on PROFIBUS.
STATIONS = (11, 12)
#: Fewer drives than these are alone: for tests that have little time.
FEWEST_OF_A_CELL = 8
#: One in so many drives is a HIWIN E1, whose longest cycle is 4 ms.
_E1_SHARE = 8

_CONTROLLER = """\
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 32ms
  watchdog_factor: 60
  program: {kind: sine, speed_rpm: 300, period: 4s, acknowledge_after: 300ms}
  reconnect: {after: 500ms}
"""
_MORE_DRIVES = """\
  - {name: x, model: profidrive, ip: 10.77.1.11/23, cycle: 32ms, load: {inertia: 2.0e-4, lead: 40, friction: 0.02}}
  - {name: z, model: profidrive, ip: 10.77.1.12/23, cycle: 32ms, load: {inertia: 1.0e-4, lead: 40, friction: 0.02}}
  - name: system
    model: profidrive
    ip: 10.77.1.21/23
    cycle: 32ms
    axes:
      - {name: cu, telegram: 390, slot: 2}
      - {name: infeed, telegram: 370}
      - {name: a, telegram: 105, slot: 5}
      - {name: b, telegram: 111, load: {inertia: 5.0e-4}}
      - {name: c, telegram: 1}
  - {name: 'eip-{n:02}', count: 4, model: akd-ethernetip, ip: 10.77.1.31/23}
  - {name: 'dp-{n:02}', count: 2, model: moog-msd-dp, address: 11}
"""
_MORE = f"""\
devices:
  - name: island
    gsdml: {CONFIGS}/gsdml/GSDML-V2.35-Example-Island-20261127.xml
    access_point: DAP 1
    ip: 10.77.1.41/23
    slots: {{1: 16DI, 2: 8DO, 3: 8DO}}
    signals:
      part_present: 1.1.0.0
      gripper_open: 1.1.0.1
      gripper_closed: 1.1.0.2
      spare: 1.1.0.3
      close: 2.1.0.0
      alarm: 2.1.0.1
  - name: weigher
    eds: {CONFIGS}/eds/Example-Weigher-20261128.eds
    ip: 10.77.1.51/23
    connection: Exclusive owner
    parameters: {{Filter: slow, Window: 75}}
  - name: slave
    gsd: {CONFIGS}/gsd/EXMP1D01.gsd
    address: 5
    slots: {{1: 16DI, 2: 8DO, 4: Counter}}
    signals:
      present: 1.1.0.3
      parts: {{at: 4.1.0, type: uint32}}
plant:
  step: 4ms
  models:
    - {{name: gripper, kind: cylinder, time: 80ms}}
    - {{name: handling, python: {CONFIGS}/pick-and-place/handling.py, step: 32ms}}
    - {{name: alarm, kind: lamp}}
  wires:
    - x.place -> handling.x
    - z.place -> handling.z
    - island.close -> gripper.extend
    - gripper.position -> handling.closed
    - gripper.extended -> island.gripper_closed
    - gripper.retracted -> island.gripper_open
    - handling.part_present -> island.part_present
    - handling.part_present -> slave.present
    - island.alarm -> alarm.on
"""
_MORE_CONTROLLERS = """\
  ethernetip: {{ip: 10.77.1.251/23, rpi: 40ms, timeout_multiplier: 16}}
  profibus: {{address: 1, cycle: 40ms, watchdog: 5s, latency: 400ms, retries: 3{line}}}
"""


def cell_text(drives: int, link: str, api: str, line: Path | None = None) -> str:
    """A farm file with so many drives of the makers' models, as many of each as their cycles suggest, and the rest of a
    cell if they are not few; ``line``: the pty of its PROFIBUS line, in real time."""
    counts = dict.fromkeys(MODELS, 0)
    counts["hiwin-e1"] = max(1, drives // _E1_SHARE) if drives > 3 else 0
    others = [name for name in MODELS if name != "hiwin-e1"]
    for place in range(drives - counts["hiwin-e1"]):
        counts[others[place % len(others)]] += 1
    whole = drives >= FEWEST_OF_A_CELL
    lines = f", lines: {{profibus: {{pty: {line}}}}}" if line is not None and whole else ""
    groups, first = [], 11
    for name, count in counts.items():
        if count:
            telegram = ", telegram: 3" if name == "hiwin-e1" else ""
            groups.append(
                f'  - {{name: "{name.partition("-")[0]}{"-old" if name.endswith("2012") else ""}-{{n:02}}",'
                f" count: {count}, model: {name}, ip: 10.77.0.{first}/23, cycle: {MODELS[name]}{telegram}}}\n"
            )
            first += count
    text = f"farm: soak\nlink: {{kind: {link}{lines}}}\napi: {api}\ndrives:\n{''.join(groups)}"
    if not whole:
        return text + _CONTROLLER
    way = f", link: {{kind: serial, port: {line}}}" if line is not None else ""
    return text + _MORE_DRIVES + _MORE + _CONTROLLER + _MORE_CONTROLLERS.format(line=way)


#: The second farm: its shards, drives, and the bridge that its interfaces join.
SHARDS, LINE_DRIVES, BRIDGE = 2, 6, "soak-line"


def line_text() -> str:
    """A farm for shards: a plant has none, so the cell is not divided."""
    return f"""\
farm: soak-line
link: {{kind: veth, bridge: {BRIDGE}}}
drives:
  - {{name: 'line-{{n:02}}', count: {LINE_DRIVES}, model: akd-profinet, ip: 10.78.0.11/24, cycle: 32ms}}
{_CONTROLLER.replace("10.77.1.250/23", "10.78.0.250/24")}"""


def on_serial_line(station: str) -> bool:
    """Whether it is one of the slaves on PROFIBUS."""
    return station.startswith("dp-") or station == "slave"
