"""Several Docker engines as a swarm, each in a network namespace of its own: machines with a management card and one on
the fieldbus, at two switches, which are bridges in one more namespace.
"""

import contextlib
import os
import shutil
import signal
import subprocess
from pathlib import Path

from rig_engine import ROOT, Engine, run

#: Networks of the stack on a node: the management card is eth0, the fieldbus's is eth1.
MANAGEMENT, FIELDBUS = "10.99.0.{}", "10.77.0.0/16"
SWITCHES = ("mgmt", "wire")


class Node(Engine):
    """A machine: an engine in a namespace with two cards.  ``number`` from 1."""

    def __init__(self, folder, prefix, number):
        super().__init__(folder)
        self.number = number
        self.name = f"node-{number}"
        self.space = f"{prefix}n{number}"
        self.switch = f"{prefix}sw"
        self.address = MANAGEMENT.format(10 + number)

    def plug(self):
        """Namespace and cards."""
        run("ip", "netns", "add", self.space)
        self.inside("ip", "link", "set", "lo", "up")
        for place, switch in enumerate(SWITCHES):
            port = f"{switch}{self.number}"
            run(
                "ip", "link", "add", f"eth{place}", "netns", self.space, "type", "veth",
                "peer", "name", port, "netns", self.switch,
            )  # fmt: skip
            run("ip", "-n", self.switch, "link", "set", port, "master", switch, "up")
            self.inside("ip", "link", "set", f"eth{place}", "up")
        self.inside("ip", "address", "add", f"{self.address}/24", "dev", "eth0")

    def cable(self, switch, state):
        """Pull (``down``) or plug (``up``) the cable at one switch."""
        run("ip", "-n", self.switch, "link", "set", f"{switch}{self.number}", state)

    def command(self):
        return [
            "nsenter", f"--net=/var/run/netns/{self.space}", "unshare", "--uts", "sh", "-c",
            f'hostname {self.name} && exec "$@"', "sh",
            "dockerd", "--bridge=none", "--data-root", f"{self.folder}/data", "--exec-root", f"{self.folder}/exec",
            "-p", f"{self.folder}/pid", "-H", f"unix://{self.folder}/sock",
        ]  # fmt: skip

    def start(self):
        self.launch(self.command())

    def kill(self):
        """The engine ends without a word; its containers and their supervisors go on running."""
        os.kill(int((self.folder / "pid").read_text()), signal.SIGKILL)
        self._process.wait(10)

    def crash(self):
        """The whole machine: both cables, then every process."""
        for switch in SWITCHES:
            self.cable(switch, "down")
        self.kill()
        self._kill_supervisors()

    def revive(self):
        """The machine starts again, its cables plugged."""
        for switch in SWITCHES:
            self.cable(switch, "up")
        self.start()

    def _kill_supervisors(self):
        """containerd and the shims of this engine, with what they supervise."""
        supervisors = []
        for place in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                words = (place / "cmdline").read_bytes().split(b"\0")
                if b"containerd" in words[0] and f"{self.folder}/".encode() in b" ".join(words):
                    supervisors.append(int(place.name))
        for process in supervisors:
            with contextlib.suppress(OSError):
                for task in Path(f"/proc/{process}/task").iterdir():
                    for child in (task / "children").read_text().split():
                        with contextlib.suppress(ProcessLookupError):
                            os.kill(int(child), signal.SIGKILL)
        for process in supervisors:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def inside(self, *command, timeout=60):
        return run("nsenter", f"--net=/var/run/netns/{self.space}", *command, timeout=timeout, cwd=ROOT)

    @property
    def alive(self):
        return self._process is not None and self._process.poll() is None

    def containers(self, service):
        """The running containers of a service on this node."""
        return self.docker("ps", "-q", "--filter", f"label=com.docker.swarm.service.name={service}").split()

    def close(self):
        # nothing of it is wanted any more: containers need no time to stop
        if self.alive:
            self.kill()
        self._process = None
        self._kill_supervisors()
        try:
            super().close()
        finally:
            subprocess.run(["ip", "netns", "del", self.space], check=False, capture_output=True)


class Swarm:
    """``count`` nodes with the images of ``images``, an engine's folder; node 1 is the manager and the base."""

    def __init__(self, folder, images, count=3):
        self.folder = folder
        self.images = images
        self.prefix = f"pf{os.getpid()}"
        self.nodes = [Node(folder / f"{number}", self.prefix, number) for number in range(1, count + 1)]
        self.manager = self.nodes[0]
        self.switch = f"{self.prefix}sw"

    def up(self):
        run("ip", "netns", "add", self.switch)
        for switch in SWITCHES:
            run("ip", "-n", self.switch, "link", "add", switch, "type", "bridge")
            run("ip", "-n", self.switch, "link", "set", switch, "up")
        run("ip", "-n", self.switch, "address", "add", f"{MANAGEMENT.format(1)}/24", "dev", "mgmt")
        for node in self.nodes:
            node.folder.mkdir(parents=True)
            run("cp", "-a", "--reflink=auto", self.images / "data", node.folder / "data")
            node.plug()
            node.start()
        self.manager.docker("swarm", "init", "--advertise-addr", self.manager.address)
        token = self.manager.docker("swarm", "join-token", "-q", "worker").strip()
        for node in self.nodes[1:]:
            node.docker(
                "swarm", "join", "--advertise-addr", node.address, "--token", token, f"{self.manager.address}:2377"
            )
        ids = {}
        for node in self.nodes:
            ids[node.number] = node.docker("info", "-f", "{{.Swarm.NodeID}}").strip()
            self.manager.docker("node", "update", "--label-add", "pnfarm.farm=true", ids[node.number])
            node.docker(
                "network", "create", "--config-only", "--subnet", FIELDBUS,
                "--ip-range", f"10.77.255.{16 * node.number}/28", "--gateway", "10.77.255.254", "-o", "parent=eth1",
                "pnfarm_card",
            )  # fmt: skip
        self.ids = ids
        self.manager.docker("node", "update", "--label-add", "pnfarm.base=true", ids[1])
        self.manager.docker(
            "network",
            "create",
            "--driver",
            "macvlan",
            "--scope",
            "swarm",
            "--config-from",
            "pnfarm_card",
            "pnfarm_wire",
        )

    def secret(self, name, value):
        self.manager.docker("secret", "create", name, "-", input=value)

    def deploy(self, name="pnfarm"):
        # the images are on every node: there is no registry to ask
        self.manager.docker("stack", "deploy", "--resolve-image", "never", "-c", "compose.swarm.yaml", name)

    def hub(self, *command, timeout=60):
        """Run a command in the hub's container, wherever that is."""
        for node in self.nodes:
            if node.alive and (found := node.containers("pnfarm_hub")):
                return node.docker("exec", "-i", found[0], *command, timeout=timeout)
        raise AssertionError("no node runs the hub")

    def close(self):
        with contextlib.ExitStack() as stack:
            stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
            stack.callback(subprocess.run, ["ip", "netns", "del", self.switch], check=False, capture_output=True)
            for node in self.nodes:
                stack.callback(node.close)
