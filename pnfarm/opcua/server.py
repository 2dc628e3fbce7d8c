"""The server of one farm, in an event loop of its own."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from asyncua import ua

from pnfarm.errors import EnvironmentError_
from pnfarm.opcua.access import Access, password_of
from pnfarm.opcua.limits import MOST_OPERATIONS, BoundedInternalServer, BoundedServer
from pnfarm.opcua.nodes import NAMESPACE, FarmNodes
from pnfarm.opcua.points import FarmPoints
from pnfarm.opcua.session import FarmSession
from pnfarm.version import __version__
from pnfarm.vocabulary.endpoints import host_port

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

    from pnfarm.config.opcua import OpcUa
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.opcua.carrier import Carrier

__all__ = ["FarmServer"]

#: Those that sign and encrypt; none on loopback without a certificate.
_ENCRYPTED = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]
_LIMITED = (
    *(f"MaxNodesPer{each}" for each in ("Read", "Write", "Browse", "TranslateBrowsePathsToNodeIds", "MethodCall")),
    "MaxMonitoredItemsPerCall",
)


class FarmServer:
    """``found`` listens already.  :meth:`prepare` it, and :meth:`run` it in a loop that is not the farm's."""

    def __init__(self, config: FarmConfig, section: OpcUa, found: socket.socket) -> None:
        host, port = found.getsockname()[:2]
        self.url = f"opc.tcp://{host_port(host, port)}"
        self._config = config
        self._section = section
        self._found = found
        self._name = config.farm or "farm"
        self._access = Access(section, password_of(config, section))
        # a class of this server's own: what its sessions need is the class's
        self._session: Any = type("_Session", (FarmSession,), {})
        self._server = BoundedServer(found, BoundedInternalServer(self._access, self._session))
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stopped: asyncio.Event | None = None
        self._stopping = False

    def stop(self) -> None:
        """End :meth:`run`; from any thread."""
        self._stopping = True
        if self._loop is not None and self._stopped is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._stopped.set)

    async def prepare(self) -> None:
        """Make the address space of the standard; raises :class:`EnvironmentError_` for files that cannot be used."""
        server = self._server
        await self._secure()
        await server.init()
        server.set_endpoint(self.url)
        server.set_server_name(f"pnfarm {self._name}")
        await server.set_application_uri(f"urn:pnfarm:{self._name}")
        await server.set_build_info("urn:pnfarm", "pnfarm", "pnfarm", __version__, "", datetime.now(UTC))
        limit = ua.Variant(MOST_OPERATIONS, ua.VariantType.UInt32)
        for what in _LIMITED:
            number = getattr(ua.ObjectIds, f"Server_ServerCapabilities_OperationLimits_{what}")
            await server.get_node(ua.NodeId(number)).write_value(limit)

    async def run(self, farm: Farm, carrier: Carrier, up: Callable[[], object]) -> None:
        """Serve until it is stopped; ``up`` is called when clients may come."""
        self._stopped, self._loop = asyncio.Event(), asyncio.get_running_loop()
        server, session, interval_ns = self._server, self._session, self._section.interval_ns
        try:
            points = FarmPoints(farm.core, farm.now, farm.poke)
            nodes = FarmNodes(server, await server.register_namespace(NAMESPACE), points, carrier, interval_ns)
            await nodes.make(self._name)
            session.nodes, session.points, session.carrier = nodes, points, carrier
            session.access, session.interval_ms = self._access, interval_ns / 1e6
            await server.start()
            refreshing, stopping = asyncio.create_task(nodes.run()), asyncio.create_task(self._stopped.wait())
            try:
                up()
                if not self._stopping:
                    await asyncio.wait({refreshing, stopping}, return_when=asyncio.FIRST_COMPLETED)
                if refreshing.done():
                    refreshing.result()
            finally:
                refreshing.cancel()
                stopping.cancel()
                await server.stop()
        finally:
            self._found.close()

    async def _secure(self) -> None:
        section, server = self._section, self._server
        policies = [ua.SecurityPolicyType.NoSecurity] if section.is_loopback else []
        if section.certificate is not None and section.key is not None:
            for key, name, load in (
                ("certificate", section.certificate, server.load_certificate),
                ("key", section.key, server.load_private_key),
            ):
                file = self._config.beside(name)
                try:
                    await load(file)
                except (ValueError, TypeError, OSError) as exc:
                    raise EnvironmentError_(f"opcua.{key}: {file} cannot be used: {exc}") from exc
            policies += _ENCRYPTED
        server.set_security_policy(policies)
        anonymous: list[type] = [ua.AnonymousIdentityToken] if self._access.anonymous else []
        server.set_identity_tokens([*anonymous, ua.UserNameIdentityToken] if section.user else anonymous)
