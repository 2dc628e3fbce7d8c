"""For tests: drives and a controller in memory, in virtual time; an hour takes seconds.

::

    from pnfarm.testing import Line


    def test_the_plc_brings_the_axis_back():
        with Line("axis-01", program="my_plc.py") as line:
            axis = line.drive("axis-01")
            line.wait_until(lambda: axis.state == "S4", within=5)
            with axis.inject("drive-fault", fault=702, count=1):
                line.wait_until(lambda: axis.fault == 702, within=0.1)
            line.wait_until(lambda: axis.state == "S4", within=2)

A :class:`Rig` is the same for a farm on a real link, or one that runs already.

With pytest, the fixture ``pnfarm_farm`` makes lines and closes them,
and ``pnfarm_rig`` is the rig that ``--pnfarm-rig`` names (docs/testing.md).
"""

from __future__ import annotations

from pnfarm.farm.wait import NotInTime
from pnfarm.testing.device import Device
from pnfarm.testing.drive import Drive, FaultReading
from pnfarm.testing.fault import Fault
from pnfarm.testing.line import Line
from pnfarm.testing.rig import Rig, RigDrive, RigFault
from pnfarm.testing.rig_device import RigDevice

__all__ = ["Device", "Drive", "Fault", "FaultReading", "Line", "NotInTime", "Rig", "RigDevice", "RigDrive", "RigFault"]
