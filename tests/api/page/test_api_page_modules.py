"""The page's modules on a farm that the test plays: what a person is shown when answers come late, twice or never."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

import pnfarm

NODE = shutil.which("node")
PAGE = Path(pnfarm.__file__).parent / "api" / "static"
HARNESS = Path(__file__).parents[2] / "support" / "page_in_node.mjs"

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed (apt-get install nodejs)")


def played(script):
    """What the script returns; it runs in Node with the names of the harness."""
    run = subprocess.run([NODE, HARNESS, PAGE, script], capture_output=True, text=True, check=False, timeout=60)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout.splitlines()[-1])


def test_time_in_a_drive_s_plots_does_not_go_back_when_the_stream_begins_anew():
    seconds = played("""
        const live = await import(page + "lib/live.js");
        live.look({drive: "axis-01"});
        const samples = (from, to) => {
            const seconds = [];
            for (let i = from; i <= to; i++) seconds.push(i / 100);
            return {id: "trace-1", seconds, signals: {velocity: seconds}};
        };
        const stream = () => { say("farm", FARM); say("overview", {seconds: 100, rows: {0: row("axis-01")}}); };
        stream();
        say("signals", samples(0, 500));
        say("signals", samples(501, 520));
        say("signals", {id: "trace-1", seconds: [], signals: {velocity: []}});
        // the browser has connected again: the last ten seconds come, and then what is new
        stream();
        say("signals", samples(0, 600));
        say("signals", samples(601, 610));
        const before = live.farm.signals.seconds;
        // the farm was started again
        stream();
        say("signals", samples(0, 3));
        return [before, live.farm.signals.seconds];
    """)
    assert seconds == [[i / 100 for i in range(611)], [i / 100 for i in range(4)]]


def test_a_stream_that_begins_anew_asks_for_the_entries_of_the_log_behind_the_last_message():
    told = played("""
        const live = await import(page + "lib/live.js");
        const {Health} = await import(page + "views/health.js");
        const entry = sequence => ({sequence, time: sequence, farm_seconds: 0, drive: "", event: `event-${sequence}`});
        const after = () => new URLSearchParams(streams[streams.length - 1].where.split("?")[1]).get("after");
        live.look({});
        const places = [after()];
        say("farm", FARM, "aabbccdd-39");
        const root = await shown(Health);
        say("log", {entries: [40, 41].map(entry)}, "aabbccdd-41");
        live.look({drive: "axis-01"});
        places.push(after());
        say("farm", FARM, "aabbccdd-41");
        say("log", {entries: [42, 43].map(entry)}, "aabbccdd-43");
        // of a farm that was started again there were more than it keeps
        say("log", {entries: [5, 6].map(entry), lost: 4}, "00000001-6");
        live.look({});
        places.push(after());
        await until(() => root.textContent.includes("4 were missed"));
        return [places, live.farm.log.map(one => one.sequence)];
    """)
    assert told == [[None, "aabbccdd-41", "00000001-6"], [40, 41, 42, 43, 5, 6]]


TRACE = """
    const live = await import(page + "lib/live.js");
    const {Trace} = await import(page + "views/trace.js");
    live.look({});
    say("farm", {...FARM, writes: WRITES});
    say("overview", {seconds: 1, rows: {0: row("axis-01")}});
    answers["GET traces/signals/axis-01"] = {signals: [{signal: "velocity"}, {signal: "setpoint"}]};
    const status = {id: "t1", state: "waiting", samples: 0, triggered_by: "", missed: 0};
    answers["POST traces"] = status;
    answers["GET traces/t1"] = status;
    const root = await shown(Trace, {name: "axis-01"});
    await until(() => root.all("form").length);
    const button = text => root.all("button").find(one => one.textContent === text);
"""


def test_a_trace_that_runs_is_followed_again_when_the_farm_answers_again():
    assert played(
        TRACE.replace("WRITES", "true")
        + """
        root.all("form")[0].listeners.submit.call(root.all("form")[0], {type: "submit", preventDefault() {}});
        await until(() => root.textContent.includes("t1: waiting"));
        let failed = 0;
        answers["GET traces/t1"] = () => { failed += 1; throw new TypeError("Failed to fetch"); };
        await until(() => failed > 0);
        answers["GET traces/t1"] = {...status, samples: 7};
        await until(() => root.textContent.includes("t1: waiting, 7 samples"));
        // only the farm knows that it has ended
        delete answers["GET traces/t1"];
        await until(() => !root.textContent.includes("t1: waiting"));
        return true;
        """
    )


@pytest.mark.parametrize("writes", [True, False])
def test_who_may_only_read_can_start_no_trace(writes):
    off = "const start = button('Start'); return Boolean(start.attributes.disabled ?? start.disabled);"
    found = played(TRACE.replace("WRITES", str(writes).lower()) + off)
    assert found is not writes


def test_a_bit_that_is_not_known_at_the_cursor_is_not_shown_as_0():
    assert played("""
        const {LogicRows} = await import(page + "lib/charts.js");
        const bits = [{bit: 0, name: "on"}, {bit: 1, name: "ready"}], found = [];
        for (const at of [0, 1, null]) {
            const word = {times: [0, 1, 2], values: [null, 1, 3], bits, range: [0, 2], label: "STW1", at};
            const root = await shown(LogicRows, word);
            found.push(root.all("strong").map(one => one.textContent));
        }
        return found;
    """) == [["–", "–"], ["1", "0"], ["1", "1"]]


def test_the_topology_of_a_hub_shows_the_line_of_each_drive_s_shard():
    text = played("""
        const live = await import(page + "lib/live.js");
        const {Topology} = await import(page + "views/topology.js");
        live.look({});
        const line = where => ({way: "tcp", where});
        const lines = {}, rows = {};
        for (const i of [1, 2, 3]) lines[`profibus shard ${i}`] = line(`10.0.0.${i}:400${i}`);
        for (const i of [1, 2]) rows[i - 1] = row(`dp-${i}`, {bus: "profibus", shard: `shard ${i}`});
        say("farm", {...FARM, drives: 2, link: "macvlan", lines});
        say("overview", {seconds: 1, rows});
        const root = await shown(Topology);
        return root.textContent;
    """)
    assert "profibus, tcp 10.0.0.1:4001" in text
    assert "profibus, tcp 10.0.0.2:4002" in text
    assert "4003" not in text
    assert "macvlan" not in text


def test_the_preview_of_a_fault_is_of_what_is_typed_last():
    assert played("""
        const live = await import(page + "lib/live.js");
        const {Faults} = await import(page + "views/faults.js");
        live.look({});
        say("farm", FARM);
        const more = {family: "link", doc: "", params: {}, takes: [], directions: [], wire: "", reports: "", buses: {}};
        answers["GET fault-kinds"] = {kinds: [{kind: "silence", ...more}]};
        answers["GET faults"] = {faults: []};
        let first = null;
        answers["POST faults"] = ({on}) => {
            const reach = {drives: on, cannot: [], left_out: []};
            // the answer about axis-01 comes last
            return on[0] === "axis-01" ? new Promise(done => { first = () => done(reach); }) : reach;
        };
        const root = await shown(Faults, {on: "axis-01", kind: "silence"});
        await until(() => first);
        const field = root.all("input").find(one => (one.attributes.id ?? one.id) === "on");
        field.listeners.input.call(field, {type: "input", target: {value: "axis-02"}});
        await until(() => root.textContent.includes("1 drive: axis-02"));
        first();
        await new Promise(done => setTimeout(done, 50));
        return root.textContent.includes("1 drive: axis-02");
    """)


def test_a_run_that_the_farm_no_longer_knows_is_not_shown_as_if_it_went_on():
    text = played("""
        const {Scenarios} = await import(page + "views/scenarios.js");
        const steps = {steps: 2, steps_begun: 1, step: "wait", left_seconds: 9, ended_early: ""};
        const found = {verdict: null, seconds: 1, counts: {}, cases: [], timeline: []};
        const run = {id: "s1", scenario: "long", state: "running", ...found, ...steps};
        answers["GET scenarios"] = {scenarios: [run]};
        answers["GET scenarios/s1"] = run;
        const root = await shown(Scenarios, {id: "s1"});
        await until(() => root.textContent.includes("Step 1 of 2"));
        delete answers["GET scenarios/s1"];
        const before = asked.length;
        await until(() => asked.slice(before).filter(one => one === "GET scenarios/s1").length > 0);
        await new Promise(done => setTimeout(done, 50));
        return root.textContent;
    """)
    assert "there is no GET scenarios/s1" in text


def test_drives_behind_one_that_refuses_are_power_cycled_as_well():
    cycled, told = played("""
        const live = await import(page + "lib/live.js");
        const {Overview} = await import(page + "views/overview.js");
        const {Toasts} = await import(page + "lib/ui.js");
        live.look({});
        const names = ["axis-01", "axis-02", "axis-03"];
        say("farm", {...FARM, drives: 3});
        say("overview", {seconds: 1, rows: Object.fromEntries(names.map((name, i) => [i, row(name)]))});
        for (const name of names) answers[`POST drives/${name}/power-cycle`] = {};
        delete answers["POST drives/axis-01/power-cycle"];
        const root = await shown(Overview), toasts = await shown(Toasts);
        const all = root.all("input").find(one => (one.attributes["aria-label"]) === "select all shown");
        all.listeners.change.call(all, {type: "change", target: {checked: true}});
        const button = () => root.all("button").find(one => one.textContent === "Power-cycle");
        await until(button);
        await new Promise(done => setTimeout(done, 30));
        button().listeners.click.call(button(), {type: "click"});
        await until(() => toasts.textContent);
        return [asked.filter(one => one.endsWith("power-cycle")).length, toasts.textContent];
    """)
    assert cycled == 3
    assert "axis-01" in told


def test_devices_whose_shard_was_away_at_first_are_shown_when_it_comes():
    assert played("""
        answers["GET devices"] = {devices: [], unreachable: [{shard: "shard 1", reason: "no answer"}]};
        const usual = setTimeout;
        globalThis.setTimeout = (done, after, ...more) => usual(done, Math.min(after, 50), ...more);
        await import(page + "main.js");
        await until(() => streams.length);
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-01")}});
        await until(() => asked.filter(one => one === "GET devices").length > 1);
        await new Promise(done => usual(done, 100));
        const connection = {state: "DATA", controller: null, cycle_seconds: 0.004};
        const island = {name: "island", station_name: "island", description: "", ip: "10.0.0.2/24"};
        answers["GET devices"] = {
            devices: [{...island, connection, powered: true, connected: true, injected: [], inputs: 1, outputs: 1}],
        };
        await until(() => app.textContent.includes("island"));
        return true;
    """)


def test_a_minute_past_midnight_is_no_24th_hour():
    assert played("""
        const {clock} = await import(page + "lib/words.js");
        return [0, 13].map(hour => clock(new Date(2026, 0, 1, hour, 5, 6).getTime() / 1000));
    """) == ["00:05:06", "13:05:06"]


def test_a_drive_that_gets_the_place_of_another_one_has_none_of_its_values_and_is_there_once():
    assert played("""
        const live = await import(page + "lib/live.js");
        live.look({});
        const two = {...FARM, drives: 2}, values = {velocity: [[0, 1], [1000, 2000]]};
        say("farm", two);
        say("overview", {seconds: 1, rows: {0: row("axis-01"), 1: row("axis-02")}, values});
        // at a hub: one has gone, and of the one that has come nothing is known yet
        say("farm", two);
        say("overview", {seconds: 2, rows: {0: row("axis-02")}, values: {velocity: [[0], [2000]]}});
        const known = live.farm.drives.filter(one => one.known);
        return known.map(one => [one.name, [...one.history].filter(one => !Number.isNaN(one))]);
    """) == [["axis-02", [200]]]


def test_values_that_come_before_a_drive_s_row_are_the_drive_s():
    # of many drives the rows come by and by
    assert played("""
        const live = await import(page + "lib/live.js");
        live.look({});
        const states = () => live.farm.drives.filter(one => one.known).map(one => [one.name, one.state]);
        say("farm", {...FARM, drives: 2});
        say("overview", {seconds: 1, rows: {0: row("axis-01")}, values: {state: [null, [4, 2]]}});
        const first = states();
        say("overview", {seconds: 2, rows: {1: row("axis-02")}});
        const then = states();
        // started again, in the other order
        say("farm", {...FARM, drives: 2});
        say("overview", {seconds: 1, rows: {0: row("axis-02")}, values: {state: [null, [1, 3]]}});
        const again = states();
        say("overview", {seconds: 2, rows: {1: row("axis-01")}});
        return [first, then, again, states()];
    """) == [
        [["axis-01", 4]],
        [["axis-01", 4], ["axis-02", 2]],
        [["axis-02", 1]],
        [["axis-02", 1], ["axis-01", 3]],
    ]


RESTARTED = """
    const usual = setTimeout, wait = seconds => new Promise(done => usual(done, seconds * 1000));
    globalThis.setTimeout = (done, after, ...more) => usual(done, Math.min(after, 60), ...more);
    location.hash = "#/drive/axis-01/events";
    answers["GET devices"] = {devices: []};
    await import(page + "main.js");
    await until(() => streams.length);
    say("farm", FARM);
    say("overview", {seconds: 1, rows: {0: row("axis-01")}});
    await until(() => streams.length > 1);
    const refuse = () => {
        const one = streams[streams.length - 1];
        one.readyState = EventSource.CLOSED;
        one.onerror();
    };
    const asksFor = () => streams[streams.length - 1].where.split("?")[1];
    const asksAtFirst = asksFor();
    // as of a farm that was started again
    refuse();
"""


def test_a_farm_that_has_the_drive_no_longer_that_is_looked_at_is_shown_all_the_same():
    assert played(
        RESTARTED
        + """
        const bare = asksFor();
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-02")}});
        await until(() => app.textContent.includes("There is no drive axis-01"));
        say("farm", FARM);
        await wait(0.3);
        return [asksAtFirst, bare, asksFor(), app.textContent.includes("live")];
        """
    ) == ["drive=axis-01", "", "", True]


def test_a_drive_whose_stream_was_refused_once_is_asked_for_again():
    assert played(
        RESTARTED
        + """
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-01")}});
        await until(() => asksFor() === "drive=axis-01");
        return true;
        """
    )


def test_the_page_says_why_its_stream_is_refused():
    assert played("""
        const live = await import(page + "lib/live.js");
        answers["GET live"] = undefined;
        live.look({});
        streams[0].readyState = EventSource.CLOSED;
        streams[0].onerror();
        await until(() => live.farm.error.includes("there is no GET live"));
        return true;
    """)


def test_a_device_whose_shard_is_away_has_no_connection_and_one_that_moved_is_where_it_is():
    assert played("""
        const live = await import(page + "lib/live.js");
        const connection = {state: "DATA", controller: {name: "plc", ip: "", mac: ""}, cycle_seconds: 0.004};
        const device = (name, shard) => ({name, shard, connected: true, connection});
        answers["GET devices"] = {devices: [device("one", "a"), device("other", "a")]};
        await live.loadDevices();
        const unreachable = [{shard: "a", reason: "no answer"}];
        answers["GET devices"] = {devices: [device("one", "b")], unreachable};
        await live.loadDevices();
        const who = ({connection: {controller}}) => controller && controller.name;
        return live.farm.devices.map(one => [one.name, one.shard, one.connection.state, who(one)]);
    """) == [["one", "b", "DATA", "plc"], ["other", "a", "NO_AR", None]]


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ({"unreachable": []}, "good: done"),
        ({"unreachable": [{"shard": "s2:8702", "reason": "x"}]}, "bad: done; not at s2:8702, which does not answer"),
        ({"unreachable": ["axis-02", "axis-03"]}, "bad: done; not at axis-02, axis-03, which do not answer"),
        ({"not_hit": [{"drive": "axis-02"}], "unreachable": []}, "bad: done; not at axis-02, which does not answer"),
    ],
)
def test_what_a_hub_could_not_do_at_all_shards_is_not_told_as_done(answer, told):
    assert told == played(
        "const answer = "
        + json.dumps(answer)
        + """;
        const {act, Toasts} = await import(page + "lib/ui.js");
        await act(() => answer, "done");
        const kind = one => (one.attributes.class ?? one.className).split(" ")[1];
        const toast = (await shown(Toasts)).all("div").find(kind);
        return `${kind(toast)}: ${toast.textContent}`;
        """
    )


@pytest.mark.parametrize(
    ("view", "path", "answer", "word"),
    [
        ("faults.js:Faults", "fault-kinds", {"kinds": []}, "Choose a kind of fault"),
        ("trace.js:Trace", "traces/signals/axis-01", {"signals": [{"signal": "velocity"}]}, "velocity"),
        (
            "health.js:Health",
            "doctor",
            {"findings": [{"name": "clock", "ok": True, "detail": "", "remedy": ""}]},
            "clock",
        ),
    ],
)
def test_what_could_not_be_read_while_the_farm_was_away_is_read_when_it_is_back(view, path, answer, word):
    module, component = view.split(":")
    engine = dict.fromkeys(("cycles", "overruns", "frames_sent", "frames_received", "send_errors", "events_lost"), 0)
    health = {"engine": engine, "lateness": [], "lateness_measured": False, "last_seconds": 10}
    assert played(f"""
        const live = await import(page + "lib/live.js");
        const view = (await import(page + "views/{module}"))["{component}"];
        answers["GET health"] = {json.dumps(health)};
        answers["GET faults"] = {{faults: []}};
        live.look({{}});
        answers["GET {path}"] = () => {{ throw new TypeError("Failed to fetch"); }};
        const root = await shown(view, {{name: "axis-01", on: "", kind: ""}});
        await until(() => root.textContent.includes("does not answer"));
        answers["GET {path}"] = {json.dumps(answer)};
        say("farm", FARM);
        say("overview", {{seconds: 1, rows: {{0: row("axis-01")}}}});
        await until(() => root.textContent.includes("{word}"));
        return true;
    """)


def test_a_fault_buffer_that_can_no_longer_be_read_is_not_shown_as_if_it_were_new():
    assert played("""
        const live = await import(page + "lib/live.js");
        const usual = setTimeout;
        globalThis.setTimeout = (done, after, ...more) => usual(done, Math.min(after, 50), ...more);
        const {Drive} = await import(page + "views/drive.js");
        live.look({});
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-01")}});
        answers["GET drives/axis-01"] = {fault_counts: {}, fault_memory: [], faults: [], events: []};
        const root = await shown(Drive, {name: "axis-01", tab: "events"});
        await until(() => root.textContent.includes("The fault buffer is empty"));
        answers["GET drives/axis-01"] = () => { throw new TypeError("Failed to fetch"); };
        await until(() => root.textContent.includes("the farm does not answer"));
        return true;
    """)


def test_the_filter_has_the_models_of_a_farm_that_was_started_again_with_others():
    assert played("""
        const live = await import(page + "lib/live.js");
        const {Overview} = await import(page + "views/overview.js");
        live.look({});
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-01")}});
        const root = await shown(Overview);
        const models = () => root.all("option").map(one => one.textContent);
        await until(() => models().includes("akd-profinet"));
        say("farm", FARM);
        say("overview", {seconds: 1, rows: {0: row("axis-01", {model: "hiwin-e1"})}});
        await until(() => models().includes("hiwin-e1"));
        return true;
    """)


def test_drives_that_are_no_longer_there_are_not_selected_and_get_no_fault():
    told, bodies = played("""
        const live = await import(page + "lib/live.js");
        const {Overview} = await import(page + "views/overview.js");
        const bodies = [];
        answers["POST faults"] = body => { bodies.push(body.on); return {id: "f", kind: "f702", drives: {}}; };
        live.look({});
        const two = {...FARM, drives: 2};
        say("farm", two);
        say("overview", {seconds: 1, rows: {0: row("axis-01"), 1: row("axis-02")}});
        const root = await shown(Overview);
        const all = root.all("input").find(one => one.attributes["aria-label"] === "select all shown");
        all.listeners.change.call(all, {type: "change", target: {checked: true}});
        await until(() => root.textContent.includes("2 drives selected"));
        say("farm", two);
        say("overview", {seconds: 1, rows: {0: row("axis-01"), 1: row("axis-03")}});
        await until(() => root.textContent.includes("axis-03"));
        const text = /. drives? selected/.exec(root.textContent)[0];
        const button = root.all("button").find(one => one.textContent === "f702");
        button.listeners.click.call(button, {type: "click"});
        await until(() => bodies.length);
        return [text, bodies];
    """)
    assert told == "1 drive selected"
    assert bodies == [["axis-01"]]


def test_a_scenario_s_file_that_was_changed_can_be_chosen_again():
    assert played("""
        const {Scenarios} = await import(page + "views/scenarios.js");
        answers["GET scenarios"] = {scenarios: []};
        const root = await shown(Scenarios, {id: ""});
        const field = root.all("input").find(one => (one.attributes.type ?? one.type) === "file");
        const text = () => root.all("textarea")[0].value ?? root.all("textarea")[0].attributes.value;
        const found = [];
        for (const written of ["first", "second"]) {
            // a browser reports a choice only if the field's value changes
            const target = {value: "C:\\\\fakepath\\\\s.yml", files: [{text: async () => written}]};
            field.listeners.change.call(field, {type: "change", target});
            await until(() => text() === written);
            found.push(target.value);
        }
        return found;
    """) == ["", ""]
