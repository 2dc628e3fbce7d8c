"""p-net's sample application (RT-Labs, C) as a process in the farm's namespace.

``PNFARM_PNET`` names its program ``pn_dev``; ``PNFARM_PNET_GSDML`` its GSDML file.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from interop_rig import HERE

PROGRAM = Path(os.environ.get("PNFARM_PNET", ""))
GSDML = Path(os.environ.get("PNFARM_PNET_GSDML", ""))
NAME = "rt-labs-dev"
#: What the program calls to set its address, and its lamps: 1 its own, 2 PROFINET's signal.
SCRIPTS = {
    "set_network_parameters": 'ip address flush dev "$1"; ip address add "$2/$3" dev "$1"; ip link set dev "$1" up\n',
    "set_profinet_leds": 'echo "$2" > "lamp$1"\n',
}
here = pytest.mark.skipif(
    not (os.access(PROGRAM, os.X_OK) and PROGRAM.is_file() and GSDML.is_file()),
    reason="PNFARM_PNET and PNFARM_PNET_GSDML do not name p-net's pn_dev and its GSDML file",
)


class PnetDevice:
    """The program in the farm's namespace, with its own network card, its buttons and its lamps."""

    def __init__(self, lab, folder, program=PROGRAM):
        self.folder = folder
        shutil.copy(program, folder / "pn_dev")
        for name, text in SCRIPTS.items():
            path = folder / name
            path.write_text("#!/bin/sh\n" + text, encoding="utf-8")
            path.chmod(0o755)
        self.button("1", pressed=False)
        self.button("2", pressed=False)
        self._cable = lab.start(
            "farm", sys.executable, HERE / "peer_cable.py", "card0", "nic0",
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            assert self._cable.stdout.readline() == "up\n"
            self._log = (folder / "log").open("w", encoding="utf-8")
            self._process = lab.start(
                "farm",
                folder / "pn_dev", "-i", "card0", "-s", NAME, "-p", folder, "-b", folder / "1", "-d", folder / "2",
                cwd=folder, stdout=self._log, stderr=self._log,
            )  # fmt: skip
        except BaseException:
            self._unplug()
            raise

    def button(self, number, *, pressed):
        (self.folder / number).write_text("1" if pressed else "0", encoding="utf-8")

    def press(self, number):
        for pressed in (True, False):
            self.button(number, pressed=pressed)
            time.sleep(0.2)  # it looks at its buttons every 10 ms

    def lamp(self, number):
        path = self.folder / f"lamp{number}"
        return path.exists() and path.read_text(encoding="utf-8").strip() == "1"

    @property
    def ended(self):
        return self._process.poll() is not None

    def stop_for(self, seconds):
        self._process.send_signal(subprocess.signal.SIGSTOP)
        try:
            # the device is stopped for so long: that is the fault
            time.sleep(seconds)
        finally:
            self._process.send_signal(subprocess.signal.SIGCONT)

    def _unplug(self):
        self._cable.stdin.close()
        self._cable.wait(10)
        self._cable.stdout.close()

    def close(self):
        self._process.terminate()
        self._process.wait(10)
        self._log.close()
        self._unplug()
