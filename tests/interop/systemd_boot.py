"""A systemd of the tests' own: its processes, mounts, network and control groups are apart from this machine's.

Its root is this machine's with a layer in memory over it, so that nothing that it writes stays.  No unit of the
machine is started.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SYSTEMD = Path("/lib/systemd/systemd")
#: Where the new root has the interpreter, its packages and this checkout: the service sees no home.
PYTHON, PACKAGES, CHECKOUT = "/opt/python", "/opt/packages", "/opt/checkout"
#: Arguments: a folder for the layer, the control group's file system, this interpreter, its packages, the checkout.
BOOT = r"""
set -eu
work=$1
mount --make-rprivate /
mount -t tmpfs tmpfs "$work"
mkdir "$work/upper" "$work/work" "$work/root"
cd "$work/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/work" "$work/root"
cd "$work/root"
mount -t proc proc proc
mount -t sysfs sysfs sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mount -o remount,ro sys
mount --bind proc/sys proc/sys
mount -o remount,ro,bind proc/sys
for place in run tmp; do mount -t tmpfs tmpfs $place; done
mount -t tmpfs -o mode=755 tmpfs dev
for device in null zero full random urandom tty; do touch dev/$device; mount --bind /dev/$device dev/$device; done
mkdir dev/pts dev/shm
mount -t devpts devpts dev/pts -o newinstance,ptmxmode=0666
ln -s pts/ptmx dev/ptmx
ln -s /proc/self/fd dev/fd
for pair in "$2:opt/python" "$3:opt/packages" "$4:opt/checkout"; do
  mkdir -p "${pair#*:}"
  mount --bind "${pair%%:*}" "${pair#*:}"
done
rm -rf etc/systemd/system etc/pnfarm
mkdir -p etc/systemd/system etc/pnfarm opt/pnfarm/bin
cp "$5" etc/systemd/system/
printf '[Unit]\nDefaultDependencies=no\n' > etc/systemd/system/nothing.target
grep -q '^pnfarm:' etc/passwd || echo 'pnfarm:x:8702:8702::/var/lib/pnfarm:/usr/sbin/nologin' >> etc/passwd
grep -q '^pnfarm:' etc/group || echo 'pnfarm:x:8702:' >> etc/group
mkdir old
pivot_root . old
umount -l /old
rmdir /old
ip link set lo up
export container=tests
exec /lib/systemd/systemd --system --log-target=console --unit=nothing.target > /run/log 2>&1
"""
#: The program of the unit: the interpreter, with its packages and the checkout.
PROGRAM = f"""\
#!{PYTHON}/bin/python3 -IS
import sys
sys.path[:0] = ["{CHECKOUT}", "{PACKAGES}"]
"""


def why_not() -> str:
    """Why this machine cannot boot one; empty if it can."""
    if os.geteuid() != 0:
        return "a systemd of its own needs root"
    if not SYSTEMD.exists():
        return "systemd is not installed (apt-get install systemd)"
    return "" if control_groups() else "no file system of control groups, version 2, is mounted"


def control_groups() -> Path | None:
    """Where this machine has mounted control groups of version 2."""
    lines = [line.split() for line in Path("/proc/self/mounts").read_text("ascii").splitlines()]
    return next((Path(line[1]) for line in lines if line[2] == "cgroup2"), None)


class Boot:
    """A running systemd; :meth:`close` leaves nothing."""

    def __init__(self, folder: Path, unit: Path) -> None:
        base = control_groups()
        assert base is not None
        self._group = base / f"pnfarm-test-{os.getpid()}"
        self._group.mkdir()
        # the packages' folder holds no interpreter of its own
        packages = sysconfig.get_paths()["purelib"]
        join = f'echo $$ > "{self._group}/cgroup.procs" && exec unshare -m -p -f -u -i -n -C --kill-child sh -c "$@"'
        self._process = subprocess.Popen(
            ["sh", "-c", join, "sh", BOOT, "sh", folder, sys.base_prefix, packages, ROOT, unit],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        try:
            self.eventually(lambda: self.run("systemctl", "is-active", "nothing.target").returncode == 0)
        except BaseException:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """The first process, as this machine counts; 0 before it is there."""
        children = Path(f"/proc/{self._process.pid}/task/{self._process.pid}/children").read_text("ascii").split()
        return int(children[0]) if children else 0

    def run(self, *command: object, timeout: float = 60) -> subprocess.CompletedProcess[str]:
        """A command of this machine beside the systemd, as root."""
        inside = ["nsenter", "-t", str(self.pid), "-m", "-p", "-u", "-i", "-n", "-C", "--", *map(str, command)]
        return subprocess.run(inside, capture_output=True, text=True, check=False, timeout=timeout)

    def done(self, *command: object, timeout: float = 60) -> str:
        """What a command that must succeed printed."""
        run = self.run(*command, timeout=timeout)
        assert run.returncode == 0, f"{command}: {run.stdout}{run.stderr}"
        return run.stdout

    def eventually(self, what, seconds: float = 60.0):
        """``what()`` once it is true."""
        deadline = time.monotonic() + seconds
        while not (found := self._process.poll() is None and what()):
            if self._process.poll() is not None:
                raise AssertionError(f"it ended: {self._process.stderr.read()}")
            assert time.monotonic() < deadline, (
                f"not within {seconds} s: {self.run('tail', '-n', 30, '/run/log').stdout}"
            )
            time.sleep(0.1)
        return found

    def write(self, path: str, text: str, mode: int = 0o644) -> None:
        """A file in its root."""
        target = Path(f"/proc/{self.pid}/root{path}")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, "utf-8")
        target.chmod(mode)

    def copy(self, source: Path, path: str, owner: int) -> None:
        """A folder into its root, as one of its users."""
        target = Path(f"/proc/{self.pid}/root{path}")
        shutil.copytree(source, target, dirs_exist_ok=True)
        self.done("chown", "-R", f"{owner}:{owner}", path)

    def close(self) -> None:
        """End everything in it."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait(30)
        if self._process.stderr is not None:
            self._process.stderr.close()
        deadline = time.monotonic() + 30
        while self._group.exists():
            with contextlib.suppress(OSError):
                for group in sorted(self._group.rglob("*/"), reverse=True):
                    group.rmdir()
                self._group.rmdir()
            assert time.monotonic() < deadline, f"{self._group} is still used"
            # the kernel frees a group when its last process is gone, and reports it to nobody
            time.sleep(0.05)
