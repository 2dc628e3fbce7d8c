"""The state of a whole farm as plain data: saved in the middle of a motion, put back, refused where it is wrong."""

import asyncio
import copy
import json
import os
from math import isinf, isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moment_cell import POSITIONS, cell_text

from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.state import axis_fields
from pnfarm.farm.state.content import TakenState, check_state, put_state
from pnfarm.farm.state.files import StateFiles
from pnfarm.farm.state.refused import RefusedStateError
from pnfarm.farm.state.states import SavedStates
from pnfarm.firmware.axis import AXIS
from pnfarm.station.event_log import EventLog
from pnfarm.testing import Line

BUSES = ("profinet", "ethernetip", "profibus")


def taken(line):
    """The state as it comes out of a file."""
    found = json.loads(json.dumps(TakenState(line.core).plain(), allow_nan=False))
    del found["saved"]
    return found


def put(line, state):
    return put_state(line.core, check_state(line.core, state), line.now_ns)


def states_of(line, folder):
    return SavedStates(line.core, folder, lambda: line.now_ns)


@pytest.fixture
def moving(request, tmp_path):
    """A line whose first axis is on its way, with its cylinder in mid-stroke and a forced input."""
    with Line.from_text(cell_text(getattr(request, "param", "profinet"), tmp_path)) as line:
        line.wait_running()
        line.wait_until(lambda: line["axis-1"].position > 2, within=10, every=0.02)
        line.device("island").force({"part_present": True})
        line.plant.gripper.extend = True
        line.run(0.3)
        yield line


@pytest.mark.parametrize("moving", BUSES, indirect=True)
def test_a_restored_farm_is_as_it_was_and_its_controllers_come_back(moving):
    axis, island = moving["axis-1"], moving.device("island")
    state, place, stroke = taken(moving), axis.position, moving.plant.gripper.position
    moving.run(1.5)
    island.release()
    axis.power_cycle()
    notes = put(moving, state)
    assert taken(moving)["plant"] == state["plant"]
    assert axis.position == place
    assert axis.velocity == pytest.approx(240, abs=1)
    assert moving.plant.gripper.position == stroke
    assert 0 < stroke < 1
    assert island.signals.owner("part_present") == "force"
    assert [note.partition(":")[0] for note in notes] == ["axis-1", "axis-1", "axis-2", "axis-2", "island"]
    assert "set up again by its controller" in notes[0]
    assert "its power stage is off" in notes[1]
    moving.run(0.02)
    # without its controller it coasts, as after a connection that was closed
    assert not axis.connected
    assert axis.state == "S1"
    assert axis.fault is None
    assert 0 < axis.velocity < 240
    moving.run(0.7)
    assert moving.plant.gripper.extended
    moving.wait_running()
    # its home is known: the task to the target is carried out
    moving.wait_until(lambda: axis.position > 5.9, within=10, every=0.02)


@pytest.mark.parametrize("moving", BUSES, indirect=True)
def test_the_same_state_goes_on_in_the_same_way(moving):
    state = taken(moving)

    def follow():
        put(moving, state)
        seen = []
        for _ in range(3):
            moving.run(0.1)
            seen.append([(d.state, d.position, d.velocity) for d in moving.drives] + [moving.plant.gripper.position])
        return seen

    first = follow()
    moving.run(0.777)
    for mine, other in zip(follow(), first, strict=True):
        # a drive's step may begin at another part of its cycle
        assert [drive[1] for drive in mine[:-1]] == pytest.approx([drive[1] for drive in other[:-1]], abs=0.02)
        assert mine[-1] == pytest.approx(other[-1], abs=0.01)


def test_parameters_saved_values_and_names_are_those_of_the_state(tmp_path):
    with Line("axis-01", params={"DRV.DEC": 11_000}) as line:
        axis = line["axis-01"]
        line.wait_running()
        axis.set_parameter("DRV.ACC", 20_000)
        axis.set_parameter("DRV.NVSAVE", 1)
        axis.set_parameter("DRV.ACC", 25_000)
        line.run(0.1)
        state = taken(line)
        axis.set_parameter("DRV.ACC", 30_000)
        axis.set_parameter("DRV.DEC", 12_000)
        axis.set_parameter("DRV.NVSAVE", 1)
        line.run(0.1)
        put(line, state)
        assert (axis.parameter("DRV.ACC"), axis.parameter("DRV.DEC")) == (25_000, 11_000)
        assert float(line.core.axes[0].handle.axis.ramp.settings.acceleration) == pytest.approx(25)
        axis.power_cycle()
        assert axis.parameter("DRV.ACC") == 20_000


def test_faults_and_their_history_are_back():
    with Line("axis-01", program=None) as line:
        axis = line["axis-01"]
        line.run(0.1)
        with axis.inject("drive-fault", fault=702):
            line.run(0.1)
        assert axis.fault == 702
        state = taken(line)
        axis.power_cycle()
        line.run(0.1)
        assert axis.fault is None
        put(line, state)
        line.run(0.1)
        assert axis.fault == 702
        assert int(line.core.axes[0].handle.axis.faults.counter) == 1


def test_an_active_fault_has_its_diagnosis_again():
    with Line("a", model="profidrive") as line:
        line.wait_running()
        axis = line["a"]
        axis.inject("drive-fault", fault=4)
        line.run(0.01)
        state, device = taken(line), line.core.axes[0].device
        assert len(device.records.diagnosis) == 1
        line.reset()
        axis.power_cycle()
        assert len(device.records.diagnosis) == 0
        put(line, state)
        assert len(device.records.diagnosis) == 1
        # it is acknowledged as any other, by the controller that comes back
        line.wait_running()
        assert len(device.records.diagnosis) == 0


AXES = """
farm: gantry
link: {kind: memory}
drives:
  - name: cu
    model: profidrive
    ip: 10.77.0.11/24
    axes:
      - {name: x, telegram: 1}
      - {name: y, telegram: 1, params: {p2000: 1500.0}}
      - {name: z, telegram: 1}
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 300, acknowledge_after: 300ms}}
"""


def test_each_axis_of_a_drive_is_as_it_was(tmp_path):
    with Line.from_text(AXES) as line:
        line.wait_running()
        line.run(1.0)
        x, y, z = (line[f"cu.{name}"] for name in "xyz")
        z.inject("drive-fault", fault=4)
        line.run(0.05)
        state = taken(line)
        before = [(axis.position, axis.velocity, axis.fault and axis.fault.number) for axis in (x, y, z)]
        assert [fault for *_, fault in before] == [None, None, 4]
        line.reset()
        x.power_cycle()
        line.wait_running()
        line.run(1.0)
        notes = put(line, state)
        after = [(axis.position, axis.velocity) for axis in (x, y, z)]
        assert after == [(position, velocity) for position, velocity, _ in before]
        assert [note.partition(":")[0] for note in notes] == ["cu", "cu.x", "cu.y"]
        line.run(0.01)
        assert [axis.fault and axis.fault.number for axis in (x, y, z)] == [None, None, 4]
        line.wait_running()
        assert (x.position, y.position) > (before[0][0], before[1][0])
        # one axis fewer is another farm file
        fewer = AXES.replace("      - {name: z, telegram: 1}\n", "")
    with Line.from_text(fewer) as line, pytest.raises(RefusedStateError, match=r"another farm file: cu has other axes"):
        check_state(line.core, state)


def test_a_drive_that_was_off_is_off_again():
    with Line("a", "b") as line:
        line["a"].power_off()
        line.run(0.1)
        state = taken(line)
        line["a"].power_on()
        line.wait_running()
        put(line, state)
        line.run(0.1)
        assert not line.core.station("a").powered
        assert line.core.station("b").powered
        line["a"].power_on()
        line.wait_running()


def test_a_fault_that_holds_the_supply_off_is_in_force_behind_a_restore():
    with Line("a") as line:
        line.wait_running()
        state = taken(line)
        fault = line["a"].inject("power-cycle", off="1s")
        line.run(0.2)
        put(line, state)
        line.run(0.2)
        assert not line.core.station("a").powered
        fault.clear()
        assert line.core.station("a").powered
        line.wait_running()


def test_a_drive_that_is_off_in_the_state_stays_off_behind_a_fault():
    with Line("a") as line:
        line["a"].power_off()
        state = taken(line)
        line["a"].power_on()
        fault = line["a"].inject("power-cycle", off="1s")
        put(line, state)
        fault.clear()
        assert not line.core.station("a").powered


def test_a_drive_that_is_off_is_restored_any_number_of_times():
    with Line("a") as line:
        line["a"].power_off()
        state = taken(line)
        for _ in range(20):
            put(line, state)
        line["a"].power_on()
        line.wait_running()


def test_a_farm_of_devices_alone_has_a_state(tmp_path):
    text = cell_text("profinet", tmp_path).partition("plant:")[0]
    before, _, behind = text.partition("drives:")
    with Line.from_text(before + behind[behind.index("devices:") : behind.index("controller:")]) as line:
        island = line.device("island")
        island.force({"part_present": True})
        state = taken(line)
        island.release()
        put(line, state)
        assert island.signals.get("part_present") is True


def test_a_memory_that_fills_up_meanwhile_leaves_every_drive_as_it_was():
    class Full(VolatileMemory):
        """With room for so many saves; what is held is read."""

        room = 1_000_000

        def save(self, station, values):
            self.room -= 1
            if self.room < 0:
                raise EnvironmentError_("the disk is full")
            super().save(station, values)

        def hold(self, station, values):
            VolatileMemory.save(self, station, values)

    memory = Full()
    drives = "[{name: 'axis-{n}', count: 3, model: akd-profinet, ip: 10.77.0.11/24}]"
    text = f"farm: f\nlink: {{kind: memory}}\ndrives: {drives}\n"
    line = asyncio.run(VirtualLine.create(parse_farm(text), memory=memory, log=EventLog(quiet=True)))
    line.world.run(0.1)
    state = json.loads(json.dumps(TakenState(line.farm).plain()))
    for station in line.farm.stations:
        station.keep(line.world.now, "faults", [702])
    memory.room = 2
    with pytest.raises(EnvironmentError_, match="full"):
        put_state(line.farm, check_state(line.farm, state), line.world.now)
    for station in line.farm.stations:
        assert memory.load(station.configured_name)["faults"] == [702]
        station.power_cycle(line.world.now)
        assert station.kept["faults"] == [702]


@pytest.mark.parametrize("key", ["drive", "faults"])
def test_memory_that_no_drive_writes_is_refused(key):
    with Line("a") as line:
        state = taken(line)
        state["stations"]["a"]["memory"][key] = [["odd"]]
        with pytest.raises(RefusedStateError, match=key):
            check_state(line.core, state)


def test_a_state_of_an_earlier_run_fits_a_later_one(tmp_path):
    with Line("axis-01") as line:
        line.wait_running()
        line.run(5)
        state, place = taken(line), line["axis-01"].position
    with Line("axis-01") as line:
        line.run(0.05)
        put(line, state)
        assert line["axis-01"].position == place
        line.wait_running()
        assert line["axis-01"].position == pytest.approx(place, abs=1)


def test_a_state_of_another_farm_file_is_refused_with_the_station(tmp_path):
    with Line("a", "b") as line, Line("a") as fewer, Line("a", "b", model="moog-msd") as others:
        state = taken(line)
        with pytest.raises(RefusedStateError, match=r"another farm file: station 'b' is only in the state"):
            check_state(fewer.core, state)
        with pytest.raises(RefusedStateError, match=r"another farm file: a is another model there"):
            check_state(others.core, state)
        with pytest.raises(RefusedStateError, match=r"another version of pnfarm"):
            check_state(line.core, {**state, "layout": "0"})
        with pytest.raises(RefusedStateError, match=r"format 2"):
            check_state(line.core, {**state, "pnfarm_state": 2})


ODD = """
class Press:
    inputs = {"travel": "revolutions"}
    outputs = {"force": float, "hot": bool}

    def __init__(self):
        self.own = object()
        self.count = 0

    def step(self, dt):
        self.count += 1
"""
SAVES = (
    ODD
    + """
    def save(self):
        return {"count": self.count}

    def restore(self, state):
        if state["count"] > 10_000:
            raise ValueError("too many")
        self.count = state["count"]
"""
)


def with_model(tmp_path, model):
    text = cell_text("profinet", tmp_path)
    (tmp_path / "press.py").write_text(model)
    return Line.from_text(text)


def test_a_model_in_python_keeps_its_attributes_and_the_others_are_named(tmp_path):
    with with_model(tmp_path, ODD) as line:
        line.run(0.1)
        model = line.core.plant.python._models[0].model
        assert TakenState(line.core).notes[0] == "press: own of press.py cannot be saved"
        state, count = taken(line), model.count
        line.run(0.1)
        put(line, state)
        assert model.count == count > 0


def test_forced_octets_and_a_forced_real_that_is_no_number_are_saved_and_restored(tmp_path):
    text = cell_text("profinet", tmp_path).replace("3: EX-AI-4}", "3: EX-AI-4, 4: VALVES}")
    text = text.replace("    signals:\n", "    signals:\n      raw: {at: 3.1.4, type: 'octets[2]'}\n"
                        "      level: {at: 4.1.2, type: float32, direction: input}\n", 1)  # fmt: skip
    with Line.from_text(text) as line:
        island = line.device("island")
        island.force({"raw": b"\x01\x02", "level": nan})
        state = taken(line)
        island.release()
        put(line, state)
        assert island.signals["raw"] == b"\x01\x02"
        assert isnan(island.signals["level"])


DEFAULTS = """
from dataclasses import dataclass

@dataclass
class Press:
    speed: float = 1.0
    count = 0
    late = 0

    def step(self, dt):
        self.count += 1
        if self.count > 150:
            self.late += 1

Press.inputs = {"travel": "revolutions"}
Press.outputs = {"force": float, "hot": bool}
"""


def test_a_model_in_python_may_have_values_in_its_class(tmp_path):
    with with_model(tmp_path, DEFAULTS) as line:
        line.run(0.2)
        model = line.core.plant.python._models[0].model
        state, count = taken(line), model.count
        line.run(0.2)
        assert model.late > 0
        put(line, state)
        assert (model.count, model.late, model.speed) == (count, 0, 1.0)
        for name in ("step", "__class__", "speed x"):
            state["plant"]["python"]["press"]["attributes"] = {name: 1}
            with pytest.raises(RefusedStateError, match="is no attribute that can be restored"):
                put(line, state)


def test_a_model_in_python_may_save_itself_and_refuse(tmp_path):
    with with_model(tmp_path, SAVES) as line:
        line.run(0.1)
        model = line.core.plant.python._models[0].model
        assert not [note for note in TakenState(line.core).notes if note.startswith("press")]
        state, count = taken(line), model.count
        line.run(0.1)
        put(line, state)
        assert model.count == count
        state["plant"]["python"]["press"]["own"]["count"] = 20_000
        line.wait_running()
        with pytest.raises(ConfigError, match=r"plant model press cannot be restored: ValueError: too many"):
            put(line, state)
        # nothing was changed
        assert line["axis-1"].connected
        assert model.count < 20_000


# -- files


def test_states_are_saved_listed_restored_and_deleted(tmp_path):
    with Line("a", "b") as line:
        line.wait_running()
        line.run(1)
        states = states_of(line, tmp_path / "states")

        async def use():
            notes = await states.save("mid")
            assert notes == ["connections are not saved, those of a b"]
            assert [one.name for one in await states.kept()] == ["mid"]
            place = line["a"].position
            line.run(1)
            assert await states.restore("mid", only_check=True) == []
            assert line["a"].position != place
            await states.restore("mid")
            assert line["a"].position == place
            await states.delete("mid")
            assert await states.kept() == []
            with pytest.raises(ConfigError, match=r"there is no state mid"):
                await states.restore("mid")
            with pytest.raises(ConfigError, match=r"is no name of a state"):
                await states.save("../up")

        asyncio.run(use())
        assert [entry.event for entry in line.events()][-1] == "state restored"


def test_a_farm_without_a_folder_says_where_to_give_one():
    with Line("a") as line, pytest.raises(ConfigError, match=r"give it `state: FOLDER`, or `pnfarm up --state DIR`"):
        asyncio.run(states_of(line, None).save("x"))


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    files = StateFiles(tmp_path)
    files.write("x", {"old": 1})

    def full(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(EnvironmentError_, match=r"cannot write state x in .*: no space left on device"):
        files.write("x", {"new": 2})
    assert files.read("x") == {"old": 1}
    assert [path.name for path in tmp_path.iterdir()] == ["x.json"]


@pytest.mark.parametrize(
    ("octets", "why"),
    [
        (b"", "is not JSON"),
        (b"\xff\xfe", "is not JSON"),
        (b"[" * 200_000, "nested too deeply"),
        (b"[1" + b"0" * 5000 + b"]", "is not JSON"),
    ],
)
def test_a_file_that_is_no_json_is_refused(tmp_path, octets, why):
    (tmp_path / "x.json").write_bytes(octets)
    with pytest.raises(RefusedStateError, match=why):
        StateFiles(tmp_path).read("x")
    (tmp_path / "x.json").unlink()
    os.mkfifo(tmp_path / "x.json")
    with pytest.raises(EnvironmentError_, match=r"it is a pipe"):
        StateFiles(tmp_path).read("x")


# -- properties


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    with Line.from_text(cell_text("profinet", tmp_path_factory.mktemp("cell"), program=POSITIONS)) as line:
        line.run(0.2)
        yield line, taken(line)


def _leaves(value, path=()):
    if isinstance(value, dict | list):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(one, (*path, key))
    yield path


_ODD = st.one_of(
    st.none(), st.booleans(), st.integers(-(1 << 70), 1 << 70), st.floats(), st.text(max_size=5),
    st.just([]), st.just({}), st.just({"a": [1]}), st.sampled_from(["inf", "nan", 10**400, -(10**400), [[]] * 3]),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_changed_state_is_refused_with_a_sentence_or_fits(cell, data):
    line, state = cell
    found = copy.deepcopy(state)
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(sorted(_leaves(found), key=repr)))
        place = found
        if not path:
            continue
        for key in path[:-1]:
            place = place[key]
        if data.draw(st.booleans()):
            place[path[-1]] = data.draw(_ODD)
        elif isinstance(place, dict):
            del place[path[-1]]
        else:
            place.insert(0, data.draw(_ODD))
    refused = ""
    try:
        check_state(line.core, found)
    except RefusedStateError as exc:
        refused = str(exc)
    assert "\n" not in refused
    assert len(refused) < 1000


def test_a_homing_mode_that_the_drive_does_not_have_is_not_saved_as_one_that_it_has():
    rows = AXIS.allocate(1)
    rows[0].homing.method_in_force = 99
    (fields,) = axis_fields.fields_of(rows)
    assert fields["homing.method_in_force"] == 99
    assert axis_fields.check_fields(fields, "axis-1") == fields


def _numbers(key):
    field = axis_fields._FIELDS[key]
    if field.unit == "ns":
        one = st.none() | st.integers(-(10**15), 10**15)
    elif field.kind.startswith("f"):
        one = st.floats(-1e15, 1e15)
        one = one | st.just("inf") if isinf(field.default) else one
    else:
        low, high = axis_fields._LIMITS.get(key, (0, 100 if field.kind != "u1" else 255))
        one = st.integers(low, high)
    return st.lists(one, min_size=field.shape[0], max_size=field.shape[0]) if field.shape else one


@settings(max_examples=20, deadline=None)
@given(st.fixed_dictionaries({key: _numbers(key) for key in axis_fields._FIELDS}))
def test_any_state_of_an_axis_comes_out_as_it_was_put_in_and_can_be_stepped(cell, fields):
    line, state = cell
    found = copy.deepcopy(state)
    found["stations"]["axis-1"]["axes"]["axis-1"]["fields"] = fields
    found["stations"]["axis-1"]["powered"] = True
    put(line, found)
    assert taken(line)["stations"]["axis-1"]["axes"]["axis-1"]["fields"] == fields
    line.run(0.01)
    put(line, state)
