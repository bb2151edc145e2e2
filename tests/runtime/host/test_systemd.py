"""sd_notify as systemd hears it."""

import socket

from wallride.runtime.host.systemd import ServiceManager


def test_words_arrive_and_a_status_only_when_it_changes(tmp_path):
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(path)
        systemd.settimeout(1)
        manager = ServiceManager({"NOTIFY_SOCKET": path})
        manager.ready()
        manager.alive()
        manager.status("safety: wall ahead")
        manager.status("safety: wall ahead")
        manager.stopping()
        heard = [systemd.recv(100) for _ in range(4)]
        manager.close()
    assert heard == [b"READY=1", b"WATCHDOG=1", b"STATUS=safety: wall ahead", b"STOPPING=1"]


def test_an_abstract_socket_is_meant_by_an_at_sign():
    name = "wallride-test-notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind("\0" + name)
        systemd.settimeout(1)
        manager = ServiceManager({"NOTIFY_SOCKET": "@" + name})
        manager.ready()
        manager.close()
        assert systemd.recv(100) == b"READY=1"


def test_nobody_listening_is_no_error(tmp_path):
    ServiceManager({}).ready()
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "gone")})
    manager.alive()
    manager.close()
    manager.alive()
