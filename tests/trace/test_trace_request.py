"""The parser of requests and triggers: any text and any value gives a request or one sentence; and the drawings."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PROGRAM, Browser
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.table import trace as codes
from pnfarm.table.segments import Segments
from pnfarm.trace import Column, Recording, TraceError, TraceRequest
from pnfarm.trace.plot import as_html, as_svg, as_text
from pnfarm.trace.trigger import EVENTS, EventTrigger, SignalTrigger, parse_trigger, read_level, read_number
from pnfarm.vocabulary.problem import Problem

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=30),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
WORDS = st.sampled_from(
    ["velocity", "zsw1.fault_present", "rising", "falling", "changes", ">", "<=", "==", "1000", "-3.5", "0x10", "S4",
     "on", "axis-*", "fault", "702", "connect", "injection", "now", "manual", "nan", "1e999", "\n", "é", "bar",
     "6.5bar", "island-1.pressure", "island-1.", "1/min"]
)  # fmt: skip


def outcome(read: Any, text: Any) -> tuple[Any, str]:
    """What was read, or None and the sentence of the refusal."""
    try:
        return read(text), ""
    except (Problem, TraceError) as refusal:
        return None, str(refusal)


@given(st.text(max_size=60) | st.lists(WORDS, max_size=7).map(" ".join) | JSON)
def test_any_trigger_is_read_or_refused_in_one_sentence(text: Any) -> None:
    found, refusal = outcome(parse_trigger, text)
    if found is None:
        assert refusal
        assert "\n" not in refusal
    else:
        assert parse_trigger(found.text) == found


@given(
    st.dictionaries(
        st.sampled_from(["on", "signals", "trigger", "pre", "length", "every", "interval", "as", "keep", "x"]), JSON
    )
)
def test_any_request_is_read_or_refused_field_by_field(data: dict[str, Any]) -> None:
    request, refusal = outcome(TraceRequest.parse, data)
    if request is None:
        assert refusal.startswith("trace.")
        assert "\n" not in refusal
    else:
        assert TraceRequest.parse(request.as_dict()) == request


@given(st.text(max_size=20))
def test_a_level_is_a_finite_number_or_nothing(text: str) -> None:
    for value in (read_number(text), read_level(text)[0]):
        assert value is None or np.isfinite(value)


@given(st.floats(-1e9, 1e9), st.sampled_from(["", "bar", "rpm", "%", "°", "m/s", "N m"]), st.sampled_from(["", " "]))
def test_a_level_is_read_with_its_unit(number: float, unit: str, between: str) -> None:
    assert read_level(f"{number}{between}{unit}".rstrip()) == (number, unit.replace(" ", ""))
    trigger = parse_trigger(f"2nd-island.x > {number}{between}{unit}")
    assert isinstance(trigger, SignalTrigger)
    assert trigger.signal == "2nd-island.x"


def test_the_forms_of_a_trigger() -> None:
    assert parse_trigger("velocity>1000") == SignalTrigger("velocity>1000", codes.TRIGGER_ABOVE, "", "velocity", "1000")
    assert parse_trigger("  state  ==  S4  on axis-0* ") == SignalTrigger(
        "state == S4 on axis-0*", codes.TRIGGER_EQUAL, "axis-0*", "state", "S4"
    )
    assert parse_trigger("ZSW1.fault_present") == SignalTrigger(
        "ZSW1.fault_present", codes.TRIGGER_UNEQUAL, "", "ZSW1.fault_present", "0"
    )
    assert parse_trigger("fault 32-1 on axis-01") == EventTrigger(
        "fault 32-1 on axis-01", codes.TRIGGER_EVENT, "axis-01", "fault", "32-1"
    )
    for event in EVENTS:
        assert isinstance(parse_trigger(event), EventTrigger)
    for wrong in ("", "connect 3", "state changes 3", "velocity rising 3 4", "velocity > ", "> 3", 3, None):
        with pytest.raises(Problem):
            parse_trigger(wrong)


def test_free_parts_that_touch_become_one() -> None:
    room = Segments(10)
    one, two, three = (room.allocate(3) for _ in range(3))
    assert (one, two, three, room.allocate(2)) == (0, 3, 6, None)
    for start in (one, three, two):
        room.release(start)
    assert room.allocate(10) == 0
    assert (room.free, room.allocate(1)) == (0, None)


@given(st.lists(st.integers(1, 40), max_size=30), st.data())
def test_parts_of_the_ring_never_overlap_and_come_back(lengths: list[int], data: st.DataObject) -> None:
    room = Segments(100)
    held: dict[int, int] = {}
    for length in lengths:
        start = room.allocate(length)
        if start is not None:
            assert 0 <= start <= 100 - length
            assert all(start + length <= other or other + size <= start for other, size in held.items())
            held[start] = length
        if held and data.draw(st.booleans()):
            gone = data.draw(st.sampled_from(sorted(held)))
            room.release(gone)
            del held[gone]
    assert room.free == 100 - sum(held.values())


def recording(samples: int) -> Recording:
    time = (np.arange(samples) - samples // 4) / 1000
    pulse = np.zeros(samples, np.int64)
    pulse[samples // 2 : samples // 2 + 1] = 1
    columns = (
        Column("axis-01", "velocity", "rpm", "real", np.sin(time * 9) * 600),
        Column("axis-01", "state", "", "state", np.full(samples, 4)),
        Column("axis-01", "zsw1.<b>", "", "bit", pulse),
    )
    return Recording("t", "complete", True, "axis-01", "velocity > 1", 0.001, 0, time, columns)


@pytest.mark.parametrize("samples", [0, 1, 2, 50, 30_000])
@pytest.mark.parametrize("width", [20, 80, 200])
def test_a_recording_of_any_length_is_drawn_within_the_width(samples: int, width: int) -> None:
    text = as_text(recording(samples), width)
    assert len(text.splitlines()) == 5
    # a very narrow terminal still gets ten cells beside the names
    assert max(map(len, text.splitlines())) <= max(width, 48)
    if samples >= 50:
        # a pulse of one sample is seen
        assert "█" in text.splitlines()[2]


@pytest.mark.parametrize("samples", [2, 3, 50, 30_000])
def test_the_last_sample_is_drawn(samples: int) -> None:
    step = Column("axis-01", "zsw1.fault_present", "", "bit", (np.arange(samples) == samples - 1).astype(np.int64))
    time = np.arange(samples) / 1000
    text = as_text(Recording("t", "complete", True, "", "now", 0.001, 0, time, (step,)))
    assert "█" in text.splitlines()[0]


@pytest.mark.parametrize("samples", [0, 1, 50, 30_000])
def test_svg_and_html_are_well_formed_bounded_and_name_everything(samples: int) -> None:
    svg = as_svg(recording(samples))
    root = ET.fromstring(svg)
    assert len(svg) < 200_000
    titles = {title.text for title in root.iter("{http://www.w3.org/2000/svg}title")}
    assert {"axis-01 velocity [rpm]", "axis-01 state", "axis-01 zsw1.<b>"} <= titles
    page = as_html(recording(samples))
    assert "zsw1.<b>" not in page
    assert "zsw1.&lt;b&gt;" in page
    # nothing is loaded from elsewhere, and no value ends the script early
    assert not re.search(r"""(src|href)=["']|@import|url\(""", page)
    assert page.count("</script>") == 3


@pytest.mark.parametrize("samples", [0, 3000])
def test_page_draws_every_chart_in_a_browser(samples: int, tmp_path: Path) -> None:
    if PROGRAM is None:
        pytest.skip("chromium is not installed (apt-get install chromium)")
    file = tmp_path / "trace.html"
    file.write_text(as_html(recording(samples)), "utf-8")
    with Browser(tmp_path / "profile") as browser:
        browser.open(file.as_uri())
        # the script comes to its end: the plain picture gives way
        browser.until("document.getElementById('trace')?.hidden")
        titles = browser.ask(
            "[...document.querySelectorAll('#trace-charts .u-title')].map(one => one.innerText).join()"
        )
        assert titles == "rpm,axis-01 state,bits"
        assert browser.ask("document.querySelectorAll('#trace-charts canvas').length") == 3
