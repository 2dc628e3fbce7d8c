"""A device with much data: slots for modules of many octets each way, and as many CRs as a test asks for."""

from pnfarm.protocols.profinet.gsdml.document import (
    Dap,
    DataItem,
    DataItems,
    Gsdml,
    Info,
    InterfaceSubmodule,
    ItemRef,
    ModuleItem,
    Relations,
    SubmoduleItem,
)
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

SLOTS = Numbers.of(range(1, 9))
NAME = "GSDML-V2.35-Example-Wide-20261128.xml"
#: Octets of status of the access point and the interface, in a frame each way.
HEAD_STATUS = 2
#: (octets in, octets out) of the modules, each called IN_OUT.
MODULES = ((1436, 1436), (700, 700), (720, 720), (8, 8), (16, 0), (0, 16))


def _octets(count):
    return DataItems((DataItem("OctetString", count),), whole=True) if count else None


def _module(number, inputs, outputs):
    submodule = SubmoduleItem(
        f"S_{number}", 0x100 + number, Info(f"{inputs}/{outputs}"), inputs=_octets(inputs), outputs=_octets(outputs)
    )
    return ModuleItem(f"{inputs}_{outputs}", 0x10 + number, Info(f"{inputs}/{outputs}"), submodules=(submodule,))


def wide_file(folder, inputs=1, outputs=1, ars=1):
    """The path of its GSDML file; ``inputs`` and ``outputs`` are additional CRs."""
    modules = tuple(_module(number, *octets) for number, octets in enumerate(MODULES))
    relations = Relations(
        ("Legacy", "Advanced"), ars, additional_input_crs=inputs, additional_output_crs=outputs,
        send_clocks=Numbers.of([8, 16, 32, 64]),
    )  # fmt: skip
    dap = Dap(
        "DAP", 1, Info("Wide", order_number="WIDE-1"), "V2.35", physical_slots=Numbers.of(range(9)),
        fixed_slots=Numbers.of([0]), dns_name="wide", max_input=8192, max_output=8192, min_device_interval=8,
        modules=tuple(ItemRef(module.id, allowed=SLOTS) for module in modules),
        submodules=(SubmoduleItem("S_DAP", 1, Info("Wide")),),
        interfaces=(InterfaceSubmodule("IF", 0x100, relations=relations),),
    )  # fmt: skip
    path = folder / NAME
    path.write_text(emit_gsdml(Gsdml(0xFF01, 9, "Example", product_family="Wide", daps=(dap,), modules=modules)))
    return path


def wide_group(path, slots, more=""):
    """The farm file's group of one device."""
    plugged = ", ".join(f'{slot}: "{module}"' for slot, module in slots.items())
    return f"devices:\n  - {{name: wide, gsdml: {path}, ip: 10.77.0.41/24, slots: {{{plugged}}}{more}}}\n"
