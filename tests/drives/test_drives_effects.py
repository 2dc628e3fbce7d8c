"""What each row says that its parameter does is what it does: acts, reads live, is kept without effect, is constant."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from drives_kit import Running
from model_copy import copy_model, rewrite

import pnfarm
from pnfarm.buses.profinet.device.fault_diagnosis import fault_entry
from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.model import Model
from pnfarm.drives.description.motor_kinds import with_motor
from pnfarm.drives.description.parts import Effect
from pnfarm.drives.motion_tasks import MotionTask
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.network import NoNetwork
from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError
from pnfarm.drives.parameters.store import ParameterStore, ParameterWritten
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table import signals
from pnfarm.table.axis_codes import MOTION_HALTED
from pnfarm.table.image import IMAGE
from pnfarm.table.layout import SETTINGS

NAMES = sorted(models())
MS = 1_000_000
#: Commands that edit motion tasks, in an order that gives each of them something to do.
TASK_SET = "task-set"


def rows_with(name: str, effect: Effect) -> list[Parameter]:
    described = model(name)
    return [p for p in described.parameters.values() if effect_of(described, p) is effect]


def store_of(described: Model) -> ParameterStore:
    axis, image = AXIS.allocate(1)[0], IMAGE.allocate(1)[0]
    store = ParameterStore(described, AxisHandle(axis, image))
    described.apply_motor(axis)
    store.power_on()
    return store


def with_its_motor(described: Model, parameter: Parameter) -> Model:
    return with_motor(described, "linear") if parameter.motor == "linear" else described


def footprint(store: ParameterStore) -> tuple[object, ...]:
    """All that a parameter can reach: the axis record, the process image, the telegram."""
    handle = store.handle
    words = (store.telegram_number, store.mapping(setpoint=True), store.mapping(setpoint=False))
    return handle.axis.tobytes(), handle.image.tobytes(), words, store.waiting_name


# what the firmware reads


class _Reads(ast.NodeVisitor):
    """Fields, by their keys, and slots that compiled code looks at.

    A function takes the axis, or a part of it by the part's name; what it calls otherwise it says in an assignment.
    """

    def __init__(self) -> None:
        self.fields: set[str] = set()
        self.slots: set[int] = set()
        self._called: dict[str, list[str]] = {}

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self._called = {"axis": []}
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if isinstance(node.targets[0], ast.Name) and isinstance(node.value, ast.Attribute):
            self._called[node.targets[0].id] = self._names(node.value)
        self.generic_visit(node)

    def _names(self, node: ast.expr) -> list[str]:
        """The names that lead to this, without what the axis is called and the word settings."""
        if isinstance(node, ast.Name):
            return self._called.get(node.id, [node.id])
        if not isinstance(node, ast.Attribute):
            return []
        return [*self._names(node.value), *([node.attr] if node.attr != SETTINGS else [])]

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.ctx, ast.Load):
            self.fields.add(".".join(self._names(node)))
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "received":
            names = (part.id for part in ast.walk(node.slice) if isinstance(part, ast.Name))
            self.slots.update(getattr(signals, name) for name in names if hasattr(signals, name))
        self.generic_visit(node)


@cache
def reads() -> _Reads:
    found = _Reads()
    root = Path(pnfarm.__file__).parent
    for path in [*(root / "firmware").rglob("*.py"), root / "drives" / "axis_commands.py"]:
        found.visit(ast.parse(path.read_text(encoding="utf-8")))
    return found


# acts


def others(parameter: Parameter) -> list[int]:
    """Values beside the default that a parameter takes."""
    low, high, usual = parameter.minimum, parameter.maximum, parameter.default
    wanted = (usual + 1, usual - 1, low, high, usual // 2, (low + high) // 2, 2 * usual, 1, 3)
    return [value for value in dict.fromkeys(wanted) if parameter.allows(value) and value != usual]


def reaches(store: ParameterStore, parameter: Parameter) -> bool:
    """Whether some value of it changes what the drive has beside the value itself."""
    described = store.model
    task, units = described.motion_tasks, described.position_units
    if units is not None and parameter.pnu in {units.numerator, units.denominator}:
        store.write(units.unit, 0, [units.revolution.index(0.0)])
    for value in others(parameter):
        if parameter.after_power_on:
            store.power_on()
        before, numbers = footprint(store), numbers_of_places(store, parameter)
        try:
            store.write(parameter.pnu, 0, [value])
        except ParameterError:
            continue
        if task is not None and parameter.pnu in (task.number, *task.contents):
            described_commands = {p.argument: p.pnu for p in described.parameters.values()}
            store.write(described_commands[TASK_SET], 0, [0])
        if parameter.after_power_on:
            assert footprint(store) == before, "not at once"
            store.power_on()
        if footprint(store) != before or numbers_of_places(store, parameter) != numbers:
            return True
    return False


def numbers_of_places(store: ParameterStore, parameter: Parameter) -> list[list[int]]:
    """Those of the other parameters, which follow the unit of positions."""
    rows = store.model.parameters.values()
    return [store.read(p.pnu) for p in rows if p.scale == "position" and p.pnu != parameter.pnu]


def editing(described: Model) -> ParameterStore:
    """A drive with a motion task under edit that can be kept, as number 1."""
    store = store_of(described)
    task = described.motion_tasks
    if task is not None:
        chained = MotionTask(1, 0.0, 1.0, 1.0, 1.0, following=2, dwell_ns=1).control
        for pnu, value in (
            (task.number, 1), (task.position, 5), (task.velocity, 500_000), (task.control, chained), (task.next, 2),
        ):  # fmt: skip
            store.write(pnu, 0, [value])
        for pnu in (task.acceleration, task.deceleration):
            store.write(pnu, 0, [30_000_000])
        command = next(p.pnu for p in described.parameters.values() if p.argument == TASK_SET)
        store.write(command, 0, [0])
    return store


@pytest.mark.parametrize("name", NAMES)
def test_every_row_that_acts_by_its_value_reaches_what_the_firmware_reads(name: str) -> None:
    described = model(name)
    for parameter in rows_with(name, Effect.ACTS):
        target = described.canonical(parameter)
        if target.backing is Backing.FIELD:
            assert target.argument in reads().fields, f"{name} {parameter.pnu}: nobody reads {target.argument}"
        elif target.backing is Backing.SIGNAL:
            assert target.index in reads().slots, f"{name} {parameter.pnu}: nobody reads its slot"
        elif target.backing is not Backing.STORED:
            continue
        store = editing(with_its_motor(described, parameter))
        if described.diagnosis_coding is not None and target.pnu == described.diagnosis_coding.mode_parameter:
            assert told(store, target) > 2, f"{name} {parameter.pnu}"
        elif described.bus == "profibus" and target.pnu in {918, 1256}:
            # the slave reads them: tests/buses/profibus/test_profibus_product.py
            assert target.pnu in {
                described.bus_facts[key].value for key in ("address_parameter", "diagnosis_parameter")
            }
        elif target.pnu in described.access.mapping_elements:
            assert remaps(store, target), f"{name} {parameter.pnu}"
        else:
            assert reaches(store, target), f"{name} {parameter.pnu} {parameter.name}"


def told(store: ParameterStore, parameter: Parameter) -> int:
    """In how many ways the parameter makes the drive report a fault."""
    seen = set()
    for value in range(parameter.maximum + 1):
        store.write(parameter.pnu, 0, [value])
        seen.add(fault_entry(store, next(iter(store.model.diagnoses))))
    return len(seen)


def remaps(store: ParameterStore, parameter: Parameter) -> bool:
    """Whether another element changes what the free mapping shows of an array."""
    free = next(t.number for t in store.model.profidrive.telegrams.values() if t.free_mapping)
    array = next(
        s.number
        for s in store.model.profidrive.signals.values()
        if s.stored and store.model.parameters[s.number].elements
    )
    store.plug_telegram(free)
    mapping = next(p.pnu for p in store.model.parameters.values() if p.argument == "actual-mapping")
    store.write(mapping, 0, [array, array])
    before = footprint(store)
    store.write(parameter.pnu, 0, [3, 3])
    return footprint(store) != before


@pytest.mark.parametrize("name", NAMES)
def test_every_computed_row_that_acts_changes_telegram_history_or_name(name: str) -> None:
    for parameter in rows_with(name, Effect.ACTS):
        if parameter.backing is not Backing.COMPUTED:
            continue
        store = store_of(model(name))
        before, ring = footprint(store), int(store.handle.axis.commands.settings.head)
        if parameter.text:
            store.network = NoNetwork()
            store.write(parameter.pnu, 0, list(b"other"))
        elif parameter.only_reset:
            store.write(parameter.pnu, 0, [0])
        elif parameter.elements:
            free = [t.number for t in store.model.profidrive.telegrams.values() if t.free_mapping][-1]
            store.plug_telegram(free)
            before = footprint(store)
            setpoint = parameter.argument == "setpoint-mapping"
            words = [
                s
                for s in store.model.profidrive.signals.values()
                if s.setpoint == setpoint and s.bits == 16 and not s.shown_as
            ]
            mapped = len(store.output_words()) - store.telegram.parameter_words
            store.write(parameter.pnu, 0, [words[0].number, words[-1].number] + [0] * (mapped - 2))
        else:
            store.write(parameter.pnu, 0, [7])
        assert footprint(store) != before or int(store.handle.axis.commands.settings.head) != ring, (
            f"{name} {parameter.pnu}"
        )


#: States in which one command or another is taken: fields of the axis record.
STATES = (
    {},
    {"drive.state": 4, "drive.opmode": 2},
    {"drive.state": 4, "drive.opmode": 2, "positioning.state": MOTION_HALTED},
    {"drive.state": 4, "drive.opmode": 1, "drive.setpoint_ignored": 1, "service.mode": 2},
)


def answers(described: Model, parameter: Parameter) -> set[str]:
    """What a command does in each of these states: refused, nothing, or something."""
    seen = set()
    for state in STATES:
        store = editing(described)
        changed = next(p for p in described.parameters.values() if p.backing is Backing.STORED and p.nonvolatile)
        store.write(changed.pnu, 0, others(changed)[:1])
        if described.motion_tasks is not None:
            store.write(described.motion_tasks.velocity, 0, [700_000])
        store.events()
        for field, value in state.items():
            AXIS.write(store.handle.axis, field, value)
        before = (footprint(store), store.snapshot(), dict(store._values.current))
        try:
            store.write(parameter.pnu, 0, [1])
        except ParameterError:
            seen.add("refused")
            continue
        after = (footprint(store), store.snapshot(), dict(store._values.current))
        other = [event for event in store.events() if not isinstance(event, ParameterWritten)]
        seen.add("something" if after != before or other else "nothing")
    return seen


@pytest.mark.parametrize("name", NAMES)
def test_a_command_acts_in_some_state_of_the_drive_or_is_constant(name: str) -> None:
    described = model(name)
    for parameter in described.parameters.values():
        if parameter.backing is Backing.COMMAND:
            acts = "something" in answers(described, parameter)
            wanted = Effect.ACTS if acts else Effect.CONSTANT
            assert effect_of(described, parameter) is wanted, f"{parameter.pnu} {parameter.name}"


# kept


def lived(name: str, changed: list[Parameter]) -> tuple[object, ...]:
    """A drive whose ``changed`` parameters have other values is switched on, turns and stops; all that it then is."""
    running = Running(name)
    store = running.drive.store
    for parameter in changed:
        values = [others(parameter)[0]] * max(parameter.elements, 1)
        store.write(parameter.pnu, 0, values)
    for word in (0x0476, 0x0477, 0x047F):
        running.send(word)
    running.send(0x047F, 0x0400, 60)
    running.send(0x0476, 0, 60)
    kept = {parameter.pnu for parameter in rows_with(name, Effect.KEPT)}
    rows = store.model.parameters.values()
    readable = (p for p in rows if p.readable and p.pnu not in kept and p.argument != "changed-list")
    read = [(p.pnu, store.read(p.pnu, 0, max(p.elements, 1))) for p in readable]
    return footprint(store), read


@pytest.mark.parametrize("name", NAMES)
def test_rows_that_are_kept_reach_nothing_and_read_back_what_was_written(name: str) -> None:
    """One that reaches something acts: what names it belongs into ``effects``."""
    kept = [p for p in rows_with(name, Effect.KEPT) if others(p)]
    assert len(kept) >= len(rows_with(name, Effect.KEPT)) - 1, "all but one have more than one value"
    usual = lived(name, [])
    if lived(name, kept) != usual:
        assert not [p.pnu for p in kept if lived(name, [p]) != usual]
    store = store_of(model(name))
    for parameter in kept:
        values = [others(parameter)[0]] * max(parameter.elements, 1)
        store.write(parameter.pnu, 0, values)
        assert store.read(parameter.pnu, 0, len(values)) == values


@pytest.mark.parametrize("name", NAMES)
def test_notes_that_say_kept_or_without_effect_agree(name: str) -> None:
    said = re.compile(r"^kept|no effect|(?<!kept )without effect")
    for parameter in model(name).parameters.values():
        if said.search(parameter.note):
            assert effect_of(model(name), parameter) is Effect.KEPT, f"{parameter.pnu}: {parameter.note}"


# live and constant


class _Elsewhere:
    name, ip, mask, gateway = "elsewhere", 0x0A000001, 0xFF000000, 0x0A0000FE
    macs = (b"\x02\0\0\0\0\x01",) * 3
    line_rate = 6


def disturb(store: ParameterStore) -> None:
    """Everything that a drive can be or do is another thing than after power on."""
    axis, image = store.handle.axis, store.handle.image
    numbers = list(store.model.faults)
    for place, (key, field) in enumerate(AXIS.fields.items()):
        if field.writer in {"firmware", "fault"} and field.kind == "f8":
            AXIS.write(axis, key, 1.2345 + place / 100)
    axis.drive.state, axis.drive.stop, axis.profidrive.motion_status = 5, 2, 0x0FFF
    for place in range(8):
        axis.faults.code[place] = numbers[place % len(numbers)]
    axis.faults.buffer[:] = numbers[0]
    axis.faults.counter, axis.faults.changes, axis.faults.kept = 3, 5, 1
    axis.warnings.active[:] = 0x11
    axis.machine.limit_switch, axis.machine.inputs, axis.life.failed, axis.life.count = 3, 0x7F, 1, 20
    axis.drive.settings.interlocks, axis.drive.lacks = 3, 7
    axis.foldback.settings.fault_level = 0.5
    image.sent[:], image.received[:], image.valid = 0x0155, 0x02AA, 1
    store.network = _Elsewhere()
    store.watchdog_ns = 48 * MS
    mode = int(axis.drive.settings.opmode)
    if others_of := [number for number in store.model.profidrive.telegrams if number != store.telegram_number]:
        store.plug_telegram(others_of[-1])
    axis.drive.settings.opmode = 2 if mode != 2 else 1
    changed = next((p for p in store.model.parameters.values() if p.backing is Backing.STORED and p.writable), None)
    if changed is not None:
        store._values.current[changed.pnu] = others(changed)[0]


def readings(store: ParameterStore, rows: list[Parameter]) -> dict[int, list[int]]:
    return {p.pnu: store.read(p.pnu, 0, max(p.elements, 1)) for p in rows if p.readable}


@pytest.mark.parametrize("name", NAMES)
def test_live_rows_read_what_the_drive_is_or_does(name: str) -> None:
    rows = rows_with(name, Effect.LIVE)
    assert not [p.pnu for p in rows if p.writable]
    store = store_of(model(name))
    before = readings(store, rows)
    disturb(store)
    after = readings(store, rows)
    assert [pnu for pnu in before if before[pnu] == after[pnu]] == []


@pytest.mark.parametrize("name", NAMES)
def test_constant_rows_read_the_same_whatever_the_drive_does(name: str) -> None:
    rows = rows_with(name, Effect.CONSTANT)
    store = store_of(model(name))
    before = readings(store, rows)
    disturb(store)
    network = [p.pnu for p in rows if p.argument == "station-macs"]
    after = readings(store, rows)
    assert [pnu for pnu in before if before[pnu] != after[pnu] and pnu not in network] == []
    for parameter in rows:
        if parameter.writable:
            assert parameter.backing is Backing.COMMAND


# where it is said


@pytest.mark.parametrize("name", NAMES)
def test_json_shows_the_effect_of_every_row(name: str) -> None:
    described = model(name)
    shown = {row["pnu"]: row["effect"] for row in as_json(described)["parameters"]}
    assert shown == {p.pnu: effect_of(described, p).value for p in described.parameters.values()}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '2127 = { value = "constant"',
            '2127 = { value = "idle"',
            r"effects\.2127: 'idle' is not one of acts, live, kept",
        ),
        (
            '2127 = { value = "constant"',
            '2127 = { value = "acts"',
            r"effects\.2127: its row gives the same effect without",
        ),
        ("2127 = {", "17 = {", r"effects\.17: there is no parameter 17"),
        ("2127 = {", "en = {", r"effects: there is no parameter 'en'"),
    ],
)
def test_an_entry_that_departs_from_the_rule_has_a_reason_and_departs(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    folder = copy_model("akd-profinet", tmp_path / "model")
    rewrite(folder, "model.toml", old, new, -1)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)
