"""Numbers of the farm file: each has physical limits, and no accepted farm leads to NaN or infinity."""

from __future__ import annotations

import asyncio
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from pnfarm.config.axis import Load, Motor
from pnfarm.config.controller import Program
from pnfarm.config.tasks import Task
from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.farm.file.sections import FarmSections
from pnfarm.firmware.axis import AXIS
from pnfarm.station.event_log import EventLog

#: Fields where infinity is a word: no limit.
UNLIMITED = frozenset(name for name, field in AXIS.fields.items() if field.default == math.inf)
MODELS = ("akd-profinet", "akd-profinet-2012", "hiwin-e1", "moog-msd")
FILE = {"farm": "numbers", "link": {"kind": "memory"}, "drives": [], "controller": {"ip": "10.77.1.250/23"}}


def group(**keys: Any) -> dict[str, Any]:
    return {"name": "a", "model": "akd-profinet", "limits": "lax", **keys}


def told(**keys: Any) -> str:
    with pytest.raises(FarmFileError) as caught:
        parse_farm(json.dumps({**FILE, "drives": [group(**keys)]}))
    return str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"load": {"gear": 1e-300}}, ["drives[0].load.gear: is 1e-300", "from 0.0001 to"]),
        ({"load": {"inertia": 1e200}}, ["drives[0].load.inertia: is 1e+200", "from 1e-09 to"]),
        ({"load": {"torque": -1e300}}, ["drives[0].load.torque: is -1e+300"]),
        ({"load": {"lead": 1e-300, "mass": 1}}, ["drives[0].load.lead: is 1e-300"]),
        ({"motor": {"inductance": 1e-300}}, ["drives[0].motor.inductance: is 1e-300", "0, or a number from 1e-09 on"]),
        ({"motor": {"bus_voltage": 0.5}}, ["drives[0].motor.bus_voltage: is 0.5", "0, or a number from 1 on"]),
        ({"motor": {"continuous_current": 1e-300}}, ["drives[0].motor.continuous_current: is 1e-300"]),
        (
            {"machine": {"end_stops": [-1e200, 1e200]}},
            ["drives[0].machine.end_stops[0]: is -1e+200", "a number from -1000000.0 to 1000000.0"],
        ),
        (
            {"motion_tasks": [{"number": 1, "position": 1e300, "velocity": 1e-300, "acceleration": 1e300}]},
            ["motion_tasks[0].position: is 1e+300", "motion_tasks[0].velocity", "motion_tasks[0].acceleration"],
        ),
    ],
)
def test_an_impossible_number_is_reported_with_what_is_allowed(keys: dict[str, Any], words: list[str]) -> None:
    message = told(**keys)
    assert [word for word in words if word not in message] == []


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"load": {"gear": 1e-4, "driven_inertia": 1e9}}, ["drives[0].load: makes the motor's inertia 1e+17 kg m^2"]),
        (
            {"load": {"lead": 1e5, "gear": 1e-4, "force": 1e7}},
            ["drives[0].load: makes the motor's load torque 1.59155e+12"],
        ),
        (
            {"model": "hiwin-e1", "motor": {"kind": "linear", "pitch": 0.1, "max_velocity": 1e6}},
            ["drives[0].motor: makes the motor's max velocity 6e+08 rpm", "allowed: 0.001 to 1e+06 rpm in all"],
        ),
        ({"load": {"lead": 1e-3, "gear": 1e5}}, ["drives[0].load: makes 1e+08 revolutions of the motor to one unit"]),
    ],
)
def test_numbers_that_contradict_each_other_are_reported(keys: dict[str, Any], words: list[str]) -> None:
    message = told(**keys)
    assert [word for word in words if word not in message] == []


@pytest.mark.parametrize(
    "text",
    [
        "drives: [{name: a, params: {DRV.OPMODE: }}]",
        "drives: [{name: a, params: {DRV.OPMODE: }, model: }]",
        "drives: [{name: a, identity: {vendor: }, params: {a: , b: }, load: {gear: }}]",
        "drives: [{name: a, behaviour: {x: }, motor: {kind: 5, pitch: }}]",
    ],
)
def test_what_is_wrong_in_a_group_without_a_model_is_reported(text: str) -> None:
    with pytest.raises(FarmFileError, match="model: is"):
        parse_farm(f"farm: a\nlink: {{kind: memory}}\n{text}")


def _numbers(schema: dict[str, Any], at: str = "") -> list[tuple[str, dict[str, Any]]]:
    """(key, schema) of every number below a schema."""
    found = [(at, schema)] if schema.get("type") == "number" else []
    for key, below in schema.get("properties", {}).items():
        found += _numbers(below, f"{at}.{key}")
    for below in (*schema.get("anyOf", ()), *schema.get("allOf", ()), *[schema[k] for k in ("items",) if k in schema]):
        found += _numbers({**{k: v for k, v in schema.items() if k.startswith(("min", "max", "excl"))}, **below}, at)
    return found


def test_every_number_of_a_farm_file_has_limits_on_both_sides() -> None:
    schema = FarmSections.model_json_schema(by_alias=True)
    sections = [(name, below) for name, below in schema["$defs"].items()]
    loose = []
    for name, below in [("", schema), *sections]:
        for key, number in _numbers(below, name):
            low = "minimum" in number or "exclusiveMinimum" in number
            high = "maximum" in number or "exclusiveMaximum" in number
            if not (low and high):
                loose.append(key)
    assert loose == []


# --- whole farms --------------------------------------------------------------------------------------------------


#: Keys that are zero or not below this.
LEAST = {"resistance": 1e-6, "inductance": 1e-9, "bus_voltage": 1.0, "encoder_steps": 1.0}


def _between(key: str, schema: dict[str, Any]) -> st.SearchStrategy[float]:
    """Numbers of a key's range: its ends, and of every order of magnitude."""
    least = LEAST.get(key, 1e-9)
    low = schema.get("minimum", least)
    high = schema["maximum"]
    ends = [low, high, *([0.0] if low < 0.0 else [])]
    least = max(low, least)

    def spread(part: float) -> float:
        return min(high, max(low, least * (high / least) ** part))

    sign = st.sampled_from([1.0, -1.0]) if low < 0.0 else st.just(1.0)
    scaled = st.builds(lambda part, sign: max(low, spread(part) * sign), st.integers(0, 64).map(lambda n: n / 64), sign)
    return st.one_of(st.sampled_from(ends), scaled)


def _section(model: type[Any], without: tuple[str, ...] = ()) -> st.SearchStrategy[dict[str, Any]]:
    schema = model.model_json_schema(by_alias=True)
    numbers = {}
    for key, below in schema["properties"].items():
        found = _numbers(below)
        if found and below.get("type") != "array" and key not in without:
            numbers[key] = _between(key, found[0][1])
    return st.fixed_dictionaries({}, optional=numbers)


def _ends() -> st.SearchStrategy[list[float | None]]:
    places = st.one_of(st.none(), st.floats(1e-6, 1e6))
    return st.tuples(places, places).map(lambda ends: [None if ends[0] is None else -ends[0], ends[1]])


ROTARY = st.fixed_dictionaries(
    {"model": st.sampled_from(MODELS), "load": _section(Load), "motor": _section(Motor, ("pitch",))}
)
LINEAR = st.fixed_dictionaries(
    {
        "model": st.just("hiwin-e1"),
        "load": _section(Load, ("gear", "driven_inertia", "lead")),
        "motor": _section(Motor).map(lambda motor: {**motor, "kind": "linear"}),
    }
)
MACHINE = st.fixed_dictionaries({}, optional={"limit_switches": _ends(), "end_stops": _ends()})
TASKS = st.lists(_section(Task, ("number", "next")).map(lambda task: {"number": 1, **task}), max_size=1)
GROUPS = st.builds(
    lambda base, machine, tasks, step: {
        **base,
        "machine": machine,
        "motor": {**base["motor"], **step},
        **({"motion_tasks": tasks} if base["model"].startswith("akd") else {}),
    },
    st.one_of(ROTARY, ROTARY, LINEAR),
    MACHINE,
    TASKS,
    st.sampled_from([{}, {}, {"step": "62.5us"}]),
)
PROGRAMS = st.builds(
    lambda kind, numbers: {"kind": kind, "acknowledge_after": "100ms", **numbers},
    st.sampled_from(["constant", "ramp", "sine"]),
    _section(Program, ("targets",)),
)


def _accepted(drive: dict[str, Any]) -> bool:
    try:
        parse_farm(json.dumps({**FILE, "drives": [group(**drive)]}))
    except FarmFileError:
        return False
    return True


def wrong_numbers(axes: Any) -> dict[str, Any]:
    """Floats of axis records that are no numbers, and those that are infinite where that means nothing."""
    found = {}
    for name, field in AXIS.fields.items():
        if field.kind.startswith("f"):
            values = np.asarray(AXIS.read(axes, name))
            wrong = np.isnan(values) if name in UNLIMITED else ~np.isfinite(values)
            if wrong.any():
                found[name] = values.tolist()
    return found


@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(st.lists(GROUPS, min_size=4, max_size=8), PROGRAMS)
def test_every_farm_that_is_accepted_runs_on_numbers(drives: list[dict[str, Any]], program: dict[str, Any]) -> None:
    drives = [drive for drive in drives if _accepted(drive)]
    if not drives:
        return
    groups = [
        {"limits": "lax", **drive, "name": f"axis-{place}", "ip": f"10.77.0.{place + 11}/23"}
        for place, drive in enumerate(drives)
    ]
    controller = {**FILE["controller"], "program": program}
    config = parse_farm(json.dumps({**FILE, "drives": groups, "controller": controller}))
    quiet = EventLog(quiet=True)
    line = asyncio.run(VirtualLine.create(config, log=quiet, plc_log=EventLog(quiet=True)))
    assert wrong_numbers(line.farm.columns.axis) == {}
    line.world.run(2.0)
    assert wrong_numbers(line.farm.columns.axis) == {}
    assert line.plc.all_connected, [session.measures.last_reason for session in line.plc.sessions]
