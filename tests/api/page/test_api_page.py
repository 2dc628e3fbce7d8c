"""The web page in a real browser, on a farm that runs: what a person sees there is so, and what is clicked happens."""

import importlib.util
import json
import os
import re
from pathlib import Path

import pytest
from api_world import ApiWorld
from browser import PROGRAM, Browser
from page_farm import FARM, TOOLS, call, running, show

from pnfarm.api.page import page_files, policy

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")
TOKEN, READ = "a-long-secret", "another-long-secret"  # a test's, nobody's
VIEWS = {
    "#/": "akd-01",
    "#/drive/akd-01/live": "STW1, control word 1",
    "#/drive/eip-01/live": "Status byte 1",
    "#/drive/akd-01/trace": "Trigger",
    "#/drive/akd-01/parameters": "NSOLL_A",
    "#/drive/akd-01/events": "Fault buffer",
    "#/drive/akd-01/connection": "Deviation from the cycle",
    "#/drive/dp-01/connection": "Station address",
    "#/drive/akd-01/modules": "Subslot",
    "#/device/island": "slot1_input_0",
    "#/device/island/trace": "part_present",
    "#/faults": "sign-of-life-freeze",
    "#/reactions": "Fault until it was acknowledged",
    "#/topology": "LLDP",
    "#/scenarios": "Check and start",
    "#/readiness": "exchange data",
    "#/health": "This machine",
    "#/plant": "gripper.extended",
    "#/plant/gripper": "Trigger",
}


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_what_it_is_for_and_needs_no_sideways_scroll(page, view):
    show(page, view)
    page.until(f"text('main').includes({json.dumps(VIEWS[view])})")
    for width in (1366, 820):
        page.resize(width, 768)
        page.until(f"innerWidth === {width} && document.documentElement.scrollWidth <= {width}", 5)


@pytest.fixture(scope="module")
def axe(window):
    """Deque's accessibility rules; the package has them as one file."""
    spec = importlib.util.find_spec("axe_playwright_python")
    if spec is None or not spec.submodule_search_locations:
        if os.environ.get("PNFARM_REQUIRE_ALL"):
            pytest.fail("axe-playwright-python is not installed")
        pytest.skip("axe-playwright-python is not installed (make test installs it)")
    window.ask((Path(spec.submodule_search_locations[0]) / "axe.min.js").read_text("utf-8") + ";0")


@pytest.mark.usefixtures("axe")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_view_breaks_a_rule_of_accessibility(page, scheme):
    page.scheme(scheme)
    broken = {}
    for view, word in VIEWS.items():
        show(page, view)
        page.until(f"text('main').includes({json.dumps(word)})")
        found = page.ask("""axe.run(document, {resultTypes: ["violations"]}).then(result => result.violations.map(
            one => `${one.id}: ${one.nodes.slice(0, 3).map(node => node.html.slice(0, 160)).join(" | ")}`))""")
        if found:
            broken[view] = found
    assert broken == {}


@pytest.mark.usefixtures("axe")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_is_chosen_can_be_read_also_under_the_pointer(page, scheme):
    page.scheme(scheme)
    unreadable = {}
    for view, word in VIEWS.items():
        show(page, view)
        page.until(f"text('main').includes({json.dumps(word)})")
        if view == "#/faults":
            page.until("press('button.kind', 'delay')")
            page.until("all('button.kind[aria-pressed=true]').length === 1")
        page.ask("hover(true)")
        found = page.ask("""axe.run(document, {runOnly: ["color-contrast"], resultTypes: ["violations"]}).then(result =>
            result.violations.flatMap(one => one.nodes.map(node => node.html.slice(0, 160))))""")
        page.ask("hover(false)")
        if found:
            unreadable[view] = found
    assert unreadable == {}


def test_a_fault_by_click_turns_the_drive_red_and_the_plc_brings_it_back(page):
    show(page, "#/drive/akd-02/live")
    page.until("all('.bar .state', 'S4 operation').length === 1")
    page.ask("press('button', 'f702')")
    page.until("all('.bar .state.fault').length === 1 && text('.bar').includes('702')")
    page.until("all('.bar .state.run').length === 1")
    page.until("text('.toasts').includes('f702 on akd-02')")
    show(page, "#/reactions")
    page.until("rows('akd-02').some(row => row.includes('fault acknowledged'))")
    (row,) = page.ask("rows('akd-02')")
    assert "fault 702" in row
    assert "stw1.fault_acknowledge = 1" in row
    show(page, "#/drive/akd-02/events")
    page.until("text('main table').includes('702 ')")


def test_a_timeout_by_click_ends_the_connection_and_the_controller_comes_back(page, farm):
    show(page, "#/drive/hiwin-01/connection")
    page.until("text('.bar').includes('DATA with plc')")
    page.ask("press('button', 'timeout')")
    page.until("!text('.bar').includes('DATA with plc')")
    page.until("text('.bar').includes('DATA with plc')")
    show(page, "#/reactions")
    page.until("rows('hiwin-01').some(row => row.includes('connection lost'))")
    assert call(farm, "GET", "drives/hiwin-01")["connects"] == 2


def test_a_parameter_is_found_by_its_name_and_written(page, farm):
    show(page, "#/drive/akd-01/parameters")
    page.until("text('main').includes('NSOLL_A')")
    page.until("type('Find a parameter by number, name or unit', 'il.limitp')")
    page.until("all('main tbody tr').length === 1")
    before = call(farm, "GET", "drives/akd-01/params/IL.LIMITP")["value"]
    page.until("press('button.value')")
    page.until("type('new value of IL.LIMITP', 'a lot')")
    page.ask("document.querySelector('.edit').requestSubmit()")
    page.until("text('.toasts').includes('a lot is not a whole number')")
    page.ask(f"type('new value of IL.LIMITP', '{before - 1}'); document.querySelector('.edit').requestSubmit()")
    page.until(f"text('.toasts').includes('IL.LIMITP = {before - 1}')")
    assert call(farm, "GET", "drives/akd-01/params/IL.LIMITP")["value"] == before - 1
    page.until("press('button.value')")
    page.until("type('new value of IL.LIMITP', '99999999999')")
    page.ask("document.querySelector('.edit').requestSubmit()")
    page.until("all('.toast.bad').some(one => one.textContent.includes('limit'))")
    page.problems[:] = [one for one in page.problems if "400" not in one and "422" not in one]


def test_what_is_typed_stays_when_the_drive_s_details_come(page):
    show(page, "#/")
    # as from a busy machine, the drives come a while after the farm
    page.ask("""globalThis.listen = EventSource.prototype.addEventListener;
        EventSource.prototype.addEventListener = function (event, take) {
            return listen.call(this, event, event === 'farm' ? take : message => setTimeout(take, 300, message));
        };""")
    # the field is there before the stream of this drive begins
    typed = page.ask("""new Promise(done => {
        location.hash = '#/drive/msd-01/parameters';
        const look = () => {
            globalThis.field = labelled('Find a parameter by number, name or unit');
            if (field) done(type('Find a parameter by number, name or unit', 'nothing has this name'));
            else requestAnimationFrame(look);
        };
        look();
    })""")
    assert typed
    assert "in operation" not in page.ask("text('.bar')")
    page.ask("EventSource.prototype.addEventListener = listen; 0")
    page.until("text('.bar').includes('in operation')")
    assert page.ask("field.isConnected && field.value") == "nothing has this name"


def test_a_trace_waits_for_its_trigger_and_shows_its_samples(page):
    show(page, "#/drive/akd-03/trace")
    page.until("type('Trigger', 'fault 702')")
    page.until("type('a sample every', '1ms') && type('after it', '300ms') && type('before it', '100ms')")
    page.until("press('button', 'Start')")
    page.until("text('form').includes('waiting')")
    # it waits on while another view is looked at
    show(page, "#/drive/akd-03/parameters")
    show(page, "#/drive/akd-03/trace")
    page.until("text('form').includes('waiting')")
    page.ask("press('button', 'f702')")
    page.until("text('form').includes('complete') && text('form').includes('triggered by akd-03')")
    page.until("all('.plot .uplot').length >= 3 && all('.logic canvas').length === 2")
    assert page.ask("all('a', 'CSV').length") == 1
    samples = int(re.search(r"complete, (\d+) samples", page.ask("text('form')"))[1])
    # the time before the trigger was as long as it took to click
    assert 300 <= samples <= 405
    show(page, "#/drive/akd-03/live")
    show(page, "#/drive/akd-03/trace")
    page.until(f"text('form').includes('complete, {samples} samples') && all('.plot .uplot').length >= 3")
    page.until("all('.bar .state.run').length === 1")


def test_live_words_show_each_bit_of_the_drive_s_own_bus(page):
    show(page, "#/drive/eip-01/live")
    page.until("all('.logic').length === 3 && text('.logic').includes('general_fault')")
    show(page, "#/drive/dp-01/live")
    page.until("all('.logic').length === 2 && text('.logic').includes('enpo_and_no_safe_stop')")
    page.until("all('.plot .uplot').length === 4")


def test_a_zoom_in_one_plot_is_one_in_all_and_ends_by_a_double_click(page):
    show(page, "#/drive/akd-01/live")
    page.until("text('.logic').includes('unfreeze_ramp_generator') && all('.u-over').length === 4")
    seen = "(({left, top, width, height}) => [left, top, width, height])(all('.u-over')[0].getBoundingClientRect())"
    left, top, width, height = page.ask(seen)
    middle = top + height / 2
    page.drag((left + 0.8 * width, middle), (left + 0.9 * width, middle))
    # the picture stands still, and the bits are of the same time as the plots
    page.until("all('button', 'Continue').length === 1")
    page.until("all('[role=img][aria-label^=\"bits of\"]').length === 2")
    page.ask("all('.u-over')[0].dispatchEvent(new MouseEvent('dblclick', {bubbles: true}))")
    page.until("press('button', 'Continue')")
    page.until("all('button', 'Pause').length === 1")


def test_a_connection_shows_its_identifications_and_what_is_where_in_its_frames(page, farm):
    show(page, "#/drive/akd-01/connection")
    page.until("text('main').includes('0x8000') && text('main').includes('AR UUID')")
    page.until("all('[aria-label=\"Cyclic frames\"] tbody tr').length === 2")
    (agreed,) = call(farm, "GET", "drives/akd-01")["details"]["connections"]
    assert agreed["ar_uuid"] in page.ask("text('main')")
    show(page, "#/drive/eip-01/connection")
    page.until("text('main').includes('run/idle header') && text('main').includes('assembly 101')")


def test_power_is_switched_off_and_on(page):
    show(page, "#/drive/msd-01/live")
    page.until("press('button', 'Power off')")
    page.until("all('.bar .state', 'off').length === 1")
    page.until("press('button', 'Power on')")
    page.until("all('.bar .state', 'S4 operation').length === 1")


def test_a_module_is_pulled_and_plugged(page, farm):
    show(page, "#/drive/akd-03/modules")
    page.until("press('button', 'Pull the module in slot 1')")
    page.until("text('main').includes('empty')")
    assert call(farm, "GET", "drives/akd-03/modules")["modules"][1]["module_ident"] is None
    page.until("press('button', 'Plug the module of slot 1')")
    page.until(
        "all('button', 'Pull the module in slot 1').length === 1 && all('.bar .state', 'S4 operation').length === 1"
    )


def test_drives_are_filtered_selected_and_hit_together(page, farm):
    show(page, "#/")
    page.until("type('Filter by name, address or controller', 'akd')")
    page.until("all('table.drives tbody th').length === 3")
    page.ask("press('input', 'select akd-01')")
    page.until("press('button', 'Select all 3 shown')")
    page.until("text('.bar').includes('3 drives selected')")
    page.ask("press('button', 'cable 2 s')")
    page.until("text('.toasts').includes('on 3 drives')")
    (fault,) = call(farm, "GET", "faults")["faults"]
    assert sorted(fault["drives"]) == ["akd-01", "akd-02", "akd-03"]
    page.until("press('button', 'Select none')")
    page.ask("type('Filter by name, address or controller', '')")
    page.until("press('button', 'Tiles') && all('.tile').length === 7")
    page.until("press('button', 'Rows') && all('table.drives').length === 1")


def test_columns_sort_the_drives(page):
    show(page, "#/")
    page.until("press('button.sort', 'Drive')")
    page.until("all('table.drives tbody th')[6].textContent === 'msd-01'")
    page.ask("press('button.sort', 'Drive ▲')")
    page.until("all('table.drives tbody th')[0].textContent === 'msd-01'")
    page.ask("press('button.sort', 'State')")


def test_the_readiness_follows_what_a_drive_refuses_and_the_way_back(page, farm):
    show(page, "#/readiness")
    page.until("text('main').includes('Every station exchanges data, and nothing is refused.')")
    call(farm, "POST", "faults", {"kind": "connect-refuse", "on": "akd-02"})
    call(farm, "POST", "faults", {"kind": "ar-abort", "on": "akd-02"})
    page.until("all('main tr', undefined).some(row => /^akd-02.*refused.*Connect refused/.test(row.textContent))")
    assert "Every station" not in page.ask("text('main')")
    page.ask("press('main input[type=checkbox]')")
    page.until("all('main tbody tr').length === 1")
    call(farm, "POST", "reset")
    page.until("text('main').includes('Every station exchanges data, and nothing is refused.')")
    page.until("all('main tbody tr').length === 0")
    page.ask("press('main input[type=checkbox]')")


def test_keys_lead_to_the_views_and_to_the_filter(page):
    show(page, "#/health")
    page.ask("document.body.focus()")
    page.key("4")
    page.until("location.hash === '#/topology'")
    page.key("1")
    page.until("location.hash === '#/' && document.querySelector('input[type=search]') !== null")
    page.key("/")
    page.until("document.activeElement.type === 'search'")
    page.ask("document.activeElement.blur()")


# -- devices


def test_a_cable_is_pulled_and_plugged_in_the_topology(page, farm):
    show(page, "#/topology")
    page.until("press('button', 'Pull the cable of akd-01')")
    page.until("all('button', 'Plug the cable of akd-01').length === 1")
    assert [fault["kind"] for fault in call(farm, "GET", "faults")["faults"]] == ["link-down"]
    page.until("all('.net').some(one => one.textContent.startsWith('no controller'))")
    assert "connected" in page.ask("all('.ports li').find(one => one.textContent.includes('island')).textContent")
    page.ask("press('button', 'Plug the cable of akd-01')")
    page.until("all('button', 'Pull the cable of akd-01').length === 1 && all('.controller.none').length === 0")


def test_a_scenario_is_started_and_its_verdict_is_shown(page):
    show(page, "#/scenarios")
    page.until("""type("The scenario's text", 'scenario: x\\nsteps:\\n  - fault: {kind: f702, on: akd-77}\\n')""")
    page.until("press('button', 'Check and start')")
    page.until("text('main [role=alert]').includes('akd-77')")
    page.problems.clear()
    page.until("""type("The scenario's text", '')""")
    page.until("press('button', 'Check and start')")
    page.until("text('.panel').includes('3 passed')")
    assert page.ask("all('.panel tbody tr').length") == 3
    page.until("all('.panel summary').length === 1")
    report = page.ask("fetch(all('.panel a', 'Open the report')[0].href).then(answer => answer.text())")
    assert "<title>" in report
    assert "f702-recovery" in report


def choose(page, kind):
    page.until(f"press('button.kind', '{kind}')")
    page.until(f"text('form.panel h3') === '{kind}'")


def test_every_kind_of_fault_has_a_field_for_each_of_its_parameters(page, farm):
    show(page, "#/faults")
    for kind in call(farm, "GET", "fault-kinds")["kinds"]:
        choose(page, kind["kind"])
        fields = page.ask(
            "[...document.querySelectorAll('form.panel [id^=param-]:not([id$=-hint])')].map(one => one.id.slice(6))"
        )
        assert fields == list(kind["params"]), kind["kind"]
        for name, spec in kind["params"].items():
            if spec["type"] == "word":
                words = page.ask(
                    f"[...document.getElementById('param-{name}').options].map(one => one.value).filter(one => one)"
                )
                assert words == spec["words"]


def test_what_is_typed_reaches_the_farm_in_its_type(page, farm):
    show(page, "#/faults")
    choose(page, "drive-fault")
    page.ask("type('on', 'akd-02')")
    page.until("text('form.panel').includes('params.fault: is missing')")
    page.problems.clear()
    page.ask("type('fault', '702')")
    page.until(
        "press('button', 'Inject drive-fault')" if False else "text('form.panel').includes('Would hit 1 drive: akd-02')"
    )
    page.ask("type('hold', 'yes')")
    page.until("press('button', 'Inject drive-fault')")
    page.until("all('main table tbody tr').some(row => row.cells[1].textContent === 'drive-fault')")
    (fault,) = call(farm, "GET", "faults")["faults"]
    assert fault["spec"]["params"] == {"fault": 702, "hold": True}
    assert list(fault["drives"]) == ["akd-02"]
    page.until(f"press('button', 'Clear {fault['id']}')")
    page.until("text('main').includes('No fault is pending or active.')")


def test_health_of_a_farm_in_memory_says_that_no_lateness_is_measured(page):
    show(page, "#/health")
    page.until("text('main').includes('Not measured on a memory link')")
    assert page.ask("all('table.histogram').length") == 0


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("#/drives/akd-01", "There is no page #/drives/akd-01"),
        ("#/drive/nobody", "There is no drive nobody"),
        ("#/drive/akd-01/nothing", "There is no page"),
        ("#/device/nobody", "There is no device nobody"),
        ("#/device/island/nothing", "There is no page"),
        ("#/nowhere?x=1", "There is no page #/nowhere"),
    ],
)
def test_an_address_that_leads_nowhere_says_so_and_leads_to_the_overview(page, address, words):
    page.ask(f"location.hash = '{address}'")
    page.until(f"text('main h2').includes({json.dumps(words)})")
    page.ask("press('main a', 'Overview')")
    page.until("document.querySelectorAll('table.drives tbody th').length === 7")


def test_an_address_with_the_word_of_the_api_leads_to_the_drive(page):
    page.ask("location.hash = '#/drives/akd-02'")
    page.until("press('main a', 'The drive akd-02')")
    page.until("text('main h2') === 'akd-02'")
    for address in ("#/devices/island", "#/drive/island"):
        page.ask(f"location.hash = '{address}'")
        page.until("press('main a', 'The device island')")
        page.until("text('main h2').startsWith('island ')")


def test_a_reason_why_drives_cannot_have_a_fault_is_shown_once(page):
    show(page, "#/faults")
    page.until("press('button.kind', 'baud-change')")
    page.until("type('on', 'all')")
    page.until("text('[role=status]').includes('Would hit 1 drive: dp-01')")
    reasons = page.ask("text('.send .bad')")
    assert reasons.startswith("8 stations (akd-01, akd-02, akd-03 …): ")
    assert reasons.count("baud-change") <= 1


def test_the_plots_of_a_drive_begin_with_the_last_seconds(page):
    show(page, "#/")
    page.ask("import('/page/lib/live.js').then(live => { globalThis.farmNow = () => live.farm; })")
    # the page follows all drives while it shows any view
    begun = page.ask("farmNow().seconds")
    page.until(f"farmNow().seconds > {begun} + 2.5")
    show(page, "#/drive/msd-01/live")
    page.until("farmNow().signals !== null && farmNow().signals.seconds.length > 0")
    first = page.ask(
        "(({seconds, values}) => [seconds.at(-1) - seconds[0], values.velocity[0], values.zsw1[0]])(farmNow().signals)"
    )
    assert first[0] > 2.0
    assert first[1] is not None
    # what the overview has not begins with the drive's own samples
    assert first[2] is None
    page.until("all('.plot canvas').length > 1")


def test_health_shows_the_machine(page):
    show(page, "#/health")
    page.until("all('main table tbody th').some(one => one.textContent === 'kernel')")


def test_a_guarded_farm_asks_a_person_for_its_token_and_a_reader_changes_nothing(tmp_path):
    section = f"{{listen: '127.0.0.1:0', token: {TOKEN}, read_token: {READ}}}"
    guarded = FARM.replace("127.0.0.1:0", section)
    with running(tmp_path, guarded) as url, Browser(tmp_path / "browser") as browser:
        browser.open(f"{url}/")
        browser.until("document.querySelector('input[name=token]') !== null")
        browser.ask(
            "document.querySelector('input').value = 'a-wrong-secret'; document.querySelector('button').click()"
        )
        browser.until("document.body !== null && document.body.textContent.includes('Wrong token.')")
        browser.ask(f"document.querySelector('input').value = '{READ}'; document.querySelector('button').click()")
        browser.until("document.querySelectorAll('table.drives tbody th').length === 7")
        assert READ not in browser.ask("location.href")
        browser.ask(TOOLS)
        browser.until("text('header').includes('read only')")
        browser.ask("location.hash = '#/drive/akd-01/live'")
        browser.until("all('button', 'f702').length === 1")
        assert browser.ask("all('button', 'f702')[0].disabled")
        browser.ask("location.hash = '#/device/island'")
        browser.until("all('button[role=switch]').length > 0 && all('table.values input').length > 0")
        assert browser.ask("all('button[role=switch]').every(one => one.disabled)")
        assert browser.ask("all('table.values input').every(one => one.readOnly)")
        assert browser.ask("all('.force').length") == 0


def test_the_page_loads_its_own_files_only():
    world = ApiWorld(1, controller=False)
    answer = world.get("/")
    assert answer.headers["content-security-policy"] == policy()
    assert "unsafe" not in policy()
    text = answer.text
    assert not re.search(r"(src|href)=\"(?!/page/|data:)", text)
    for path in re.findall(r"/page/([^\"]+)", text):
        assert path in page_files()
    for path, file in page_files().items():
        if path.endswith(".js") and not path.startswith("vendor/"):
            for module in re.findall(r'from "(\.[^"]+)"', file.content.decode()):
                assert os.path.normpath(f"{Path(path).parent}/{module}") in page_files(), (path, module)


def test_a_browser_that_has_a_file_gets_it_once():
    world = ApiWorld(1, controller=False)
    first = world.get("/page/style.css")
    assert first.status_code == 200
    again = world.get("/page/style.css", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert world.get("/page/vendor/nothing.js").status_code == 404
    assert world.get("/page/../app.py").status_code == 404
    assert world.get("/page/vendor/LICENSE.htm").status_code == 404
