"""A farm with drives, a device and a plant on each bus, whose state tests save in the middle of a motion."""

from farm_file import CONFIGS

_PLANT = """
plant:
  step: 2ms
  models:
    - {{name: gripper, kind: cylinder, time: 800ms}}
    - {{name: parts, kind: counter}}
    - {{name: shaft, kind: elastic-load, axis: {axis}, inertia: 1.0e-4, stiffness: 20, damping: 0.01}}
    - {{name: press, python: {python}}}
  wires:
    - {axis}.shaft_position -> press.travel
    - gripper.extended -> parts.up
    - {bit}
"""
MODEL = """
class Press:
    inputs = {"travel": "revolutions"}
    outputs = {"force": float, "hot": bool}

    def __init__(self):
        self.strokes = []
        self.total = 0.0

    def step(self, dt):
        self.total += self.travel * dt
        self.strokes = [*self.strokes[-9:], round(self.total, 3)]
        self.force = self.total
        self.hot = self.total > 0.5
"""
_FILES = {
    "profinet": """farm: cell
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, start: 1, model: akd-profinet, ip: 10.77.0.11/24, params: {DRV.OPMODE: 2}}
devices:
  - name: island
    gsdml: GSDML
    access_point: DAP 1
    ip: 10.77.0.41/24
    slots: {1: 16DI, 2: 8DO, 3: EX-AI-4}
    signals:
      part_present: 1.1.0.3
      pressure: {at: 3.1.0, type: int16, unit: bar, scale: 0.01}
controller:
  ip: 10.77.0.1/24
  telegram: 9
  program: PROGRAM
""".replace("GSDML", str(CONFIGS / "gsdml" / "GSDML-V2.35-Example-Island-20261127.xml")),
    "ethernetip": """farm: cell
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, start: 1, model: akd-ethernetip, ip: 10.77.0.11/24}
devices:
  - name: island
    eds: EDS
    ip: 10.77.0.61/24
    connection: Exclusive owner
    signals: {part_present: 102.1.0.3}
controller:
  ip: 10.77.0.1/24
  program: PROGRAM
""".replace("EDS", str(CONFIGS / "eds" / "Example-Weigher-20261128.eds")),
    "profibus": """farm: cell
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, start: 1, model: moog-msd-dp, address: 11}
devices:
  - name: island
    gsd: GSD
    address: 5
    slots: {1: 16DI, 2: 8DO, 4: Counter}
    signals: {part_present: 1.1.0.3}
controller:
  cycle: 10ms
  telegram: 9
  program: PROGRAM
""".replace("GSD", str(CONFIGS / "gsd" / "EXMP1D01.gsd")),
}
POSITIONS = "{kind: positions, targets: [0, 6], speed_rpm: 240, acceleration: 3000, acknowledge_after: 200ms}"


def cell_text(bus, folder, *, program=POSITIONS):
    """The text of the farm file on this bus; its plant's model in Python is put into ``folder``."""
    (folder / "press.py").write_text(MODEL)
    bit = "gripper.extended -> island.part_present"
    plant = _PLANT.format(axis="axis-1", python=folder / "press.py", bit=bit)
    return _FILES[bus].replace("PROGRAM", program) + plant
