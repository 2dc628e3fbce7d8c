"""All drives at a glance: who knows a version gets what changed since, and nothing else."""

import json

import pytest

from pnfarm.farm.views.overview import ROUNDS, Overview
from pnfarm.testing import Line

SECOND = 1_000_000_000
FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: "axis-{{n:03}}", count: {count}, model: akd-profinet, ip: 10.0.0.1/16}}
"""


class Viewer:
    """Keeps what it was told, as a page does."""

    def __init__(self, overview):
        self.overview, self.version = overview, 0
        self.values, self.rows, self.messages = {}, {}, []

    def look(self):
        message = json.loads(self.overview.since(self.version))
        self.messages.append(message)
        self.version = message["version"]
        for name, (places, values) in message.get("values", {}).items():
            every = range(len(values)) if places is None else places
            self.values.setdefault(name, {}).update(zip(every, values, strict=True))
        self.rows.update({int(place): row for place, row in message.get("rows", {}).items()})
        return message


@pytest.fixture
def farm():
    """A line of powered drives, its overview, and how time passes between two looks."""
    made = []

    def make(count=3):
        line = Line.from_text(FARM.format(count=count))
        made.append(line)
        return line, Overview(line.core, lambda: line.now_ns)

    yield make
    for line in made:
        line.close()


def test_a_new_viewer_gets_every_drive_and_then_what_changed(farm):
    line, overview = farm()
    viewer = Viewer(overview)
    viewer.look()
    assert [viewer.rows[place]["name"] for place in range(3)] == ["axis-001", "axis-002", "axis-003"]
    assert set(viewer.values["velocity"]) == {0, 1, 2}
    line.run(0.2)
    viewer.look()
    line.run(0.2)
    assert "values" not in viewer.look()
    line.run(0.2)
    line.core.columns.axis[1].motor.velocity = 12.34
    assert viewer.look()["values"]["velocity"] == [[1], [123]]


def test_a_drive_without_supply_has_a_state_of_its_own(farm):
    line, overview = farm(1)
    viewer = Viewer(overview)
    line.run(0.5)
    viewer.look()
    assert viewer.values["state"][0] > 0
    line.core.axes[0].station.power_off(line.now_ns)
    line.run(0.2)
    viewer.look()
    assert viewer.values["state"][0] == -1
    assert viewer.rows[0]["ar_state"] == "NO_AR"


def test_a_drive_without_supply_has_no_fault(farm):
    line, overview = farm(1)
    viewer = Viewer(overview)
    line.run(0.5)
    line.core.axes[0].raise_fault("undervoltage", hold=True)
    line.run(0.1)
    viewer.look()
    assert viewer.values["fault"] == {0: 502}
    line.core.axes[0].station.power_off(line.now_ns)
    line.run(0.2)
    viewer.look()
    assert viewer.values["fault"] == {0: 0}


def test_a_viewer_that_was_away_is_told_all_that_it_missed(farm):
    line, overview = farm()
    here, away = Viewer(overview), Viewer(overview)
    here.look()
    away.look()
    for speed in (10.0, 20.0, 30.0):
        line.core.columns.axis[2].motor.velocity = speed
        line.run(0.1)
        here.look()
    away.look()
    assert away.values == here.values
    assert away.rows == here.rows


def test_an_event_of_a_drive_shows_its_row_at_the_next_look(farm):
    line, overview = farm(100)
    viewer = Viewer(overview)
    for _ in range(ROUNDS + 5):
        viewer.look()
        line.run(0.1)
    line.core.injections.inject({"kind": "slow-ramp", "on": "axis-071"}, line.now_ns)
    line.core.service(line.now_ns)
    line.run(0.1)
    assert viewer.look()["rows"]["70"]["injected"] == [["fault-1", "slow-ramp"]]


def test_rows_of_a_large_farm_come_in_turn_and_none_is_left_out(farm):
    line, overview = farm(300)
    viewer = Viewer(overview)
    for _ in range(10):
        viewer.look()
        line.run(0.1)
    assert set(viewer.rows) == set(range(300))
    assert max(len(message.get("rows", {})) for message in viewer.messages) <= 64


def test_viewers_that_are_equally_up_to_date_share_one_text(farm):
    _, overview = farm()
    assert overview.since(0) is overview.since(0)


def test_a_motor_that_was_driven_out_of_all_numbers_is_shown_nevertheless(farm):
    line, overview = farm(1)
    line.core.columns.axis[0].motor.velocity = float("nan")
    line.core.columns.axis[0].motor.current = float("-inf")
    viewer = Viewer(overview)
    viewer.look()
    assert viewer.values["velocity"][0] == 0
    assert viewer.values["current"][0] == 1 - 2**53


def test_the_engine_is_told_once_a_second(farm):
    line, overview = farm(1)
    viewer = Viewer(overview)
    for _ in range(30):
        viewer.look()
        line.run(0.1)
    assert 3 <= sum("engine" in message for message in viewer.messages) <= 4
