"""pnfarm as a library: farms that Python code runs and injects faults into.  Asynchronous; for plain functions in tests
there is :mod:`pnfarm.testing`.

::

    async with pnfarm.Farm.from_file("line-1.pnfarm.yml") as farm:
        axis = farm.drive("axis-01")
        await axis.wait_for("state == S4", within=20)
        async with axis.fault("f702") as fault:
            await axis.wait_for("stw1.enable_operation == 0", within=0.5)
        print(fault.evidence)
"""

from pnfarm.farm.wait import NotInTime
from pnfarm.library.device import Device
from pnfarm.library.drive import Drive
from pnfarm.library.events import FarmEvent
from pnfarm.library.farm import Farm
from pnfarm.library.fault import FaultHandle
from pnfarm.library.metrics import Metrics
from pnfarm.library.remote import RemoteDrive, RemoteFarm
from pnfarm.library.remote_device import RemoteDevice
from pnfarm.library.result import ScenarioResult

__all__ = [
    "Device",
    "Drive",
    "Farm",
    "FarmEvent",
    "FaultHandle",
    "Metrics",
    "NotInTime",
    "RemoteDevice",
    "RemoteDrive",
    "RemoteFarm",
    "ScenarioResult",
]
