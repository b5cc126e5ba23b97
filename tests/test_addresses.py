"""Addresses of the channels."""

from netboard.base.tables.rig import Network
from netboard.network.transport import authenticator, channels


def test_channels_have_consecutive_ports() -> None:
    where = channels.addresses(Network(host="10.0.0.1", bind="0.0.0.0", port=6000))
    assert where.listen(channels.MOTION).address == "tcp://0.0.0.0:6000"
    assert where.reach(channels.CONTROL).address == "tcp://10.0.0.1:6004"
    assert {channels.VIEW["left"], channels.VIEW["right"]} == {2, 3}
    assert len(channels.CHANNELS) == channels.MOVES + 1


def test_moves_channel_is_local_and_has_no_keys() -> None:
    keys = authenticator.Credentials("p" * 40, "s" * 40, "q" * 40)
    where = channels.addresses(Network(host="10.0.0.1", bind="0.0.0.0", port=6000), keys)
    for moves in (where.listen(channels.MOVES), where.reach(channels.MOVES)):
        assert moves == channels.Endpoint("tcp://127.0.0.1:6005", channels.MOVES)
    assert where.reach(channels.LOG).lock is keys
    assert "ssss" not in repr(keys)


def test_pointer_and_force_channels_are_local_and_use_no_port() -> None:
    keys = authenticator.Credentials("p" * 40, "s" * 40, "q" * 40)
    for transport in ("tcp", "ipc"):
        network = Network(host="10.0.0.1", bind="0.0.0.0", port=6000, transport=transport)  # type: ignore[arg-type]
        where = channels.addresses(network, keys)
        ends = [end(side) for end in (where.pointer, where.felt) for side in ("left", "right")]
        assert all(end.address.startswith("ipc:///tmp/netboard-") and end.lock is None for end in ends)
        assert len({end.address for end in ends}) == 4
