"""Every way in which certificates fail has a sentence of its own, found by a real handshake with a real car session."""

import asyncio
import socket
from datetime import UTC, datetime, timedelta

import pytest

from wallride.clients.keys.authority import Authority
from wallride.clients.keys.diagnosis import nothing_heard, why_refused
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder, now = tmp_path_factory.mktemp("keys"), datetime.now(UTC)
    then = now - timedelta(days=40)
    ours, theirs = Authority.make("car1", then), Authority.make("car2", now)
    authority = Authority(ours)
    pairs = {
        "ca": ours,
        "other-ca": theirs,
        "car": authority.certify_car("car1", ["localhost"], now, 365),
        "old-car": authority.certify_car("car1", ["localhost"], then, 30),
        "early-car": authority.certify_car("car1", ["localhost"], now + timedelta(days=9), 30),
        "alice": authority.certify_person("alice", "operator", now, 365),
        "old-alice": authority.certify_person("alice", "operator", then, 30),
        "stranger": Authority(theirs).certify_person("alice", "operator", now, 365),
    }
    for name, pair in pairs.items():
        (folder / f"{name}.pem").write_bytes(pair.certificate_pem)
        (folder / f"{name}.key").write_bytes(pair.key_pem)
    return folder


def tls(folder, name, authority="ca"):
    return Tls(folder / f"{authority}.pem", folder / f"{name}.pem", folder / f"{name}.key")


def guarded_endpoint(host="localhost"):
    return free_endpoint().replace("tcp/127.0.0.1", f"tls/{host}")


@pytest.mark.parametrize(
    ("car", "person", "authority", "host", "sentence"),
    [
        ("car", "alice", "ca", "localhost", "certificates are in order"),
        ("car", "alice", "ca", "127.0.0.1", r"does not go by the name 127\.0\.0\.1.*--san 127\.0\.0\.1"),
        ("old-car", "alice", "ca", "localhost", r"the car's certificate has expired.*init --renew"),
        ("early-car", "alice", "ca", "localhost", r"not valid yet.*clock"),
        ("car", "old-alice", "ca", "localhost", "your certificate has expired"),
        ("car", "stranger", "ca", "localhost", "your keys are for another car"),
        ("car", "stranger", "other-ca", "localhost", "is not the car that your keys are for"),
        ("car", "car", "ca", "localhost", "not a person's certificate"),
    ],
)
async def test_each_failure_has_its_sentence(keys, car, person, authority, host, sentence):
    endpoint = guarded_endpoint(host)
    bus = Bus(car_config([endpoint], tls(keys, car), [Person("alice", Role.OPERATOR)], "car1"))
    await bus.open()
    try:
        said = await asyncio.to_thread(why_refused, endpoint, tls(keys, person, authority))
    finally:
        await bus.close()
    with pytest.raises(AssertionError, match=sentence):
        raise AssertionError(said)
    assert "\n" not in said


def test_places_where_nobody_answers(keys):
    closed = guarded_endpoint()
    assert "nothing listens" in why_refused(closed, tls(keys, "alice"))
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        endpoint = f"tls/127.0.0.1:{silent.getsockname()[1]}"
        assert "no answer" in why_refused(endpoint, tls(keys, "alice"), timeout_s=0.2)


def test_a_name_that_nobody_knows(keys, monkeypatch):
    def unknown(*_):
        raise socket.gaierror(socket.EAI_NONAME, "unknown")

    monkeypatch.setattr(socket, "create_connection", unknown)
    assert "no computer car9.local is known" in why_refused("tls/car9.local:7448", tls(keys, "alice"))


def test_silence_has_its_sentence_too():
    assert "revoked or not listed" in nothing_heard("alice", "tls/car1.local:7448")
