"""p-net's sample application and a device of the farm by the same GSDML file: the same requests, the same answers."""

import json

import pytest
from interop_rig import Worker
from pnet_device import GSDML, NAME, PnetDevice

CONTROLLER = """
controller:
  name: plc
  interface: plc0
  ip: 10.77.3.201/22
  cycle: 16ms
  watchdog_factor: 20
  reconnect: {{after: 500ms}}
"""
FOREIGN = (
    CONTROLLER
    + """  devices:
    - {{name: {name}, gsdml: {gsdml}, ip: 10.77.0.50/22, modules: {{1: IDM_32, 2: IDM_40}}}}
"""
)
OWN = (
    CONTROLLER
    + """
farm: beside
link: {{kind: macvlan, parent: nic0}}
api: off
devices:
  - {{name: {name}, gsdml: {gsdml}, ip: 10.77.0.50/22, slots: {{1: IDM_32, 2: IDM_40}}}}
"""
)
#: Records of a submodule, of the access point's port and interface, of slot, AR, API and device.
INDEXES = (
    *(0xAFF0, 0xAFF1, 0xAFF2, 0xAFF3, 0xAFF4, 0xAFF5, 123, 124, 125, 77),
    *(0x8000, 0x8001, 0x800A, 0x800B, 0x800C, 0x8010, 0x8011, 0x8012, 0x8013, 0x801E, 0x8028, 0x8029, 0x802A, 0x802B),
    *(0x802F, 0x8030, 0x8070, 0x8080, 0x8090, 0xC000, 0xC001, 0xC00A, 0xC00B, 0xC00C, 0xE000, 0xE001, 0xE00A, 0xE00B),
    *(0xE00C, 0xE010, 0xE030, 0xE040, 0xF000, 0xF00A, 0xF00B, 0xF00C, 0xF020, 0xF820, 0xF821, 0xF830, 0xF831, 0xF840),
    *(0xF841, 0xF842, 0xFBFF),
)
INTERFACE, PORT, FIRST, SECOND = (0, 0x8000), (0, 0x8001), (1, 1), (2, 1)
PLUGGED = ((0, 1), INTERFACE, PORT, FIRST, SECOND)
NOWHERE = ((1, 2), (9, 1))
IM1 = "002100380100" + b"press 4".ljust(32).hex() + b"hall 2".ljust(22).hex()
WRITES = (
    ((0, 1), 0xAFF1, IM1),
    ((0, 1), 0xAFF1, "00"),
    ((0, 1), 0xAFF0, "00" * 60),
    (FIRST, 123, "00000007"),
    (FIRST, 123, "0007"),
    (FIRST, 77, "00"),
    (FIRST, 0x8028, "00"),
    (FIRST, 0xAFF1, IM1),
    ((9, 1), 123, "00000001"),
)
#: What one of them answers and the other refuses, and why ours does as it does.
ANSWERED_BY_ONE = {
    **dict.fromkeys(
        [(place, 0xF841) for place in (INTERFACE, PORT, FIRST, SECOND)],
        "PDRealData is the device's, so that its place does not matter; p-net asks for the access point's",
    ),
    (INTERFACE, 0x8070): "PDNCDataCheck was never written: it is empty, as all records of that kind; p-net has none",
    (INTERFACE, 0x8090): "PDInterfaceFSUDataAdjust, in the same way",
    (FIRST, 0x801E): "outputs have a substitute value; p-net has none",
    (SECOND, 0x801E): "the same",
    ("write", FIRST, 0xAFF1, 60): "the file lets I&M1 of the access point alone be written; p-net takes it anywhere",
}
#: Records whose octets are the device's own (texts, times, serial numbers), so that their length may differ.
OF_ITS_OWN = {0xF830: "log book entries", 0xF840: "I&M0FilterData: p-net leaves out the modules' block"}


def answers(plc):
    """(place, index) -> status and octets; writes with their length."""
    found = {}
    for slot, subslot in (*PLUGGED, *NOWHERE):
        for index in INDEXES:
            told = plc.ask("read", name=NAME, api=0, slot=slot, subslot=subslot, index=index)
            found[(slot, subslot), index] = told["status"], told["data"]
    for place, index, data in WRITES:
        told = plc.ask("write", name=NAME, api=0, slot=place[0], subslot=place[1], index=index, data=data)
        found["write", place, index, len(data) // 2] = told["status"], None
    return found


@pytest.fixture(scope="module")
def beside(lab, tmp_path_factory):
    """The answers of p-net, and those of our device."""
    found = []
    for text in (FOREIGN, OWN):
        folder = tmp_path_factory.mktemp("beside")
        path = folder / "line.pnfarm.yml"
        path.write_text(text.format(name=NAME, gsdml=json.dumps(str(GSDML.resolve()))), encoding="utf-8")
        device = PnetDevice(lab, folder) if text is FOREIGN else Worker(lab, "farm", "farm", path)
        plc = Worker(lab, "peer", "plc", path)
        try:
            assert plc.ask("wait_connected", seconds=20), plc.ask("summary")
            found.append(answers(plc))
        finally:
            plc.close()
            device.close()
    return found


def test_what_one_answers_the_other_answers_but_for_what_is_listed(beside):
    theirs, ours = beside
    unlike = {key for key in theirs if (theirs[key][0] == 0) != (ours[key][0] == 0) and key[0] not in NOWHERE}
    assert unlike == set(ANSWERED_BY_ONE)


def test_answers_have_the_same_length(beside):
    theirs, ours = beside
    both = [key for key in theirs if theirs[key][0] == ours[key][0] == 0 and theirs[key][1] is not None]
    assert len(both) > 100
    unlike = {key[1] for key in both if len(theirs[key][1]) != len(ours[key][1])}
    assert unlike <= set(OF_ITS_OWN)


def test_where_nothing_is_plugged_ours_names_the_place_as_wrong_and_pnet_answers(beside):
    """0xB2: invalid slot or subslot; what is the AR's or the device's is answered anywhere."""
    theirs, ours = beside
    there = [key for key in theirs if key[0] in NOWHERE and key[1] < 0x8000]
    assert {ours[key][0] for key in there} == {0xDE80B200}
    assert any(theirs[key][0] != 0xDE80B200 for key in there)


def test_refusals_are_of_the_same_class_where_both_are_the_stacks_own(beside):
    """0x80: PNIORW; 0xB0 to 0xB8 the stack's, 0xA0 and 0xA1 what p-net's application says of any index of its own."""
    theirs, ours = beside
    for key, (status, _) in theirs.items():
        other = ours[key][0]
        if status and other and key[0] not in NOWHERE and status >> 8 & 0xFF != 0xA0 and status >> 8 & 0xFF != 0xA1:
            assert (status >> 16, other >> 16) in {(0xDE80, 0xDE80), (0xDF80, 0xDF80)}, key
            assert other >> 12 & 0xF == 0xB, key


def test_identity_is_the_same_but_for_what_the_application_sets(beside):
    """Order number, serial number and releases are the sample's own, and not those of its file."""
    theirs, ours = (bytes.fromhex(answer[(0, 1), 0xAFF0][1]) for answer in beside)
    # block header and vendor; I&M version and what can be written
    assert (theirs[:8], theirs[-4:]) == (ours[:8], ours[-4:])
