"""The web page in a real browser: what a person clicks there happens on the farm."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import anyio
import anyio.from_thread
import anyio.lowlevel
import pytest
from api_world import ApiWorld
from browser import PROGRAM, Browser

from pnfarm.api import serve

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")
TOKEN = "a-long-secret"  # a test's, nobody's
#: Chooses a kind of fault as a person does.
CHOOSE = "$('kind').value = '%s'; $('kind').dispatchEvent(new Event('change'))"
#: Whether all of an element can be seen and nothing lies above its middle.
SEEN = """(button => {
  const box = button.getBoundingClientRect();
  const at = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return box.left >= 0 && box.right <= innerWidth && at === button;
})(%s)"""


@contextmanager
def served(world):
    """The base URL; the server runs in a thread of its own, and the farm's time stands still."""
    found = {}
    up = threading.Event()

    async def main():
        async with anyio.create_task_group() as group:

            async def run(*, task_status):
                await serve(world.app, "127.0.0.1", 0, task_status=task_status)

            host, port = await group.start(run)
            found.update(url=f"http://{host}:{port}", stop=group.cancel_scope.cancel)
            found["loop"] = anyio.lowlevel.current_token()
            up.set()

    thread = threading.Thread(target=anyio.run, args=(main,))
    thread.start()
    assert up.wait(30)
    try:
        yield found["url"]
    finally:
        anyio.from_thread.run_sync(found["stop"], token=found["loop"])
        thread.join()


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """Eight connected drives, one of them with a long name and faults that are in force."""
    world = ApiWorld(8)
    world.line.connect()
    world.line.enable()
    world.line.run(0.5)
    for kind, params in (("f702", {"hold": True}), ("slow-ramp", {}), ("following-error", {})):
        world.post("/api/v1/faults", {"kind": kind, "on": "axis-03", "params": params})
    world.line.run(0.1)
    with served(world) as url:
        yield world, url


@pytest.fixture(scope="module")
def page(farm, tmp_path_factory):
    _, url = farm
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        browser.open(f"{url}/")
        browser.until("document.querySelectorAll('#drives tr').length === 8 && kinds.size > 0")
        yield browser


def test_the_buttons_of_a_row_are_in_sight_at_1400_pixels(page, tmp_path_factory):
    page.picture(tmp_path_factory.getbasetemp() / "page.png")
    for row in (0, 2, 7):
        for button in (0, 1):
            assert page.ask(SEEN % f"$('drives').rows[{row}].querySelectorAll('button')[{button}]"), (row, button)


def test_a_fault_with_parameters_is_put_in_force_by_the_form(farm, page):
    world, _ = farm
    page.ask(CHOOSE % "drive-fault")
    assert page.ask("[...document.querySelectorAll('#params label')].map(l => l.textContent.trim())[0]") == "fault*"
    page.ask(
        "$('on').value = 'axis-05'; $('param-fault').value = '702'; $('param-hold').value = 'true'; $('add').click()"
    )
    page.until("[...$('faults').rows].some(row => row.cells[1].textContent === 'drive-fault')")
    assert page.ask("$('error').textContent") == ""
    (fault,) = [f for f in world.get("/api/v1/faults").json()["faults"] if f["kind"] == "drive-fault"]
    assert list(fault["drives"]) == ["axis-05"]
    assert fault["spec"]["params"] == {"fault": 702, "hold": True}


def test_a_fault_that_lacks_a_parameter_is_told_with_what_is_allowed(page):
    page.ask(CHOOSE % "drive-fault")
    page.ask("$('add').click()")
    page.until("$('error').textContent.includes('params.fault: is missing')")


def test_every_kind_has_a_field_for_each_of_its_parameters(farm, page):
    world, _ = farm
    for kind in world.get("/api/v1/fault-kinds").json()["kinds"]:
        page.ask(CHOOSE % kind["kind"])
        fields = page.ask("[...document.querySelectorAll('#params [id^=param-]')].map(f => f.id.slice(6))")
        assert fields == list(kind["params"]), kind["kind"]
        for name, spec in kind["params"].items():
            if spec["type"] == "word":
                words = page.ask(f"[...$('param-{name}').options].map(o => o.value).filter(v => v)")
                assert words == spec["words"]


def test_what_is_typed_reaches_the_farm_in_its_type(farm, page):
    world, _ = farm
    page.ask(CHOOSE % "diagnosis")
    page.ask("$('on').value = 'axis-06'; $('param-error').value = 'wire-break'; $('add').click()")
    page.until("[...$('faults').rows].some(row => row.cells[1].textContent === 'diagnosis')")
    (fault,) = [f for f in world.get("/api/v1/faults").json()["faults"] if f["kind"] == "diagnosis"]
    assert fault["spec"]["params"] == {"error": "wire-break"}


def test_one_fault_is_cleared_and_the_others_stay(farm, page):
    world, _ = farm
    before = [fault["id"] for fault in world.get("/api/v1/faults").json()["faults"]]
    page.until(f"$('faults').rows.length === {len(before)}")
    first = page.ask("$('faults').rows[0].cells[0].textContent")
    page.ask("$('faults').rows[0].querySelector('button').click()")
    page.until(f"$('faults').rows.length === {len(before) - 1}")
    assert [fault["id"] for fault in world.get("/api/v1/faults").json()["faults"]] == [i for i in before if i != first]


def test_the_buttons_of_a_row_act_on_its_drive(farm, page):
    world, _ = farm
    page.ask(CHOOSE % "loss")
    page.ask("$('on').value = 'all'; $('drives').rows[6].querySelectorAll('button')[0].click()")
    page.until("[...$('faults').rows].some(row => row.cells[1].textContent === 'loss')")
    (fault,) = [f for f in world.get("/api/v1/faults").json()["faults"] if f["kind"] == "loss"]
    assert list(fault["drives"]) == ["axis-07"]
    page.ask("$('reset').click()")
    page.until("!$('nofaults').hidden && $('faults').rows.length === 0")


def test_a_guarded_farm_asks_a_person_for_its_token(tmp_path):
    world = ApiWorld(1, controller=False, token=TOKEN)
    with served(world) as url, Browser(tmp_path) as browser:
        browser.open(f"{url}/")
        browser.until("document.querySelector('input[name=token]') !== null")
        browser.ask(
            "document.querySelector('input').value = 'another-secret'; document.querySelector('button').click()"
        )
        browser.until("document.body !== null && document.body.textContent.includes('Wrong token.')")
        browser.ask(f"document.querySelector('input').value = '{TOKEN}'; document.querySelector('button').click()")
        browser.until("typeof $ === 'function' && document.querySelectorAll('#drives tr').length === 1")
        assert TOKEN not in browser.ask("location.href")
