"""The farm's metrics: complete from the start, true, monotonic, in the format that Prometheus reads."""

import contextlib
import subprocess

import pytest
import virtual_line
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.parser import text_string_to_metric_families
from rig_dashboards import needs_promtool
from shared_line import SharedLine
from virtual_line import VirtualLine

from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.metrics import FarmCollector
from pnfarm.metrics.families import Family, Histogram, Room
from pnfarm.table.channel import FRUN

#: interface.md, "Metrics", without the sign of life, which no drive here has.
PROMISED = {
    "pnfarm_build_info": {"version"},
    "pnfarm_shard_info": {"farm", "shard", "shards"},
    "pnfarm_memory_up": set(),
    "pnfarm_memory_losses_total": set(),
    "pnfarm_memory_saves_refused_total": set(),
    "pnfarm_lease_held": set(),
    "pnfarm_lease_renewed_seconds_ago": set(),
    "pnfarm_drive_info": {"drive", "model", "bus"},
    "pnfarm_axis_velocity_rpm": {"drive"},
    "pnfarm_axis_position_revolutions": {"drive"},
    "pnfarm_axis_current_amperes": {"drive"},
    "pnfarm_axis_following_error_revolutions": {"drive"},
    "pnfarm_axis_torque_newton_metres": {"drive"},
    "pnfarm_axis_bus_volts": {"drive"},
    "pnfarm_axis_thermal_load_ratio": {"drive"},
    "pnfarm_axis_setpoint_rpm": {"drive"},
    "pnfarm_axis_stw1": {"drive"},
    "pnfarm_axis_zsw1": {"drive"},
    "pnfarm_axis_state": {"drive"},
    "pnfarm_axis_fault_active": {"drive"},
    "pnfarm_axis_faults_total": {"drive", "code"},
    "pnfarm_ar_state": {"drive"},
    "pnfarm_ar_exchanging": {"drive"},
    "pnfarm_ar_cycle_seconds": {"drive"},
    "pnfarm_ar_connects_total": {"drive"},
    "pnfarm_ar_aborts_total": {"drive", "reason", "cause"},
    "pnfarm_frames_received_total": {"drive"},
    "pnfarm_frames_sent_total": {"drive"},
    "pnfarm_frames_discarded_total": {"drive", "reason"},
    "pnfarm_watchdog_expirations_total": {"drive", "cause"},
    "pnfarm_controller_frame_interval_seconds_bucket": {"drive", "le"},
    "pnfarm_controller_jitter_seconds_bucket": {"drive", "le"},
    "pnfarm_controller_missed_updates_total": {"drive"},
    "pnfarm_axis_velocity_min_rpm": {"drive"},
    "pnfarm_axis_velocity_max_rpm": {"drive"},
    "pnfarm_axis_setpoint_min_rpm": {"drive"},
    "pnfarm_axis_setpoint_max_rpm": {"drive"},
    "pnfarm_sign_of_life_errors_total": {"drive"},
    "pnfarm_controller_reconnect_seconds_bucket": {"drive", "le"},
    "pnfarm_engine_lateness_seconds_bucket": {"le"},
    "pnfarm_engine_cycles_total": set(),
    "pnfarm_engine_overruns_total": set(),
    "pnfarm_faults_active": {"kind"},
    "pnfarm_drive_faults_active": {"drive"},
    "pnfarm_fault_activations_total": {"kind", "drive"},
    "pnfarm_controller_fault_reaction_seconds_bucket": {"drive", "code", "kind", "le"},
}
#: Two controllers share a drive.
SHARED = """
farm: shared
link: {kind: memory}
drives:
  - {name: axis-01, model: moog-msd, ip: 10.77.0.11/23, params: {P-1283: 200}}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 1ms
  telegram: 1
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
HISTOGRAMS = (
    "pnfarm_controller_frame_interval_seconds",
    "pnfarm_controller_jitter_seconds",
    "pnfarm_controller_reconnect_seconds",
)


def read(collector):
    """Every sample: (name, labels as sorted pairs) -> value."""
    text = collector.gather().text().decode()
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def of(samples, name, **labels):
    return samples[name, tuple(sorted(labels.items()))]


def test_a_drive_s_model_and_bus_are_there_to_join_on():
    samples = read(FarmCollector(VirtualLine(2, controller=False).farm))
    found = {key for key in samples if key[0] == "pnfarm_drive_info"}
    assert {samples[key] for key in found} == {1}
    assert {frozenset(labels) for _, labels in found} == {
        frozenset({("drive", name), ("model", "akd-profinet"), ("bus", "profinet")}) for name in ("axis-01", "axis-02")
    }


def test_every_promised_series_is_there_from_the_start_at_zero():
    line = VirtualLine(2, controller=False)
    samples = read(FarmCollector(line.farm))
    for name, labels in PROMISED.items():
        found = [dict(key) for (sample, key) in samples if sample == name]
        assert found, name
        assert all(set(one) == labels for one in found), name
        if "drive" in labels:
            assert {one["drive"] for one in found} == {"axis-01", "axis-02"}
    counters = [v for (name, _), v in samples.items() if name.endswith(("_total", "_count", "_sum", "_bucket"))]
    assert set(counters) == {0.0}
    for drive in ("axis-01", "axis-02"):
        assert of(samples, "pnfarm_axis_faults_total", drive=drive, code="702") == 0
    assert all(of(samples, "pnfarm_faults_active", kind=kind) == 0 for kind in fault_kinds())


def test_metrics_of_a_running_drive_say_what_its_snapshot_says():
    line = VirtualLine(2)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    line.run(1.0)
    samples = read(collector)
    shown = drive_snapshot(line.farm, line.farm.axis("axis-01"), line.world.now)
    drive = {"drive": "axis-01"}
    assert of(samples, "pnfarm_axis_velocity_rpm", **drive) == pytest.approx(60, abs=0.3)
    assert of(samples, "pnfarm_axis_setpoint_rpm", **drive) == shown["setpoint_rpm"]
    assert of(samples, "pnfarm_axis_state", **drive) == 4
    assert of(samples, "pnfarm_axis_stw1", **drive) == int(shown["stw1"], 16) == 0x047F
    assert of(samples, "pnfarm_axis_zsw1", **drive) == int(shown["zsw1"], 16)
    assert of(samples, "pnfarm_ar_state", **drive) == 9
    assert of(samples, "pnfarm_ar_exchanging", **drive) == 1
    assert of(samples, "pnfarm_ar_cycle_seconds", **drive) == shown["cycle_seconds"] == 0.016
    assert of(samples, "pnfarm_ar_connects_total", **drive) == 1
    assert of(samples, "pnfarm_frames_sent_total", **drive) == shown["frames_sent"] > 60
    assert of(samples, "pnfarm_frames_received_total", **drive) == shown["frames_received"] > 60
    name = "pnfarm_controller_frame_interval_seconds"
    count = of(samples, f"{name}_count", **drive)
    assert count == shown["frames_received"] - 1
    assert of(samples, f"{name}_bucket", **drive, le="0.012") == 0
    assert of(samples, f"{name}_bucket", **drive, le="0.016") == count
    assert of(samples, f"{name}_sum", **drive) == pytest.approx(count * 0.016)
    assert of(samples, "pnfarm_engine_cycles_total") == line.farm.columns.engine[0].cycles


def test_buckets_are_cumulative_and_end_with_the_count():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.run(1.0)
    samples = read(collector)
    for name in (*HISTOGRAMS, "pnfarm_engine_lateness_seconds"):
        buckets = [
            (float(dict(key)["le"]), value) for (sample, key), value in samples.items() if sample == f"{name}_bucket"
        ]
        values = [value for _, value in sorted(buckets)]
        assert values == sorted(values)
        assert max(buckets)[0] == float("inf")
        assert values[-1] == next(v for (sample, _), v in samples.items() if sample == f"{name}_count")


def test_text_is_what_prometheus_client_itself_would_write():
    line = VirtualLine(2)
    collector = FarmCollector(line.farm)
    line.connect()
    line.run(0.5)
    registry = CollectorRegistry()
    registry.register(collector)
    theirs = text_string_to_metric_families(generate_latest(registry).decode())
    ours = text_string_to_metric_families(collector.gather().text().decode())
    assert {f.name: (f.documentation, f.type, f.samples) for f in ours} == {
        f.name: (f.documentation, f.type, f.samples) for f in theirs
    }


def test_counters_never_fall_while_connections_come_and_go():
    line = VirtualLine(2)
    collector = FarmCollector(line.farm)
    line.connect()
    before = read(collector)
    for step in range(12):
        line.run(0.4)
        if step % 4 == 1:
            line.farm.axis("axis-01").station.power_cycle(line.world.now)
        after = read(collector)
        fell = {
            key: (value, after[key])
            for key, value in before.items()
            if key[0].endswith(("_total", "_count", "_sum", "_bucket")) and after[key] < value
        }
        assert not fell
        before = after
    line.connect()
    total = of(read(collector), "pnfarm_frames_received_total", drive="axis-01")
    now = drive_snapshot(line.farm, line.farm.axis("axis-01"), line.world.now)
    consumer = line.farm.axis("axis-01").device.ars
    open_row = next(row for ar in consumer.values() for row, _ in ar.consumers)
    assert total == now["frames_received"] > int(line.farm.columns.cpm[open_row].received)


def test_a_drive_without_supply_has_no_fault_no_words_and_no_voltage_while_its_motor_coasts():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    line.run(1.0)
    station = line.farm.axis("axis-01")
    before = read(collector)
    station.raise_fault("undervoltage", hold=True)
    line.run(0.002)
    station.station.power_off(line.world.now)
    line.run(0.002)
    samples = read(collector)
    gone = ["state", "fault_active", "stw1", "zsw1", "bus_volts", "setpoint_rpm", "setpoint_max_rpm"]
    assert {name: of(samples, f"pnfarm_axis_{name}", drive="axis-01") for name in gone} == dict.fromkeys(gone, 0)
    assert all(of(before, f"pnfarm_axis_{name}", drive="axis-01") for name in gone if name != "fault_active")
    assert of(samples, "pnfarm_axis_velocity_rpm", drive="axis-01") > 1
    # the API has the same
    view = drive_snapshot(line.farm, station, line.world.now)
    assert (view["fault"], view["faults"], view["zsw1"], view["stw1_bits"]) == (None, [], "0x0000", [])
    assert (view["setpoint_rpm"], view["bus_volts"]) == (0, 0)
    assert view["velocity_rpm"] > 1


def test_lost_connection_is_counted_by_reason_and_its_reconnect_is_timed():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    # the controller's frames no longer arrive: the drive's watchdog has to find it
    row = next(row for ar in line.farm.axis("axis-01").device.ars.values() for row, _ in ar.consumers)
    line.farm.columns.cpm[row].source = 1
    start = line.world.now
    assert line.world.run(3.0, until=lambda: line.farm.axis("axis-01").device.watchdog_expirations == 1)
    lost = line.world.now
    line.run(0.1)
    line.enable(10.0)
    back = line.world.now
    samples = read(collector)
    drive = {"drive": "axis-01"}
    assert of(samples, "pnfarm_watchdog_expirations_total", **drive, cause="controller") == 1
    assert of(samples, "pnfarm_ar_aborts_total", **drive, reason="consumer-dht-expired", cause="controller") == 1
    assert of(samples, "pnfarm_axis_faults_total", **drive, code="702") == 1
    assert of(samples, "pnfarm_frames_discarded_total", **drive, reason="wrong-source") >= 3
    assert of(samples, "pnfarm_ar_connects_total", **drive) == 2
    assert of(samples, "pnfarm_controller_reconnect_seconds_count", **drive) == 1
    seconds = of(samples, "pnfarm_controller_reconnect_seconds_sum", **drive)
    assert seconds == pytest.approx((back - lost) / 1e9, abs=0.05)
    assert lost - start < 100_000_000


def test_the_loss_of_a_connection_that_does_not_feed_the_drive_begins_no_reconnect():
    line = SharedLine(SHARED, [lambda slot: slot == 0, lambda slot: slot == 1])
    collector = FarmCollector(line.farm)
    (axis,) = line.farm.axes
    assert line.until(lambda: axis.handle.axis.drive.state == 4), line.reasons()
    # the controller of the head module goes, that of the telegram stays
    line.controllers[0].columns.ppm["active"] = 0
    line.run(20.0)
    assert axis.device.watchdog_expirations == 1
    axis.raise_fault("32-1", hold=False)
    line.run(5.0)
    assert axis.handle.axis.drive.state == 4
    samples = read(collector)
    name = "pnfarm_controller_reconnect_seconds"
    assert of(samples, f"{name}_count", drive="axis-01") == 1
    assert 0.2 < of(samples, f"{name}_sum", drive="axis-01") < 2.0


def test_fault_reaction_of_the_controller_is_timed():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    station = line.farm.axis("axis-01")
    station.raise_fault("undervoltage", hold=False)
    line.run(0.1)
    samples = read(collector)
    drive = {"drive": "axis-01"}
    assert of(samples, "pnfarm_axis_fault_active", **drive) == 502
    assert of(samples, "pnfarm_axis_faults_total", **drive, code="502") == 1
    labels = {**drive, "code": "502", "kind": "none"}
    assert of(samples, "pnfarm_controller_fault_reaction_seconds_count", **labels) == 1
    # one cycle out and one back
    assert 0.001 < of(samples, "pnfarm_controller_fault_reaction_seconds_sum", **labels) < 0.064
    assert of(samples, "pnfarm_controller_reconnect_seconds_count", **drive) == 0
    line.enable(5.0)
    line.run(0.1)
    samples = read(collector)
    assert of(samples, "pnfarm_axis_fault_active", **drive) == 0
    # the program acknowledges after 200 ms and takes the drive up again
    assert of(samples, "pnfarm_controller_reconnect_seconds_count", **drive) == 1
    assert 0.2 < of(samples, "pnfarm_controller_reconnect_seconds_sum", **drive) < 1.0


def test_reaction_is_counted_by_what_was_injected_and_by_the_drive_s_fault():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    for kind, code in (("f702", "702"), ("undervoltage", "502"), ("f702", "702")):
        line.farm.injections.inject({"kind": kind, "on": "axis-01", "for": "1s"}, line.world.now)
        line.run(2.0)
        line.enable(10.0)
        samples = read(collector)
        found = {key[1] for key in samples if key[0] == "pnfarm_controller_fault_reaction_seconds_count"}
        assert any(("code", code) in labels and ("kind", kind) in labels for labels in found), (kind, found)


def test_series_of_reactions_do_not_grow_without_bound():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    for number in (702, 502, 501, 436, 439, 3003):
        if number in line.farm.axes[0].model.faults:
            line.farm.axes[0].raise_fault(number, hold=False)
            line.run(1.0)
            line.enable(10.0)
    samples = read(collector)
    counts = {
        key: value for key, value in samples.items() if key[0] == "pnfarm_controller_fault_reaction_seconds_count"
    }
    assert len(counts) == 4
    assert sum(counts.values()) >= 4


#: Parameters of the kinds that need some, by the model's first fault.
NEEDED = {"drive-fault": "fault", "drive-warning": "warning", "digital-input": "input"}


def inject_every_kind(line):
    """Each kind that the drive can have, one after the other; their names."""
    station = line.farm.axes[0]
    numbers = sorted(station.model.faults)
    done = []
    for kind in fault_kinds():
        fields = {"kind": kind, "on": "axis-01"}
        if kind != "power-cycle":
            fields["for"] = "50ms"
        if kind in NEEDED:
            fields["params"] = {NEEDED[kind]: 0 if kind == "digital-input" else numbers[0]}
        with contextlib.suppress(ConfigError):
            line.farm.injections.inject(fields, line.world.now)
            done.append(kind)
        line.run(0.3)
    line.farm.injections.clear(None, line.world.now)
    return done


@pytest.mark.parametrize("model", ["akd-profinet", "akd-profinet-2012", "hiwin-e1", "moog-msd"])
def test_series_per_drive_stay_below_200_whatever_is_injected(model):
    line = VirtualLine(1, model=model, limits="lax", telegram=3 if model == "hiwin-e1" else 1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable(20.0)
    before = read(collector)
    assert len(inject_every_kind(line)) > 40
    for number in sorted(line.farm.axes[0].model.faults):
        line.farm.axes[0].raise_fault(number, hold=False)
        line.run(0.8)
    samples = read(collector)
    assert len([key for key in samples if ("drive", "axis-01") in key[1]]) < 200
    # nothing is lost: what has no series of its own is counted as "other"
    total = sum(v for key, v in samples.items() if key[0] == "pnfarm_fault_activations_total")
    assert total == sum(line.farm.injections.activations().values())
    assert of(samples, "pnfarm_fault_activations_total", kind="other", drive="axis-01") > 0
    counts = line.farm.axes[0].fault_counts
    assert sum(v for key, v in samples.items() if key[0] == "pnfarm_axis_faults_total") == sum(counts.values())
    assert before.keys() <= samples.keys()
    # what is counted elsewhere once stays there
    line.run(0.1)
    fell = {key for key, value in read(collector).items() if key[0].endswith("_total") and value < samples.get(key, 0)}
    assert not fell


def test_drive_without_room_for_another_series_counts_as_other():
    room = Room(5)
    family = Family("pnfarm_try_total", "counter", "Try.", ("drive", "kind"), room=room, bounded=("kind",))
    for drive in ("a", "b"):
        family.add(drive, "other")
    places = [family.place("a", f"kind-{n}") for n in range(9)]
    assert len(set(places[:4])) == 4
    assert set(places[4:]) == {family.add("a", "other")}
    assert family.place("b", "kind-8") != family.add("b", "other")
    histogram = Histogram("pnfarm_try_seconds", "Try.", (1, 2), ("drive", "kind"), room=room, bounded=("kind",))
    assert histogram.samples == 5
    with_other = histogram.add("b", "other")
    assert histogram.place("b", "more") == with_other


def test_injected_faults_in_force_are_shown_by_drive():
    line = VirtualLine(2)
    collector = FarmCollector(line.farm)
    line.connect()
    for kind in ("loss", "sto"):
        line.farm.injections.inject({"kind": kind, "on": "axis-02", "for": "1s"}, line.world.now)
    line.run(0.1)
    samples = read(collector)
    assert of(samples, "pnfarm_drive_faults_active", drive="axis-01") == 0
    assert of(samples, "pnfarm_drive_faults_active", drive="axis-02") == 2
    line.run(2.0)
    assert of(read(collector), "pnfarm_drive_faults_active", drive="axis-02") == 0


def test_hundreds_of_injected_faults_on_one_drive_are_counted_while_they_come_and_go():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    fault = {"kind": "record-delay", "on": "axis-01", "params": {"delay": "1ms"}}
    begun = [line.farm.injections.inject(fault, line.world.now).id for _ in range(300)]
    for left in (300, 255, 1, 0):
        for one in begun[left:]:
            line.farm.injections.clear(one, line.world.now)
        del begun[left:]
        line.run(0.01)
        assert of(read(collector), "pnfarm_drive_faults_active", drive="axis-01") == left


def test_a_fault_that_waits_and_is_cleared_does_not_count_one_that_is_in_force_less():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    faults = line.farm.injections
    faults.inject({"kind": "record-delay", "on": "axis-01", "params": {"delay": "1ms"}}, line.world.now)
    waits = faults.inject({"kind": "silence", "on": "axis-01", "after": "1h"}, line.world.now)
    faults.clear(waits.id, line.world.now)
    line.run(0.01)
    assert of(read(collector), "pnfarm_drive_faults_active", drive="axis-01") == 1


def test_jitter_of_a_controller_on_time_is_none_and_a_lost_frame_is_a_missed_update():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.run(1.0)
    samples = read(collector)
    drive = {"drive": "axis-01"}
    name = "pnfarm_controller_jitter_seconds"
    intervals = of(samples, "pnfarm_controller_frame_interval_seconds_count", **drive)
    assert of(samples, f"{name}_bucket", **drive, le="1e-06") == of(samples, f"{name}_count", **drive) == intervals > 50
    assert of(samples, f"{name}_sum", **drive) == 0
    # the controller's counter goes on while a frame is lost on its way
    row = line.farm.columns.cpm[line.farm.axes[0].device.channel_rows[1][0]]
    source, row.source = int(row.source), 1
    line.run(0.016)
    row.source = source
    line.run(0.1)
    samples = read(collector)
    assert of(samples, "pnfarm_controller_missed_updates_total", **drive) == 1
    assert of(samples, f"{name}_sum", **drive) == 0


def test_frame_that_the_farm_itself_dropped_is_no_missed_update():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    fields = {"kind": "loss", "on": "axis-01", "probability": 0.2, "seed": 1, "direction": "in"}
    line.farm.injections.inject(fields, line.world.now)
    line.run(0.5)
    samples = read(collector)
    assert of(samples, "pnfarm_frames_discarded_total", drive="axis-01", reason="impaired") > 0
    assert of(samples, "pnfarm_controller_missed_updates_total", drive="axis-01") == 0


def test_extremes_of_the_speed_show_a_sine_that_the_scrapes_miss():
    line = VirtualLine(1, program="{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 200ms}")
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    line.run(10.0)
    for _ in range(6):
        line.run(2.0)
        samples = read(collector)
        for what in ("velocity", "setpoint"):
            assert of(samples, f"pnfarm_axis_{what}_max_rpm", drive="axis-01") == pytest.approx(600, abs=15)
            assert of(samples, f"pnfarm_axis_{what}_min_rpm", drive="axis-01") == pytest.approx(-600, abs=15)


def test_release_by_the_controller_is_no_loss():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    line.plc.release(line.world.now)
    line.run(1.0)
    samples = read(collector)
    assert of(samples, "pnfarm_ar_state", drive="axis-01") == 0
    assert of(samples, "pnfarm_ar_exchanging", drive="axis-01") == 0
    assert of(samples, "pnfarm_ar_cycle_seconds", drive="axis-01") == 0
    assert of(samples, "pnfarm_controller_reconnect_seconds_count", drive="axis-01") == 0


def test_calls_that_were_answered_are_no_discards_of_a_healthy_drive():
    line = VirtualLine(1)
    collector = FarmCollector(line.farm)
    line.connect()
    line.enable()
    # longer than anything is remembered of a call
    line.run(400.0)
    found = {
        dict(labels)["reason"]: count
        for (name, labels), count in read(collector).items()
        if name == "pnfarm_frames_discarded_total" and count
    }
    # what a switch floods to every port
    assert found.keys() <= {"identify-for-another", "arp-for-another"}


def test_closed_collector_listens_no_more():
    line = VirtualLine(1, controller=False)
    before = list(line.log._subscribers)
    collector = FarmCollector(line.farm)
    collector.close()
    assert line.log._subscribers == before  # nothing is fed any more


def test_label_values_are_escaped():
    family = Family("pnfarm_try", "gauge", "Try.", ("what",))
    value = 'a "quoted" \\ back\nslash'
    family.add(value)
    (parsed,) = text_string_to_metric_families(family.text([1.5]) + "\n")
    assert parsed.samples[0].labels == {"what": value}
    assert parsed.samples[0].value == 1.5


def test_series_added_after_a_look_come_with_the_next():
    family = Family("pnfarm_try_total", "counter", "Try.", ("what",))
    family.add("a")
    looked = [1]
    family.add("b")
    assert "b" not in family.text(looked)
    assert 'what="b"} 2' in family.text([1, 2])


@needs_promtool
def test_promtool_has_nothing_to_remark():
    line = VirtualLine(2)
    collector = FarmCollector(line.farm)
    line.connect()
    line.run(0.2)
    done = subprocess.run(
        ["promtool", "check", "metrics"], input=collector.gather().text(), capture_output=True, check=False
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, b"")


def test_a_thousand_drives_have_all_their_series_in_one_scrape(monkeypatch):
    # no addresses, or a thousand drives would announce theirs to a thousand
    monkeypatch.setattr(virtual_line, "FILE", virtual_line.FILE.replace("    ip: 10.77.0.11/23\n", ""))
    line = VirtualLine(1024, controller=False)
    collector = FarmCollector(line.farm)
    line.run(0.1)
    consumers = line.farm.columns.cpm
    line.farm.columns.engine[0].cpm_rows = 1024
    for row in range(1024):
        consumers[row].active, consumers[row].state, consumers[row].image = 1, FRUN, row
    text = collector.gather().text()
    assert text.count(b"\n") > 100_000
    consumers.received[:1024] += 100
    again = collector.gather().text()
    assert again.count(b"\n") == text.count(b"\n")
    assert again != text
