"""The data items of a GSDML file as signals."""

from gsdml_examples import ISLAND, SCANNER, example

from pnfarm.buses.profinet.file_signals import file_signals
from pnfarm.protocols.profinet.gsdml.station import plug_station

MODULES = {1: "DI16", 2: "DO8", 3: "AI4", 4: "VALVES", 5: "SERIAL", 6: "FDI4", 8: "COUNTER2"}


def island():
    station = plug_station(example(ISLAND), access_point="DAP 2", modules=MODULES, submodules={(0, 2): "PLUG_STATE"})
    return {signal.name: signal for signal in file_signals(station)}


def test_named_bits_are_signals_of_their_own():
    found = island()
    assert {n: (s.direction, s.place, s.type.name) for n, s in found.items() if n.startswith("slot1_input_1")} == {
        "slot1_input_1": ("input", "1.1.0.1", "bool"),
        "slot1_input_10": ("input", "1.1.1.2", "bool"),
        "slot1_input_11": ("input", "1.1.1.3", "bool"),
        "slot1_input_12": ("input", "1.1.1.4", "bool"),
        "slot1_input_13": ("input", "1.1.1.5", "bool"),
        "slot1_input_14": ("input", "1.1.1.6", "bool"),
        "slot1_input_15": ("input", "1.1.1.7", "bool"),
    }
    assert found["slot4_valve_5_coil_14"].place == "4.1.1.0"
    assert found["slot0_sensor_supply"].place == "0.2.3.0"
    assert "slot4_state" not in found


def test_other_items_have_their_type():
    found = island()
    assert [found[name].type.name for name in (
        "slot3_value_2", "slot4_supply_pressure", "slot5_received", "slot5_send_length", "slot6_safety_trailer_out",
        "slot8_2_preset", "slot0_island_text",
    )] == ["int16", "float32", "octets[30]", "uint8", "octets[4]", "int32", "text[8]"]  # fmt: skip
    assert found["slot3_value_2"].read(bytes(4) + b"\xff\xfe" + bytes(2)) == -2


def test_a_fixed_device_has_its_signals_without_a_choice():
    found = {s.name: s for s in file_signals(plug_station(example(SCANNER)))}
    assert found["slot1_trigger"].direction == "output"
    octets = bytearray(64)
    found["slot2_code"].write(octets, "4006381333931")
    assert found["slot2_code"].read(octets) == "4006381333931"
    assert octets[4:17] == b"4006381333931"
