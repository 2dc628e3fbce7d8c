"""Farms on real ways to a line, a pty and TCP: noise, masters that come and go.  Needs no rights."""

from __future__ import annotations

import asyncio
import json
import os
import random

import pytest
from serial_farm import config, master, states
from waiting import reached

from pnfarm.api.schemas.farm import LineView
from pnfarm.buses import registry
from pnfarm.captures.reading import FrameReader
from pnfarm.cli.main import main
from pnfarm.drives.catalogue import model
from pnfarm.farm.capture import CaptureSettings
from pnfarm.farm.farm import Farm
from pnfarm.farm.views.snapshot import line_snapshot
from pnfarm.links.joined import lines_of
from pnfarm.metrics import FarmCollector
from pnfarm.protocols.profibus.wire.telegram import Request, Telegram, emit_telegram
from pnfarm.station.event_log import EventLog

pytestmark = pytest.mark.asyncio
NOISE = 1_000_000
PLC_MODE = model("moog-msd-dp").parameters[1256].name


async def poured(fd: int, octets: bytes) -> None:
    """Write as the far end takes it."""
    loop = asyncio.get_running_loop()
    rest = memoryview(octets)
    while rest:
        room = loop.create_future()
        loop.add_writer(fd, room.set_result, None)
        try:
            await asyncio.wait_for(room, 20)
        finally:
            loop.remove_writer(fd)
        rest = rest[os.write(fd, rest[:4096]) :]


async def test_a_million_octets_of_noise_change_nothing_but_counters(tmp_path):
    told = config(f"pty: {tmp_path}/line")
    async with Farm(told, log=EventLog(quiet=True)) as farm:
        await reached(lambda: all(state[0] == 1 for state in states(farm)))
        before = states(farm)
        (link,) = lines_of(farm.link).values()
        draw = random.Random(20)
        poll = emit_telegram(Telegram(11, 1, Request.SRD_HIGH, data=bytes(4)))
        # pure noise, telegrams with a wrong octet, halves of telegrams
        parts = [draw.randbytes(draw.randint(1, 300)) for _ in range(6000)]
        parts += [poll[: draw.randint(1, len(poll) - 1)] for _ in range(3000)]
        parts += [bytes(octet ^ (draw.random() < 0.2) for octet in poll) for _ in range(3000)]
        draw.shuffle(parts)
        octets = b"".join(parts)[:NOISE]
        assert len(octets) >= 900_000
        fd = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            await poured(fd, octets)
            await reached(lambda: link.line.counters.received == len(octets))
        finally:
            os.close(fd)
        assert states(farm) == before
        assert sum(link.splitter.dropped.values()) > 100_000
        assert len(farm.log.entries("axis-01")) < 50
        async with master(told) as plc:
            await reached(lambda: plc.controllers.all_running)


@pytest.mark.parametrize("way", ["pty", "listen"])
async def test_a_parameter_of_a_station_is_read_and_written_over_a_line_without_a_master(tmp_path, capsys, way):
    line = str(tmp_path / "line")
    path = f"pty: '{line}'" if way == "pty" else "listen: '127.0.0.1:0'"
    async with Farm(config(path, 2), log=EventLog(quiet=True)) as farm:
        if way == "listen":
            line = next(iter(lines_of(farm.link).values())).where

        def param(*words):
            return main(["param", *words, "--line", line])

        assert await asyncio.to_thread(param, "set", "12", "1256", "3") == 0
        assert capsys.readouterr().out == "station 12 1256.0 = 3\n"
        assert [station.store.get("P-1256") for station in farm.core.axes] == [0, 3]
        assert await asyncio.to_thread(param, "get", "12", "P-1256", "--model", "moog-msd-dp", "--format", "json") == 0
        assert json.loads(capsys.readouterr().out)["value"] == 3
        assert await asyncio.to_thread(param, "get", "12", "9") == 2
        assert "impermissible parameter number (0x00)" in capsys.readouterr().err
        assert await asyncio.to_thread(param, "get", "13", "918") == 1
        assert "station 13 does not answer" in capsys.readouterr().err
        assert not any(station.device.slave.class_two.open for station in farm.core.axes)


async def test_a_running_controller_is_asked_for_the_parameters_of_its_stations(tmp_path, capsys):
    line = str(tmp_path / "line")
    whole = config(f"pty: '{line}'", 2, watchdog="10s")

    async def param(*words):
        code = await asyncio.to_thread(main, ["param", *words, "--line", line])
        said = capsys.readouterr()
        return code, said.out or said.err

    async with Farm(whole, log=EventLog(quiet=True)) as farm, master(whole) as plc:
        await reached(lambda: plc.core.all_connected)
        at_once = [param("set", "12", "P-1256", "2"), param("get", "11", "922"), param("get", "12", "918")]
        told = await asyncio.gather(*at_once)
        assert [code for code, _ in told] == [0, 0, 0], told
        assert [station.store.get("P-1256") for station in farm.core.axes] == [0, 2]
        assert await param("get", "12", "1256") == (0, f"axis-02 1256.0 {PLC_MODE} = 2\n")
        assert await param("get", "40", "918") == (
            2, "pnfarm: controller plc has no station 40; it has 11, 12\n",
        )  # fmt: skip
        code, said = await param("set", "11", "P-0964", "3")
        assert (code, "parameter value cannot be changed (0x01)" in said) == (2, True), said
        assert plc.core.all_connected
        assert [station.device.connects for station in farm.core.axes] == [1, 1]
    code, said = await param("get", "11", "918")
    assert (code, "does not exist" in said) == (4, True), "neither farm nor controller is there"


async def test_a_line_that_a_master_has_open_is_not_taken_from_it(tmp_path, capsys):
    line = str(tmp_path / "line")
    whole = config(f"pty: '{line}'", 1)
    async with Farm(whole, log=EventLog(quiet=True)) as farm, master(whole) as plc:
        await reached(lambda: plc.core.all_connected)
        # the far end under a name that the controller does not know
        far = await asyncio.to_thread(os.path.realpath, line)
        assert await asyncio.to_thread(main, ["param", "get", "11", "918", "--line", far]) == 4
        assert "is in use by another program" in capsys.readouterr().err
        await asyncio.sleep(0.1)
        assert plc.core.all_connected
        assert farm.core.axes[0].device.connects == 1


async def test_a_master_over_tcp_is_lost_and_another_one_takes_its_place(tmp_path):
    async with Farm(config("listen: '127.0.0.1:0'"), log=EventLog(quiet=True)) as farm:
        (link,) = lines_of(farm.link).values()
        # the controller finds the other end by the farm's own
        told = config(f"listen: '127.0.0.1:{link.line.port}'")
        async with master(told) as plc:
            await reached(lambda: plc.controllers.all_running)
        await reached(lambda: not any(station.device.connected for station in farm.core.axes))
        async with master(told) as plc:
            await reached(lambda: plc.controllers.all_running)
        assert [station.device.connects for station in farm.core.axes] == [2] * 4
        assert link.line.counters.opened == 2


async def test_a_capture_of_a_running_farm_has_the_telegrams_of_each_drive(tmp_path):
    told, path = config(f"pty: {tmp_path}/line", 2), tmp_path / "line.pcapng"
    async with Farm(told, log=EventLog(quiet=True), capture=CaptureSettings(path)) as farm:
        async with master(told) as plc:
            await reached(lambda: plc.controllers.all_running)
        received = farm.core.axes[0].device.image.counts.received
    decoder = registry.decoder()
    lines = [line for frame in FrameReader(path, decoder.link_types) for line in decoder.feed(frame)]
    names = {decoder.name(line.source) for line in lines} | {decoder.name(line.destination) for line in lines}
    assert names == {"axis-01", "axis-02", "station 1", "all"}
    said = [f"{decoder.name(line.source)} {line.description.what} {line.description.text}" for line in lines]
    for axis in ("axis-01", "axis-02"):
        assert f"{axis} Set_Prm.res acknowledged" in said
        assert any(text.startswith(f"{axis} ZSW1") and "S4 operation" in text for text in said)
    assert farm.capture.lost == 0
    cyclic = [one for talk in decoder.summary() for one in talk["cyclic"] if "axis-01" in talk["between"]]
    assert [one["frames"] for one in cyclic] == [received] * 2


async def test_metrics_and_api_tell_of_the_line(tmp_path):
    told = config(f"pty: {tmp_path}/line", 2)
    farm = Farm(told, log=EventLog(quiet=True))
    collectors = []
    farm.on_start.append(lambda core: collectors.append(FarmCollector(core)))
    async with farm:
        (collector,) = collectors
        before = line_snapshot(farm.core, "profibus")
        assert (before["up"], before["where"].split(" ")[0]) == (False, f"{tmp_path}/line")
        async with master(told) as plc:
            await reached(lambda: plc.controllers.all_running)
            assert line_snapshot(farm.core, "profibus")["up"]
            os.write(os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY), b"\x99" * 7)
            await reached(lambda: line_snapshot(farm.core, "profibus")["dropped"].get("garbage", 0) >= 7)
        seen = LineView.model_validate(line_snapshot(farm.core, "profibus"))
        values = {
            (sample.name, *sorted(sample.labels.values())): sample.value
            for metric in collector.collect()
            for sample in metric.samples
            if metric.name.startswith("pnfarm_line")
        }
        collector.close()
        assert values["pnfarm_line_telegrams_total", "in", "profibus"] == seen.telegrams_received > 20
        assert values["pnfarm_line_telegrams_total", "out", "profibus"] == seen.telegrams_sent > 20
        assert values["pnfarm_line_octets_total", "in", "profibus"] == seen.octets_received
        assert values["pnfarm_line_dropped_total", "garbage", "profibus"] == seen.dropped["garbage"]
        assert values["pnfarm_line_requests_total", "diagnosis", "profibus"] == seen.counts["diagnosis"] >= 4
        assert 0 < values["pnfarm_line_reply_seconds_count", "profibus"] <= seen.telegrams_sent
        assert 0 < seen.reply_seconds_mean < 1
        happened = [entry.event for entry in farm.log.entries()]
        assert "serial line opened" in happened


async def test_counts_of_a_line_do_not_fall_when_a_drive_is_switched_off_and_on(tmp_path):
    told = config(f"pty: {tmp_path}/line", 1)
    async with Farm(told, log=EventLog(quiet=True)) as farm, master(told) as plc:
        await reached(lambda: plc.controllers.all_running)
        # on a machine that stood, the master may have begun more than once
        before, connects = farm.core.line_counts("profibus")["diagnosis"], farm.core.axes[0].device.connects
        farm.core.axes[0].station.power_cycle(farm.now())
        farm.poke()
        await reached(lambda: farm.core.axes[0].device.connects > connects)
        assert farm.core.line_counts("profibus")["diagnosis"] > before
