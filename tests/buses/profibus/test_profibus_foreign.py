"""The built-in master with slaves that it knows from a GSD file only; GSD files of any maker."""

import asyncio

import pytest

from pnfarm.buses.profibus.controller.plan import plan_controller
from pnfarm.buses.profibus.description.sheet import describe_model
from pnfarm.controller.line import VirtualLine, join_controllers
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.writer import emit_gsd
from pnfarm.station.event_log import EventLog

OWN = emit_gsd(describe_model(model("moog-msd-dp")))
GSD = b"""
; a remote I/O
#Profibus_DP
GSD_Revision = 3
Vendor_Name = "Maker"
Model_Name = "IO \xb5"
Ident_Number = 0x1234
Station_Type = 0
Modular_Station = 1
Max_Module = 3
Freeze_Mode_supp = 1
ExtUserPrmData = 1 "Filter"
Bit(3) 1 0-1
EndExtUserPrmData
ExtUserPrmData = 2 "Time"
Unsigned16 500 1-1000
EndExtUserPrmData
ExtUserPrmData = 3 "Mode"
BitArea(4-6) 5 0-7
EndExtUserPrmData
Ext_User_Prm_Data_Const(0) = 0x01,0x02,\\
                             0x03
Ext_User_Prm_Data_Ref(1) = 1
Module = "8 DI" 0x10
1
EndModule
Module = "8 DO; fast" 0x20 ; with a comment
2
Ext_Module_Prm_Data_Len = 4
Ext_User_Prm_Data_Const(0) = 0xAA,0,0,0
Ext_User_Prm_Data_Ref(1) = 2
Ext_User_Prm_Data_Ref(3) = 3
EndModule
"""
FARM = """
farm: dp
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n:02}}', count: 2, model: moog-msd-dp, address: 11}}
"""
MASTER = """
controller:
  name: plc
  address: 2
  link: {{kind: serial, port: /dev/null}}
  cycle: 5ms
  watchdog: 100ms
  devices:
    - {{name: servo, gsd: msd.gsd, address: {address}, modules: [{module}]{more}}}
"""


def master(folder, *, address=12, module="Standard telegram 1", more="", gsd=OWN):
    (folder / "msd.gsd").write_bytes(gsd)
    return parse_farm(MASTER.format(address=address, module=module, more=more), folder / "plc.pnfarm.yml")


def planned(folder, **options):
    config = master(folder, **options)
    (device,) = plan_controller(config.controller, [], [], folder).devices
    return device


# -- GSD files ---------------------------------------------------------------------------------------------------------


def test_set_prm_and_chk_cfg_have_what_the_file_says_with_the_defaults_of_its_modules():
    slave = plug_slave(parse_gsd_file(GSD), {1: "8 do; FAST", 2: "8 DI"})
    # in the constant octets the default of `Filter` sets bit 3
    assert (slave.identifiers, slave.user) == (b"\x20\x10", bytes.fromhex("01 0a 03 aa 01 f4 50"))


def test_the_file_of_a_virtual_drive_is_read_as_it_was_written():
    slave = parse_gsd_file(OWN)
    described = model("moog-msd-dp").profidrive
    assert slave.ident == described.identity.device_id
    assert {module.identifiers for module in slave.modules} == {
        telegram.identifiers for telegram in described.telegrams.values()
    }
    assert (slave.parameters.defaults(), slave.v1, slave.freeze, slave.sync) == (
        bytes.fromhex("80 00 00"),
        True,
        True,
        True,
    )


# -- farm files --------------------------------------------------------------------------------------------------------


def test_a_slave_is_planned_by_its_file(tmp_path):
    device = planned(tmp_path, gsd=GSD, module="8 DI, 8 DO; fast", more=", outputs: '5A'")
    assert (device.name, device.model, device.outputs) == ("servo", "IO µ", b"\x5a")
    plan = device.slave
    assert (plan.ident, plan.identifiers, plan.address) == (0x1234, b"\x10\x20", 12)
    assert (plan.input_octets, plan.output_octets) == (1, 1)
    assert plan.user == bytes.fromhex("01 0a 03 aa 01 f4 50")


def test_octets_of_set_prm_may_be_the_users_own(tmp_path):
    assert planned(tmp_path, more=", user: '80 00 08'").slave.user == bytes.fromhex("80 00 08")


@pytest.mark.parametrize(("user", "factors"), [("80 00 08", (1, 10)), ("84 00 08", (1, 100))])
def test_the_watchdog_has_the_base_that_the_users_octets_say(tmp_path, user, factors):
    assert planned(tmp_path, more=f", user: '{user}'").slave.watchdog_factors == factors


@pytest.mark.parametrize(
    ("options", "message"),
    [({"module": "Telegram 2"}, r"device servo, .*msd\.gsd: the file has no module 'Telegram 2'"),
     ({"more": ", outputs: '0102030405'"}, "5 octets of `outputs`, its modules have 4"),
     ({"gsd": b"no"}, "no line is #Profibus_DP")],
)  # fmt: skip
def test_a_slave_that_cannot_be_planned_is_told_with_its_file(tmp_path, options, message):
    with pytest.raises(ConfigError, match=message):
        planned(tmp_path, **options)


def test_a_missing_file_is_told(tmp_path):
    config = master(tmp_path)
    (tmp_path / "msd.gsd").unlink()
    with pytest.raises(ConfigError, match=r"msd\.gsd cannot be read: no such file"):
        plan_controller(config.controller, [], [], tmp_path)


def test_an_address_that_is_taken_is_refused(tmp_path):
    with pytest.raises(FarmFileError, match="station address 2 belongs to"):
        master(tmp_path, address=2)


# -- on the line -------------------------------------------------------------------------------------------------------


def test_a_drive_is_run_by_its_gsd_file_as_a_foreign_slave(tmp_path):
    config = master(tmp_path, more=", outputs: '0476 0000'")

    async def work():
        line = await VirtualLine.create(parse_farm(FARM.format()))
        joined = await join_controllers(line.world, config, [], EventLog(quiet=True))
        plc = joined.controllers.first
        assert line.world.run(5.0, until=lambda: plc.all_connected)
        line.world.run(0.5)
        device = line.farm.axis("axis-02").device
        assert device.connected
        assert not line.farm.axis("axis-01").device.connected
        assert plc.inputs_of("servo").hex().startswith("67")
        assert int(line.farm.axis("axis-02").handle.image.received[0]) == 0x0476
        (row,) = plc.snapshot()
        assert (row["name"], row["model"], row["state"]) == ("servo", "MSD Drive (pnfarm)", "data-exchange")
        assert row["frames_received"] > 50
        with pytest.raises(ConfigError, match="servo is described by a GSD file, which has no parameters"):
            plc.read_parameter("servo", "P-0918", line.world.now)
        line.farm.injections.inject({"kind": "link-down", "on": "axis-02", "for": "300ms"}, line.world.now)
        line.world.run(0.3)
        assert not plc.exchanging("servo")
        assert line.world.run(5.0, until=lambda: plc.all_connected)
        await joined.close()
        await line.close()

    asyncio.run(work())
