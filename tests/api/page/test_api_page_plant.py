"""The view of the plant: its models with their ports live, switches and fields, plots, wires, a model that broke."""

import pytest
from browser import PROGRAM
from page_farm import call, show

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")


def values(farm, model):
    return {one["name"]: one["value"] for one in call(farm, "GET", f"devices/{model}/signals")["signals"]}


@pytest.fixture
def plant(page, farm):
    """The page with the plant at rest; what it refuses is not an error of the page."""
    for model, inputs in (("gripper", {"extend": False}), ("shaft", {"gain": 0})):
        call(farm, "PATCH", f"devices/{model}/signals?as=force", {"*": None})
        call(farm, "PATCH", f"devices/{model}/signals", inputs)
    show(page, "#/plant")
    page.until("all('table.plant').length === 3 && text('main').includes('3 models, 1 wire, a step every 2 ms')")
    page.until("labelled('gripper.position').textContent === '0'")
    yield page
    page.problems[:] = [one for one in page.problems if "412" not in one and "422" not in one]


def row(port):
    return f"labelled('Plot {port}').closest('tr')"


def test_a_switch_moves_a_model_and_its_ports_are_shown_as_they_move(plant, farm):
    assert plant.ask(f"[...{row('gripper.extended')}.cells].map(one => one.textContent)") == [
        "extended", "output", "gripper.extended0", "", "plant", "→ lamp.on", "plot",
    ]  # fmt: skip
    # an input with a wire is no switch
    assert plant.ask(f"{row('lamp.on')}.querySelectorAll('button[role=switch]').length") == 0
    assert "← gripper.extended" in plant.ask(f"{row('lamp.on')}.textContent")
    plant.ask(f"{row('gripper.extend')}.querySelector('button[role=switch]').click()")
    plant.until("labelled('gripper.position').textContent === '1'")
    plant.until(f"{row('lamp.lit')}.querySelectorAll('.bit.on').length === 1")
    assert values(farm, "gripper")["extend"] is True
    assert plant.ask(f"{row('gripper.extend')}.cells[4].textContent") == "value"


def test_a_number_is_typed_forced_and_released(plant, farm):
    plant.until("type('shaft.gain', '2.5')")
    plant.ask("labelled('shaft.gain').form.requestSubmit()")
    plant.until("labelled('shaft.twice').textContent === '5'")
    plant.until("press('button', 'Force shaft.gain')")
    plant.until(f"{row('shaft.gain')}.cells[4].textContent === 'force'")
    call(farm, "PATCH", "devices/shaft/signals", {"gain": 7})
    plant.until("press('button', 'Release shaft.gain')")
    plant.until("Number(labelled('shaft.gain').value) === 7 && labelled('shaft.twice').textContent === '14'")
    plant.until("type('shaft.gain', 'far')")
    plant.ask("labelled('shaft.gain').form.requestSubmit()")
    plant.until("text('[role=alert]').includes('is not a number')")
    plant.ask("labelled('shaft.gain').focus()")
    plant.key("Escape")
    plant.until("all('[role=alert]').length === 0")


def test_a_port_is_plotted_while_it_moves(plant, farm):
    plant.until("press('button', 'Plot gripper.position')")
    plant.until("all('.plot[role=img]').length === 1 && text('.u-legend').includes('position')")
    call(farm, "PATCH", "devices/gripper/signals", {"extend": True})
    plant.until("all('.u-value').at(-1).textContent === '1'")
    plant.ask("press('button', 'Plot gripper.position')")
    plant.until("all('.plot').length === 0")


def test_a_filter_and_closed_models_leave_out_what_is_not_looked_at(plant):
    plant.ask("import('/page/lib/live.js').then(live => { globalThis.farmNow = () => live.farm; })")
    plant.until("farmNow().values.size === 3")
    plant.ask("type('Find a model by its name, kind or ports', 'cylinder')")
    plant.until(
        "all('table.plant').length === 1 && text('main').includes('1 of 3 models') && farmNow().values.size === 1"
    )
    plant.ask("all('details.module summary')[0].click()")
    plant.until("all('table.plant').length === 0 && farmNow().values.size === 0")
    plant.ask("type('Find a model by its name, kind or ports', '')")
    plant.until("all('table.plant').length === 3")
    plant.ask("all('details summary').find(one => one.textContent.startsWith('Wires')).click()")
    assert "gripper.extended -> lamp.on" in plant.ask("labelled('Wires').textContent")


def test_ports_of_a_model_are_traced(plant):
    plant.until("press('a', 'Trace of gripper, with a trigger')")
    plant.until("location.hash === '#/plant/gripper' && all('button', 'Start').length === 1")
    plant.until("press('button', 'Start')")
    plant.until("text('main').includes('complete') && text('.u-legend').includes('position')")


def test_keys_reach_the_plant_and_its_filter(page):
    show(page, "#/health")
    page.ask("document.getElementById('main').focus()")
    page.key("8")
    page.until("location.hash === '#/plant' && all('table.plant').length === 3")
    page.key("/")
    page.until("document.activeElement.type === 'search'")


def test_a_model_that_broke_says_why(plant, farm):
    call(farm, "PATCH", "devices/shaft/signals", {"break_now": True})
    plant.until("text('details.module .bad').includes('stopped') && text('[role=alert]').includes('the shaft broke')")
