"""A line goes back to a moment: everything is as it was then, and goes on as it went on then."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moment_cell import cell_text

from pnfarm import AxisProgram
from pnfarm.errors import ConfigError
from pnfarm.testing import Line

BUSES = ("profinet", "ethernetip", "profibus")


def seen(line):
    """What a user sees of a whole line."""
    return {
        "time": line.now,
        "drives": [(d.state, d.position, d.velocity, d.stw1, d.zsw1) for d in line.drives],
        "signals": {name: line.device("island").signals[name] for name in line.device("island").signals},
        "plant": {name: [getattr(line.plant[name], port) for port in dir(line.plant[name])] for name in line.plant},
        "log": [str(entry) for entry in (*line.events(), *line.controller_events())],
        "controller": line._line.joined.summary(),
    }  # fmt: skip


@pytest.mark.parametrize("bus", BUSES)
def test_a_positioning_task_goes_on_from_the_moment_and_ends_at_the_same_time(bus, tmp_path):
    with Line.from_text(cell_text(bus, tmp_path)) as line:
        line.wait_running()
        axis = line["axis-1"]
        line.wait_until(lambda: axis.position > 2, within=10, every=0.01)
        line.plant.gripper.extend = True
        line.run(0.3)
        moment = line.save()
        assert moment.left_out == ()
        then, position = seen(line), line.plant.gripper.position
        assert 2 < axis.position < 6
        assert 0 < line.plant.gripper.position < 1

        def end():
            line.wait_until(lambda: axis.position > 5.99, within=10, every=0.01)
            line.run(0.5)
            return seen(line)

        first = end()
        line.restore(moment)
        assert seen(line) == then
        assert end() == first
        line.restore(moment)
        line["axis-2"].power_off()
        line.plant.gripper.extend = False
        line.run(1.0)
        assert line.plant.gripper.position < position
        line.restore(moment)
        assert end() == first


@pytest.mark.parametrize("bus", BUSES)
def test_a_force_and_a_fault_of_then_are_back_and_later_ones_are_gone(bus, tmp_path):
    with Line.from_text(cell_text(bus, tmp_path)) as line:
        line.wait_connected()
        island = line.device("island")
        island.force({"part_present": True})
        moment = line.save()
        island.release()
        lost = line.inject("loss", on="axis-1", probability=1.0)
        line.run(1.0)
        assert island.signals["part_present"] is False
        assert not line["axis-1"].connected
        line.restore(moment)
        assert island.signals["part_present"] is True
        assert island.signals.owner("part_present") == "force"
        assert line["axis-1"].connected
        lost.clear()
        line.run(1.0)
        assert line["axis-1"].connected
        assert not line.core.injections.concerned


def test_parameters_that_were_changed_since_are_back():
    with Line("axis-01") as line:
        axis = line["axis-01"]
        line.wait_running()
        axis.set_parameter("DRV.ACC", 20_000)
        moment = line.save()
        axis.set_parameter("DRV.ACC", 30_000)
        axis.set_parameter("DRV.NVSAVE", 1)
        line.run(0.1)
        line.restore(moment)
        assert axis.parameter("DRV.ACC") == 20_000
        axis.power_cycle()
        line.run(0.1)
        assert axis.parameter("DRV.ACC") != 30_000


def test_a_program_of_ones_own_goes_on_with_the_attributes_that_it_had():
    class Counts(AxisProgram):
        def __init__(self):
            self.count = 0
            self.seen = []

        def cycle(self, inputs, outputs, now):
            self.count += 1
            self.seen.append(now)

    with Line("a", program=Counts, cycle="16ms") as line:
        line.run(1)
        moment = line.save()
        program = line.program("a")
        count = program.count
        line.run(1)
        after = list(program.seen)
        line.restore(moment)
        assert line.program("a") is program
        assert program.count == len(program.seen) == count
        line.run(1)
        assert program.seen == after


def test_a_program_that_did_not_return_is_called_again_behind_the_moment():
    class Hangs(AxisProgram):
        hang = False

        def cycle(self, inputs, outputs, now):
            while type(self).hang:
                pass

    controller = {"program": {"python": "(in memory)", "limit": "20ms"}}
    with Line("a", program=Hangs, cycle="16ms", controller=controller) as line:
        line.run(0.2)
        moment = line.save()
        Hangs.hang = True
        line.run(0.1)
        assert line.controller("a")["program"]["failure"]
        Hangs.hang = False
        line.restore(moment)
        assert not line.controller("a")["program"]["failure"]
        calls = line.controller("a")["program"]["calls"]
        line.run(0.2)
        assert line.controller("a")["program"]["calls"] > calls
        assert not line.controller("a")["program"]["failure"]


def test_what_a_program_has_that_no_moment_knows_is_named():
    class Odd(AxisProgram):
        def __init__(self):
            self.numbers = iter([1, 2, 3])

        def cycle(self, inputs, outputs, now):
            pass

    with Line("a", program=Odd) as line:
        line.run(0.1)
        assert line.save().left_out == ("builtins.list_iterator",)


def test_a_moment_is_of_one_line():
    with Line("a") as line, Line("a") as other:
        moment = other.save()
        with pytest.raises(ConfigError, match=r"of another line"):
            line.restore(moment)


@settings(max_examples=5, deadline=None)
@given(st.lists(st.sampled_from(["run", "power", "fault", "parameter", "restore"]), max_size=6))
def test_whatever_happens_a_restore_is_the_same_moment(steps):
    with Line("a", "b") as line:
        line.wait_running()
        moment = line.save()
        then = [array.tobytes() for array in line.core.columns[:10]]
        for step in steps:
            match step:
                case "run":
                    line.run(0.3)
                case "power":
                    line["a"].power_cycle()
                case "fault":
                    line.inject("drive-fault", on="b", fault=702)
                case "parameter":
                    line["a"].set_parameter("DRV.ACC", 20_000)
                case _:
                    line.restore(moment)
            line.run(0.01)
        line.restore(moment)
        assert [array.tobytes() for array in line.core.columns[:10]] == then
        line.wait_running()
