"""``realism`` of a drive group: its forms, what is wrong with it, and what is on where a file says nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from model_copy import SHIPPED

from pnfarm.drives import catalogue
from pnfarm.drives.description.realism import BOUNDS, Realism
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.farm.file.schema import farm_schema
from pnfarm.farm.realism import imperfections
from pnfarm.station.imperfections import Imperfections
from pnfarm.vocabulary.yaml_lines import parse_yaml

REAL = "{kind: macvlan, parent: eth1}"
LINE = "{kind: serial, pty: auto}"
MEMORY = "{kind: memory}"
FILE = """farm: f
link: {link}
drives:
  - name: axis-{{n}}
    count: {count}
    model: {model}
    limits: {limits}
    motor: {motor}
    realism: {realism}
    {place}
"""
#: A model of a further folder needs no figures.
MODELS = SHIPPED


def text(realism: str, *, link: str = MEMORY, model: str = "akd-profinet", limits: str = "strict", count: int = 1,
         motor: str = "{}") -> str:  # fmt: skip
    place = "ip: 10.77.0.11/23"
    if catalogue.model(model).bus == "profibus":
        place = "address: 11"
        link = LINE if link == REAL else link
    return FILE.format(realism=realism, link=link, model=model, limits=limits, count=count, motor=motor, place=place)


def flaws(realism: str, **options) -> list[Imperfections]:
    return [
        imperfections(drive.realism, model_of(drive), drive.name, by_source=drive.realism_by_source)
        for drive in expand(parse_farm(text(realism, **options)))
    ]


def complaints(realism: str, **options) -> list[str]:
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text(realism, **options))
    return str(caught.value).splitlines()


# --- forms ------------------------------------------------------------------------------------------------------


def test_every_key_takes_its_figure():
    (one,) = flaws(
        "{noise: {velocity: 2.0, current: 0.05, position: 1.0e-5}, parameter_latency: [5ms, 40ms], "
        "boot_time: {answers: 8s, ready: 10s}, clock_drift: 30, seed: 4}"
    )
    shown = one.shown()
    assert shown.pop("parameter_latency_seconds") == [0.005, 0.04]
    assert shown == pytest.approx(
        {
            "velocity_noise_rpm": 2.0,
            "current_noise_amperes": 0.05,
            "position_noise_revolutions": 1e-5,
            "answers_after_seconds": 8.0,
            "ready_after_seconds": 10.0,
            "clock_drift_ppm": 30.0,
        }
    )


def test_a_duration_and_a_number_alone_are_both_ends():
    (one,) = flaws("{parameter_latency: 20ms, boot_time: 8s, clock_drift: -12.5}")
    assert (one.latency_ns, one.answer_ns, one.ready_ns) == ((20_000_000, 20_000_000), 8 * 10**9, 8 * 10**9)
    assert one.drift == pytest.approx(-12.5e-6)


def test_a_linear_motor_has_its_noise_in_millimetres():
    (one,) = flaws("{noise: {velocity: 2.0, position: 0.004}}", model="hiwin-e1", motor="{kind: linear, pitch: 20}")
    assert one.velocity_noise == pytest.approx(2.0 * 60.0 / 20.0)
    assert one.position_noise == pytest.approx(0.004 / 20.0)


@pytest.mark.parametrize(
    "word", ["off", "false", "{noise: off, parameter_latency: off, boot_time: off, clock_drift: off}"]
)
@pytest.mark.parametrize("link", [MEMORY, REAL])
def test_off_is_nothing_anywhere(word, link):
    assert [one.shown() for one in flaws(word, link=link)] == [{}]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("word", ["on", "true"])
def test_on_is_all_that_the_model_has_assumed_or_not(word, model):
    (one,) = flaws(word, model=model)
    assert set(one.shown()) == {
        "velocity_noise_rpm", "current_noise_amperes", "position_noise_revolutions", "parameter_latency_seconds",
        "answers_after_seconds", "ready_after_seconds", "clock_drift_ppm",
    }  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
def test_a_key_alone_can_be_on(model):
    known = catalogue.model(model).realism
    (one,) = flaws("{noise: on, boot_time: {answers: on}}", model=model)
    assert (one.velocity_noise, one.current_noise, one.position_noise) == (
        known.velocity_noise, known.current_noise, known.position_noise,
    )  # fmt: skip
    assert (one.answer_ns, one.ready_ns, one.drift, one.latency_ns) == (known.answer_time_ns, 0, 0.0, (0, 0))


# --- what is on where the file says nothing ----------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("realism", ["{}", "{seed: 5}"])
def test_a_strict_drive_on_a_real_link_has_what_a_source_gives_a_figure_for(model, realism):
    (one,) = flaws(realism, link=REAL, model=model)
    described = catalogue.model(model)
    for name in BOUNDS:
        sourced = described.facts[f"realism.{name}"].source != "assumed"
        has = {
            "parameter_latency_ns": one.latency_ns[1],
            "answer_time_ns": one.answer_ns,
            "ready_time_ns": one.ready_ns,
            "clock_drift": one.drift,
        }.get(name, getattr(one, name, None))
        assert bool(has) == sourced, name


def test_of_the_akd_the_noise_of_speed_and_position_has_a_source():
    (one,) = flaws("{}", link=REAL)
    assert set(one.shown()) == {"velocity_noise_rpm", "position_noise_revolutions"}
    assert one.velocity_noise == pytest.approx(5 * 1638 * 60 * 16000 / 2**32, abs=0.01), "five steps of 7.1.4"


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("link", "limits"), [(MEMORY, "strict"), (MEMORY, "lax"), (REAL, "lax")])
def test_in_memory_and_with_lax_limits_nothing_is_on_by_itself(model, link, limits):
    assert [one.shown() for one in flaws("{}", link=link, limits=limits, model=model)] == [{}]


def test_a_given_key_leaves_the_others_as_they_are():
    (one,) = flaws("{parameter_latency: 20ms, noise: {position: off}}", link=REAL)
    assert set(one.shown()) == {"velocity_noise_rpm", "parameter_latency_seconds"}


# --- seeds ------------------------------------------------------------------------------------------------------


def test_drives_of_a_group_have_seeds_of_their_own_by_name():
    first, again = (flaws("{noise: on, seed: 9}", count=4) for _ in range(2))
    other = flaws("{noise: on}", count=4)
    assert first == again
    assert len({flaw.seed for flaw in first}) == 4
    assert {flaw.seed for flaw in first}.isdisjoint(flaw.seed for flaw in other)


# --- what is wrong ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("realism", "complaint"),
    [
        ("5", "realism: is 5; allowed: on, off, or a mapping such as {noise: on, parameter_latency: 20ms}"),
        ("maybe", "realism: is 'maybe'; allowed: on, off, or a mapping"),
        ("{noice: on}", "realism.noice: is not a key here, did you mean noise?"),
        ("{noise: 3}", "realism.noise: is 3; allowed: on, off, or a mapping such as {velocity: 2.0, current: 0.05}"),
        ("{noise: {velocity: -1}}", "realism.noise.velocity: is -1; allowed: a number from 0 to 1000 rpm, on or off"),
        ("{noise: {velocity: loud}}", "realism.noise.velocity: is 'loud'; allowed: a number from 0 to 1000 rpm"),
        ("{noise: {current: 101}}", "realism.noise.current: is 101; allowed: a number from 0 to 100 A"),
        ("{noise: {position: 1}}", "realism.noise.position: is 1; allowed: a number from 0 to 0.1 rev"),
        ("{noise: {position: .inf}}", "realism.noise.position: is inf; allowed: a number from 0 to 0.1 rev"),
        ("{noise: {speed: 1}}", "realism.noise.speed: is not a key here"),
        ("{parameter_latency: 20}", "realism.parameter_latency: is 20; allowed: a duration up to 10s, such as 20ms"),
        ("{parameter_latency: 11s}", "realism.parameter_latency: is 11s; allowed: a duration up to 10s"),
        ("{parameter_latency: [1ms]}", "realism.parameter_latency: has 1 entries; allowed: a list of two"),
        ("{parameter_latency: [9ms, 1ms]}", "realism.parameter_latency: begins above its end; allowed: the least"),
        ("{parameter_latency: [1ms, on]}", "realism.parameter_latency: 'on' is not a duration; allowed: a number with"),
        ("{parameter_latency: [1ms, 20]}", "realism.parameter_latency: is 20; allowed: a duration up to 10s"),
        ("{boot_time: 3}", "realism.boot_time: is 3; allowed: a duration such as 8s, on, off, or a mapping"),
        ("{boot_time: 11min}", "realism.boot_time: is 11min; allowed: a duration up to 600s"),
        ("{boot_time: {ready: soon}}", "realism.boot_time.ready: 'soon' is not a duration"),
        ("{clock_drift: 1001}", "realism.clock_drift: is 1001; allowed: a number from -1000 to 1000 ppm"),
        ("{clock_drift: [0, 1, 2]}", "realism.clock_drift: has 3 entries; allowed: a list of two"),
        ("{clock_drift: [5, -5]}", "realism.clock_drift: begins above its end"),
        ("{clock_drift: .nan}", "realism.clock_drift: is nan; allowed: a number from -1000 to 1000 ppm"),
        ("{seed: -1}", "realism.seed: is -1; allowed: a number from 0 to 18446744073709551615"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_reported_with_its_line_and_what_is_allowed(realism, complaint):
    (line,) = complaints(realism)
    assert line.startswith(f"<text>:9: drives[0].{complaint}"), line


def test_a_wrong_key_hides_no_other_mistake_of_the_file():
    lines = complaints("{noise: 3}", model="akd-profinet", motor="{kind: steam}")
    assert [line.split(":")[1] for line in lines] == ["8", "9"]


def test_on_for_a_figure_that_a_model_does_not_have_is_reported(monkeypatch):
    described = catalogue.model("moog-msd")
    facts = {key: fact for key, fact in described.facts.items() if not key.startswith("realism.")}
    monkeypatch.setattr(catalogue, "_loaded", lambda folder: replace(described, facts=facts, realism=Realism()))
    what = "is on, but moog-msd has no figure for it; allowed: a figure, or off"
    assert complaints("{noise: {velocity: on}, clock_drift: on}", model="moog-msd") == [
        f"<text>:9: drives[0].realism.{key}: {what}" for key in ("noise.velocity", "clock_drift")
    ]
    assert parse_farm(text("on", model="moog-msd")), "the short form takes what there is"


# --- JSON Schema ------------------------------------------------------------------------------------------------

_TYPES = {"number": (int, float), "integer": int, "string": str, "array": list, "object": dict}


def _fits(value, schema, defs) -> bool:
    """The part of JSON Schema that this section is written in."""
    if "$ref" in schema:
        return _fits(value, defs[schema["$ref"].removeprefix("#/$defs/")], defs)
    if "anyOf" in schema:
        return any(_fits(value, kind, defs) for kind in schema["anyOf"])
    if "enum" in schema:
        return any(type(value) is type(word) and value == word for word in schema["enum"])
    if isinstance(value, bool) or not isinstance(value, _TYPES[schema["type"]]):
        return False
    if isinstance(value, list):
        return schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 99) and all(
            _fits(item, schema["items"], defs) for item in value
        )
    if isinstance(value, dict):
        known = schema["properties"]
        return value.keys() <= known.keys() and all(_fits(inner, known[key], defs) for key, inner in value.items())
    return isinstance(value, str) or schema.get("minimum", value) <= value <= schema.get("maximum", value)


def fits(realism: str) -> bool:
    schema = farm_schema()
    value = parse_yaml(f"realism: {realism}").root.plain()["realism"]
    return _fits(value, schema["$defs"]["DriveGroup"]["properties"]["realism"], schema["$defs"])


@pytest.mark.parametrize(
    "realism",
    [
        "on", "off", "true", "false", "{}", "{noise: on}", "{noise: {velocity: 2}}", "{noise: {velocity: off}}",
        "{parameter_latency: 20ms}", "{parameter_latency: [5ms, 40ms]}", "{parameter_latency: on}", "{boot_time: 8s}",
        "{boot_time: off}", "{boot_time: {answers: 8s, ready: on}}", "{clock_drift: -50}", "{clock_drift: [-50, 50.5]}",
        "{seed: 3}",
    ],
)  # fmt: skip
def test_an_editors_schema_takes_what_the_program_takes(realism):
    parse_farm(text(realism))
    assert fits(realism)


@pytest.mark.parametrize(
    "realism",
    ["3", "maybe", "{noice: on}", "{noise: 3}", "{noise: {velocity: -1}}", "{parameter_latency: 20}", "{boot_time: 3}",
     "{clock_drift: 1001}", "{clock_drift: [1]}", "{seed: -1}"],
)  # fmt: skip
def test_an_editors_schema_refuses_what_the_program_refuses(realism):
    complaints(realism)
    assert not fits(realism)


_ANYTHING = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-(10**20), 10**20), st.floats(), st.text(max_size=8)),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(
        ["noise", "velocity", "current", "position", "parameter_latency", "boot_time", "answers", "ready",
         "clock_drift", "seed"]), inner, max_size=3)),
    max_leaves=6,
)  # fmt: skip


@given(_ANYTHING)
def test_any_value_is_taken_or_refused_with_a_reason_and_gives_finite_figures(value):
    config = parse_farm(text("off"))
    try:
        changed = config.with_overrides({"drives[0].realism": value})
    except FarmFileError:
        return
    (drive,) = expand(changed)
    made = imperfections(drive.realism, model_of(drive), drive.name, by_source=True)
    assert 0.0 <= made.velocity_noise <= 1000.0
    assert 0.0 <= made.current_noise <= 100.0
    assert 0.0 <= made.position_noise <= 0.1
    assert 0 <= made.latency_ns[0] <= made.latency_ns[1] <= 10 * 10**9
    assert 0 <= made.answer_ns <= 600 * 10**9
    assert abs(made.drift) <= 1e-3
