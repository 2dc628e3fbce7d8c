"""Each PROFINET model with its GSDML file, and plans that a controller makes of the file alone."""

from cm_support import Bench, device_of
from cmctl_pair import Pair
from cmctl_peers import make_plan

from pnfarm.buses.profinet.axis_slots import axis_shifts
from pnfarm.buses.profinet.binding import AxisPlace, describe_device
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives.catalogue import models
from pnfarm.protocols.profinet.cm.controller.cmctl import CmController
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

MS = 1_000_000
MAC = bytes.fromhex("020000000077")
NAMES = sorted(name for name, entry in models().items() if entry.bus == "profinet")
LIMITS = {
    "manual": {},
    "8 ms": {"min_cycle_ns": 8 * MS, "max_cycle_ns": 0},
    "0.5 to 4 ms": {"min_cycle_ns": MS // 2, "max_cycle_ns": 4 * MS},
    "1 ms, two controllers": {"min_cycle_ns": MS, "io_controllers": 2},
}


def described(drive_model):
    """The file as a controller's engineer reads it, and the device."""
    gsdml = parse_gsdml(emit_gsdml(describe_model(drive_model)).encode())
    every = [AxisPlace(shift) for shift in axis_shifts(drive_model, [None] * drive_model.limits.axes)]
    return gsdml, describe_device(drive_model, MAC, strict=True, axes=every)


def plan_of(gsdml, module_id=None, clock=None, submodules=None, slots=(1,), **changes):
    """A plan made of the file alone, at the device's fastest cycle unless ``clock`` (factor, ratio) is given."""
    chosen = {} if module_id is None else dict.fromkeys(slots, module_id)
    device = from_gsdml(gsdml, modules=chosen, submodules=submodules or {})
    if clock is None:
        clock = (32, max(1, device.dap.min_device_interval // 32))
    return make_plan(
        vendor_id=device.vendor_id,
        device_id=device.device_id,
        instance=device.instance,
        submodules=device.submodules,
        records=device.records,
        multiple_write=device.multiple_write,
        send_clock_factor=clock[0],
        reduction_ratio=clock[1],
        **changes,
    )


def connected(plan, description):
    """The Connect's answer of a new device."""
    bench = Bench(description)
    return bench.call(0, connect_payload(plan, *plan_frames(plan)))[0]


def station_of(plan, description):
    """Both ends, the device with the records that it really has."""
    return Pair(CmController(plan), *device_of(description, mac=MAC))
