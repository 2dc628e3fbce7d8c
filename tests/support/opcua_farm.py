"""A cell that is served over OPC UA while it runs in real time, in a thread of its own."""

import contextlib
from datetime import UTC, datetime, timedelta

import anyio
from anyio.from_thread import start_blocking_portal
from cell_file import CELL

from pnfarm.controller.beside import ControllerBeside
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.opcua import prepare_opcua, serve_opcua
from pnfarm.station.event_log import EventLog

USER, PASSWORD = "scada", "a-long-secret"  # a test's, nobody's
OPCUA_CELL = (
    CELL.replace("farm: cell", "farm: opcua-cell")
    + """
api: off
plant:
  models:
    - {name: gripper, kind: cylinder, time: 300ms}
    - {name: tank, kind: first-order, gain: 2, time_constant: 10ms}
  wires:
    - island-1.valve -> gripper.extend
"""
)


class Served:
    """``call`` runs something in the farm's loop."""

    def __init__(self, farm, url, portal):
        self.farm = farm
        self.url = url
        self.call = portal.call

    def force(self, owner, values):
        """As `pnfarm io --force` does."""
        self.call(self.farm.core.device(owner).signals.force, values)

    def events(self):
        return [entry.event for entry in self.farm.log.entries()]


@contextlib.asynccontextmanager
async def served(text, path=None, server=None):
    farm = Farm(parse_farm(text, path), log=EventLog(quiet=True))
    ControllerBeside(farm, log=EventLog(quiet=True))
    server = server or await prepare_opcua(farm)
    async with farm, anyio.create_task_group() as tasks:
        url = await tasks.start(serve_opcua, farm, server)
        yield farm, url
        tasks.cancel_scope.cancel()


@contextlib.contextmanager
def opcua_farm(section, path=None, server=None):
    """A running cell with this section `opcua`; one with a server of its own has its own name."""
    with start_blocking_portal() as portal:
        text = OPCUA_CELL if server is None else OPCUA_CELL.replace("farm: opcua-cell", "farm: opcua-cell-2")
        running = served(text + f"opcua: {section}\n", path, server)
        with portal.wrap_async_context_manager(running) as (farm, url):
            yield Served(farm, url, portal)


def certify(folder, name):
    """Certificate and key of an application, as two files."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    subject, now = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)]), datetime.now(UTC)
    names = x509.SubjectAlternativeName([x509.UniformResourceIdentifier(name), x509.DNSName("localhost")])
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(names, critical=False)
        .sign(key, hashes.SHA256())
    )
    certificate, secret = folder / f"{name.rpartition(':')[2]}.pem", folder / f"{name.rpartition(':')[2]}.key.pem"
    certificate.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    secret.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return certificate, secret
