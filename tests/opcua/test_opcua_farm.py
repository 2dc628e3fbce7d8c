"""A farm in real time, in memory, as clients of OPC UA see it."""

import asyncio
import contextlib
import socket
import time
from functools import partial
from urllib.parse import urlsplit

import pytest

asyncua = pytest.importorskip("asyncua")

from asyncua import Client, ua  # noqa: E402 - behind importorskip
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256  # noqa: E402 - behind importorskip
from asyncua.ua.uaerrors import UaStatusCodeError  # noqa: E402 - behind importorskip
from opcua_farm import PASSWORD, USER, certify, opcua_farm  # noqa: E402 - behind importorskip

from pnfarm.opcua import limits, session  # noqa: E402 - behind importorskip
from pnfarm.opcua.points import FarmPoints  # noqa: E402 - behind importorskip

#: The farm is made once for the file.
KEEPS_FIXTURES = True


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("opcua")


@pytest.fixture(scope="module")
def farm(folder):
    certificate, key = certify(folder, "urn:pnfarm:opcua-cell")
    section = (
        f"{{listen: '127.0.0.1:0', interval: 20ms, user: {USER}, password: {PASSWORD}, "
        f"certificate: {certificate.name}, key: {key.name}}}"
    )
    with opcua_farm(section, folder / "cell.pnfarm.yml") as running:
        yield running


@contextlib.asynccontextmanager
async def client_of(farm, user=None, password=PASSWORD):
    client = Client(farm.url)
    if user is not None:
        client.set_user(user)
        client.set_password(password)
    async with client:
        yield client


def node(client, name):
    return client.get_node(f"ns=2;s={name}")


async def status_of(client, name):
    return (await node(client, name).read_data_value(raise_on_bad_status=False)).StatusCode.name


async def write_status(client, name, value):
    try:
        await node(client, name).write_value(value)
    except UaStatusCodeError as error:
        return type(error).__name__
    return "Good"


async def until(found, wanted, seconds=5.0):
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        if (last := await found()) == wanted:
            return
        await asyncio.sleep(0.02)
    assert last == wanted


class Notified:
    def __init__(self):
        self.values = []

    def datachange_notification(self, changed, value, _):
        self.values.append((changed.nodeid.Identifier, value))

    def of(self, name):
        return [value for each, value in self.values if each == name]


@pytest.mark.asyncio
async def test_a_client_finds_drives_devices_and_the_plant_by_browsing(farm):
    async with client_of(farm) as client:
        path = ["0:Objects", "2:Farm", "2:opcua-cell"]
        cell = await client.nodes.root.get_child(path)
        assert [(await each.read_browse_name()).Name for each in await cell.get_children()] == [
            "Drives",
            "Devices",
            "Plant",
        ]
        for owner, signal in (("Drives/axis-01", "velocity"), ("Devices/island-1", "valve"), ("Plant/tank", "input")):
            found = await client.nodes.root.get_child([*path, *(f"2:{each}" for each in owner.split("/"))])
            names = [(await each.read_browse_name()).Name for each in await found.get_children()]
            assert signal in names
            last = await client.nodes.root.get_child([*path, *(f"2:{n}" for n in owner.split("/")), f"2:{signal}"])
            assert last.nodeid.to_string() == f"ns=2;s={owner.rpartition('/')[2]}.{signal}"


@pytest.mark.asyncio
async def test_a_value_has_the_type_the_unit_and_the_time_of_its_signal(farm):
    async with client_of(farm) as client:
        for name, kind in (
            ("axis-01.velocity", "Double"),
            ("axis-01.state", "String"),
            ("axis-01.fault", "UInt32"),
            ("axis-01.zsw1", "UInt16"),
            ("axis-01.zsw1.fault_present", "Boolean"),
            ("island-1.part_present", "Boolean"),
            ("island-1.slot3_value_1", "Int16"),
            ("island-1.pressure", "Double"),
            ("gripper.position", "Double"),
        ):
            value = await node(client, name).read_data_value()
            assert (name, value.Value.VariantType.name) == (name, kind)
            assert await node(client, name).read_data_type_as_variant_type() == value.Value.VariantType
            age = time.time() - value.SourceTimestamp.timestamp()
            assert -1 < age < 5
        unit = await (await node(client, "axis-01.velocity").get_child("0:EngineeringUnits")).read_value()
        # RPM of UN/ECE recommendation 20
        assert (unit.DisplayName.Text, unit.UnitId) == ("rpm", 0x52504D)
        unit = await (await node(client, "island-1.pressure").get_child("0:EngineeringUnits")).read_value()
        assert unit.DisplayName.Text == "bar"


@pytest.mark.asyncio
async def test_a_subscriber_sees_a_drive_move_and_an_input_change(farm):
    async with client_of(farm, USER) as client:
        await until(node(client, "axis-01.in_operation").read_value, True)
        seen = Notified()
        subscription = await client.create_subscription(20, seen)
        names = ("axis-01.position", "island-1.part_present")
        await subscription.subscribe_data_change([node(client, name) for name in names])
        await asyncio.sleep(0.3)
        await node(client, names[1]).write_value(True)
        await asyncio.sleep(0.3)
        await node(client, names[1]).write_value(False)
        await asyncio.sleep(0.3)
        positions = seen.of(names[0])
        assert len(positions) > 5
        assert positions == sorted(positions)
        assert seen.of(names[1]) == [False, True, False]


@pytest.mark.asyncio
async def test_what_nobody_asks_for_is_not_read_from_the_farm(farm, monkeypatch):
    asked = []
    read = FarmPoints.read
    monkeypatch.setattr(FarmPoints, "read", lambda self, names: asked.extend(names) or read(self, names))
    async with client_of(farm) as client:
        subscription = await client.create_subscription(20, Notified())
        handle = await subscription.subscribe_data_change(node(client, "axis-01.torque"))
        await asyncio.sleep(0.2)
        assert set(asked) == {"axis-01.torque"}
        assert len(asked) > 3
        await subscription.unsubscribe(handle)
        await asyncio.sleep(0.1)
        asked.clear()
        await asyncio.sleep(0.2)
        assert asked == []
        # within the interval a value is read once, however often it is asked for
        await asyncio.gather(*(node(client, "axis-01.torque").read_value() for _ in range(10)))
        assert len(asked) < 10


@pytest.mark.asyncio
async def test_the_writing_user_sets_inputs_of_devices_and_free_inputs_of_the_plant(farm):
    async with client_of(farm, USER) as client:
        await node(client, "island-1.pressure").write_value(6.5)
        assert await node(client, "island-1.pressure").read_value() == 6.5
        assert farm.call(farm.farm.core.device("island-1").signals.owner, "pressure") == "value"
        await node(client, "tank.input").write_value(3.0)
        await until(lambda: _rounded(client, "tank.value"), 6.0)
        await node(client, "tank.input").write_value(0.0)
    assert "signals written by a client" in farm.events()


async def _rounded(client, name):
    return round(await node(client, name).read_value(), 3)


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        ("island-1.valve", True, "BadNotWritable"),
        ("gripper.extend", True, "BadNotWritable"),
        ("axis-01.velocity", 1.0, "BadNotWritable"),
        ("gripper", 1.0, "BadNotWritable"),
        ("island-1.pressure", 7, "BadTypeMismatch"),
        ("island-1.pressure", [7.0], "BadTypeMismatch"),
        ("island-1.pressure", 1e9, "BadOutOfRange"),
        ("island-1.pressure", float("nan"), "BadOutOfRange"),
        ("island-1.nothing", 1.0, "BadNodeIdUnknown"),
        ("axis-02.velocity", 1.0, "BadNodeIdUnknown"),
    ],
)
@pytest.mark.asyncio
async def test_a_write_that_is_refused_says_why(farm, name, value, status):
    async with client_of(farm, USER) as client:
        before = await node(client, "island-1.pressure").read_value()
        assert await write_status(client, name, value) == status
        assert await node(client, "island-1.pressure").read_value() == before


@pytest.mark.asyncio
async def test_what_a_user_forces_stays_and_a_written_value_waits_behind_it(farm):
    async with client_of(farm, USER) as client:
        await node(client, "island-1.part_present").write_value(False)
        farm.force("island-1", {"part_present": True})
        written = ua.WriteValue()
        written.NodeId, written.AttributeId = ua.NodeId("island-1.part_present", 2), ua.AttributeIds.Value
        written.Value = ua.DataValue(ua.Variant(False, ua.VariantType.Boolean))
        (status,) = await client.uaclient.write(ua.WriteParameters(NodesToWrite=[written]))
        assert status.name == "GoodCompletesAsynchronously"
        await until(node(client, "island-1.part_present").read_value, True)
        farm.force("island-1", {"*": None})
        await until(node(client, "island-1.part_present").read_value, False)


@pytest.mark.asyncio
async def test_others_on_this_machine_may_read_and_not_write(farm):
    async with client_of(farm) as client:
        assert await write_status(client, "island-1.part_present", True) == "BadUserAccessDenied"
        assert await node(client, "island-1.part_present").read_value() is False
        allowed = await node(client, "island-1.part_present").get_user_access_level()
        assert allowed == {ua.AccessLevel.CurrentRead}
    async with client_of(farm, USER) as client:
        allowed = await node(client, "island-1.part_present").get_user_access_level()
        assert ua.AccessLevel.CurrentWrite in allowed


@pytest.mark.parametrize(("user", "password"), [(USER, "another-secret"), ("nobody", PASSWORD), (USER, "")])
@pytest.mark.asyncio
async def test_a_wrong_password_lets_nobody_in(farm, user, password):
    with pytest.raises(UaStatusCodeError):
        async with client_of(farm, user, password):
            pytest.fail("let in")


@pytest.mark.asyncio
async def test_a_channel_can_be_encrypted(farm, folder):
    certificate, key = certify(folder, "urn:tester")
    client = Client(farm.url)
    client.application_uri = "urn:tester"
    client.set_user(USER)
    client.set_password(PASSWORD)
    await client.set_security(SecurityPolicyBasic256Sha256, certificate, key)
    async with client:
        assert await write_status(client, "island-1.part_present", False) == "Good"


@pytest.mark.asyncio
async def test_a_drive_without_power_has_bad_values(farm):
    async with client_of(farm) as client:
        seen = Notified()
        subscription = await client.create_subscription(20, seen)
        await subscription.subscribe_data_change(node(client, "axis-01.powered"))
        farm.call(farm.farm.inject, {"kind": "power-cycle", "on": "axis-01", "params": {"off": "1s"}})
        await until(lambda: status_of(client, "axis-01.velocity"), "BadOutOfService")
        assert await node(client, "axis-01.state").read_value() == "off"
        await until(lambda: status_of(client, "axis-01.velocity"), "Good")
        assert False in seen.of("axis-01.powered")


@pytest.mark.asyncio
async def test_nobody_guesses_the_session_of_another_client(farm):
    async with client_of(farm, USER) as writer:
        stranger = Client(farm.url)
        await stranger.connect_socket()
        await stranger.send_hello()
        await stranger.open_secure_channel()
        for number in range(1000, 1100):
            stranger.uaclient.session.restore_authentication_token(ua.NodeId(number))
            with pytest.raises(UaStatusCodeError):
                await stranger.activate_session()
        assert await write_status(writer, "island-1.part_present", False) == "Good"
        stranger.disconnect_socket()


@pytest.mark.asyncio
async def test_a_subscription_is_its_own_client_s_alone(farm):
    async with client_of(farm) as client, client_of(farm) as other:
        seen = Notified()
        subscription = await client.create_subscription(20, seen)
        await subscription.subscribe_data_change(node(client, "axis-01.cycle"))
        await until(lambda: _counted(seen), 1)
        number = subscription.subscription_id
        (status,) = await other.uaclient.delete_subscriptions([number])
        assert status.name == "BadSubscriptionIdInvalid"
        with pytest.raises(UaStatusCodeError, match="BadServiceUnsupported"):
            await other.uaclient.transfer_subscriptions(ua.TransferSubscriptionsParameters(SubscriptionIds=[number]))
        theirs = await other.create_subscription(20, Notified())
        theirs.subscription_id = number
        with pytest.raises(UaStatusCodeError):
            await theirs.subscribe_data_change(node(other, "axis-01.position"))
        await subscription.subscribe_data_change(node(client, "axis-01.powered"))
        await until(lambda: _counted(seen), 2)


async def _counted(seen):
    return len(seen.values)


@pytest.mark.asyncio
async def test_a_client_that_asks_for_too_much_is_refused(farm):
    async with client_of(farm) as client:
        wanted = [node(client, "axis-01.velocity")] * (limits.MOST_OPERATIONS + 1)
        with pytest.raises(UaStatusCodeError) as refused:
            await client.read_values(wanted)
        assert type(refused.value).__name__ == "BadTooManyOperations"
        subscription = await client.create_subscription(0, Notified())
        # what the client got instead: the farm's interval
        assert subscription.parameters.RequestedPublishingInterval == 20.0
        deadband = ua.DataChangeFilter(DeadbandType=1, DeadbandValue=5.0)
        refused = await subscription._subscribe(  # the public call takes no filter of one's own
            [node(client, "axis-01.velocity")], ua.AttributeIds.Value, mfilter=deadband
        )
        assert refused[0].name == "BadMonitoredItemFilterUnsupported"


async def _until_refused(ask, most):
    """How many were made, and the status of the one that was not."""
    for made in range(most):
        try:
            await ask()
        except UaStatusCodeError as error:
            return made, type(error).__name__
    return most, "Good"


async def _until_a_session(farm, seconds=30):
    """What a client reads that asks again while it is refused."""
    ends = time.monotonic() + seconds
    while True:
        try:
            async with client_of(farm) as client:
                return await node(client, "axis-01.powered").read_value()
        except UaStatusCodeError:
            if time.monotonic() > ends:
                raise
            # who is refused learns of no free place: it asks again
            await asyncio.sleep(0.05)


@pytest.mark.asyncio
async def test_sessions_beyond_their_number_are_refused_and_those_that_nobody_activates_end(farm, monkeypatch):
    monkeypatch.setattr(limits, "MOST_SESSIONS", 4)
    monkeypatch.setattr(limits, "PENDING_SECONDS", 0.5)
    async with client_of(farm) as client:
        greedy = Client(farm.url)
        await greedy.connect_socket()
        await greedy.send_hello()
        await greedy.open_secure_channel()
        assert await _until_refused(greedy.create_session, 10) == (3, "BadTooManySessions")
        assert await node(client, "axis-01.powered").read_value() is True
        # one of those that were not activated ends, and its place is another client's
        assert await _until_a_session(farm) is True
        greedy.disconnect_socket()


@pytest.mark.asyncio
async def test_subscriptions_beyond_their_number_are_refused_and_end_with_their_client(farm):
    for _ in range(2):
        async with client_of(farm) as client:
            ask = partial(client.create_subscription, 3_600_000, Notified())
            made = await _until_refused(ask, 2 * limits.MOST_SUBSCRIPTIONS)
            assert made == (limits.MOST_SUBSCRIPTIONS, "BadTooManySubscriptions")
            assert await node(client, "axis-01.powered").read_value() is True


@pytest.mark.asyncio
async def test_monitored_items_beyond_their_number_are_refused_one_by_one_and_free_again(farm, monkeypatch):
    monkeypatch.setattr(session, "MOST_ITEMS", 5)
    names = ("velocity", "position", "torque", "current", "powered", "connected", "state")
    async with client_of(farm) as client:
        subscription = await client.create_subscription(20, Notified())
        items = [node(client, f"axis-01.{name}") for name in names]
        answers = await subscription.subscribe_data_change(items)
        assert [isinstance(one, int) for one in answers] == [True] * 5 + [False] * 2
        assert {one.name for one in answers[5:]} == {"BadTooManyMonitoredItems"}
        await subscription.unsubscribe(answers[:5])
        assert all(isinstance(one, int) for one in await subscription.subscribe_data_change(items[2:]))


def _socket(farm):
    where = urlsplit(farm.url)
    return socket.create_connection((where.hostname, where.port), 5)


@pytest.mark.asyncio
async def test_garbage_and_many_connections_leave_the_farm_to_others(farm):
    for octets in (b"GET / HTTP/1.0\r\n\r\n", b"MSGF\xff\xff\xff\x7f" + bytes(2 * limits.CHUNK), b"HELF" + bytes(40)):
        with _socket(farm) as raw, contextlib.suppress(ConnectionError):
            raw.sendall(octets)
    with _socket(farm) as raw:
        raw.settimeout(5)
        with contextlib.suppress(ConnectionError):
            raw.sendall(b"MSGF\xff\xff\xff\x7f" + bytes(4 * limits.CHUNK))
            assert raw.recv(1) == b""
    many = [_socket(farm) for _ in range(limits.MOST_CONNECTIONS + 8)]
    try:
        await asyncio.sleep(0.3)
        closed = 0
        for raw in many:
            raw.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                closed += raw.recv(1) == b""
        assert closed >= 8
    finally:
        for raw in many:
            raw.close()
    await asyncio.sleep(0.2)
    async with client_of(farm) as client:
        assert await node(client, "axis-01.powered").read_value() is True


def test_an_independent_client_reads_writes_and_subscribes(farm):
    opcua = pytest.importorskip("opcua")
    client = opcua.Client(farm.url)
    client.set_user(USER)
    client.set_password(PASSWORD)
    client.connect()
    try:
        pressure = client.get_node("ns=2;s=island-1.pressure")
        pressure.set_value(2.5)
        assert pressure.get_value() == 2.5
        assert client.get_node("ns=2;s=axis-01.powered").get_value() is True
        seen = Notified()
        subscription = client.create_subscription(20, seen)
        subscription.subscribe_data_change(client.get_node("ns=2;s=axis-01.position"))
        ends = time.monotonic() + 30
        while len(seen.values) < 3 and time.monotonic() < ends:
            time.sleep(0.02)
        assert len(seen.values) >= 3
        subscription.delete()
    finally:
        client.disconnect()


def test_a_drive_with_the_name_of_another_ones_signal_hides_no_other_signal(monkeypatch):
    names = (
        "{name: a, model: akd-profinet, ip: 10.77.0.21/24}, {name: a.velocity, model: akd-profinet, ip: 10.77.0.22/24}"
    )
    monkeypatch.setattr(
        "opcua_farm.OPCUA_CELL", f"farm: opcua-names\nlink: {{kind: memory}}\napi: off\ndrives: [{names}]\n"
    )

    async def found(farm):
        async with client_of(farm) as client:
            return [await status_of(client, name) for name in ("a.torque", "a.velocity.torque")]

    with opcua_farm("{listen: '127.0.0.1:0'}") as running:
        assert asyncio.run(found(running)) == ["Good", "Good"]


class _Failing:
    """A server that fails while it runs."""

    url = "opc.tcp://127.0.0.1:1"

    async def run(self, farm, carrier, up):
        up()
        await carrier(farm.now)
        raise RuntimeError("broken")

    def stop(self):
        pass


def test_a_server_that_fails_is_an_event_and_the_farm_goes_on():
    with opcua_farm("off", server=_Failing()) as running:
        ends = time.monotonic() + 30
        while "opc ua failed" not in running.events() and time.monotonic() < ends:
            time.sleep(0.02)
        (failed,) = [each.what for each in running.farm.log.entries() if each.event == "opc ua failed"]
        assert failed.reason == "RuntimeError: broken"
        before = running.call(running.farm.now)
        time.sleep(0.05)
        assert running.call(running.farm.now) > before
