"""Inputs with a wire under a force: the wire's end is torn or bridged."""

import json
from copy import copy

import pytest

from pnfarm.errors import ConfigError
from pnfarm.farm.state.content import TakenState, check_state, put_state
from pnfarm.signals.refusal import SignalError
from pnfarm.testing import Line

CELL = """
farm: t
link: {kind: memory}
drives: [{name: x, model: akd-profinet, ip: 10.77.0.11/24}]
plant:
  models: [{name: button, kind: push-button}, {name: lamp, kind: lamp}, {name: parts, kind: counter}]
  wires: [button.on -> lamp.on, lamp.lit -> parts.up]
"""


@pytest.fixture
def line():
    with Line.from_text(CELL) as line:
        line.run(0.01)
        yield line


def _of(line, model):
    return line.core.plant.parts[model].signals


def test_a_model_or_port_that_is_not_there_is_no_attribute(line):
    plant = line.plant
    assert (hasattr(plant, "lamp"), hasattr(plant, "gripper")) == (True, False)
    assert (hasattr(plant.lamp, "lit"), getattr(plant.lamp, "dark", None)) == (True, None)
    assert copy(plant).lamp.lit == plant.lamp.lit
    with pytest.raises(AttributeError, match="the plant has no model 'lam', did you mean lamp"):
        _ = plant.lam
    with pytest.raises(ConfigError, match="the plant has no model 'lam'"):
        _ = plant["lam"]
    with pytest.raises(ConfigError, match="dark"):
        plant.lamp.dark = True


def test_a_forced_input_keeps_its_value_whatever_its_wire_brings_until_it_is_released(line):
    lamp = _of(line, "lamp")
    assert (lamp.owner("on"), lamp.force({"on": True}), lamp.owner("on")) == ("plant", {}, "force")
    line.run(0.01)
    assert line.plant.lamp.lit
    line.plant.button.press = True
    line.run(0.01)
    lamp.force({"on": False})
    line.run(0.01)
    assert not line.plant.lamp.lit
    lamp.force({"*": None})
    line.run(0.01)
    assert (line.plant.lamp.lit, lamp.owner("on")) == (True, "plant")


def test_a_released_input_without_a_wire_has_what_it_had_at_the_start():
    arm = "{name: arm, kind: elastic-load, axis: x, stiffness: 30, inertia: 2.0e-4, offset: 0.25}"
    with Line.from_text(CELL.replace("models: [", f"models: [{arm}, ")) as line:
        signals = _of(line, "arm")
        signals.force({"offset": 0.5})
        signals.force({"offset": None})
        assert (signals.get("offset"), signals.owner("offset")) == (0.25, "default")
        signals.set({"offset": 0.75})
        signals.force({"offset": 0.5})
        signals.force({"*": None})
        assert (signals.get("offset"), signals.owner("offset")) == (0.75, "value")


def test_it_is_not_written_and_what_is_wrong_leaves_it_to_its_wire(line):
    lamp = _of(line, "lamp")
    with pytest.raises(SignalError, match="has a wire, which writes it; allowed: an input without a wire, or a force"):
        lamp.set({"on": True})
    with pytest.raises(SignalError, match="is an output of the plant"):
        lamp.force({"on": True, "lit": True})
    line.run(0.01)
    assert not line.plant.lamp.lit


def test_a_saved_state_has_the_force(line):
    lamp = _of(line, "lamp")
    lamp.force({"on": True})
    line.run(0.01)
    forced = json.loads(json.dumps(TakenState(line.core).plain()))
    lamp.force({"on": None})
    line.run(0.01)
    free = json.loads(json.dumps(TakenState(line.core).plain()))
    for state, lit in ((forced, True), (free, False), (forced, True)):
        put_state(line.core, check_state(line.core, state), line.now_ns)
        line.run(0.01)
        assert (line.plant.lamp.lit, lamp.owner("on")) == (lit, "force" if lit else "plant")


def test_a_moment_has_the_force(line):
    lamp = _of(line, "lamp")
    before = line.save()
    lamp.force({"on": True})
    line.run(0.01)
    line.restore(before)
    line.run(0.01)
    assert (line.plant.lamp.lit, lamp.owner("on"), line.plant.parts.count) == (False, "plant", 0)


def test_a_release_that_names_an_output_leaves_it_as_it_is(line):
    line.plant.button.press = True
    line.run(0.01)
    parts = _of(line, "parts")
    parts.force({"count": None})
    assert (parts.get("count"), parts.owner("count")) == (1.0, "plant")


def test_a_release_with_an_unknown_name_releases_nothing(line):
    button = _of(line, "button")
    button.force({"press": True})
    with pytest.raises(SignalError, match="nothing: is not a port"):
        button.force({"press": None, "nothing": None})
    assert (button.get("press"), button.owner("press")) == (True, "force")
