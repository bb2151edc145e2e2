"""One client that sends as fast as it can, for a bounded time, to an address on loopback; a process of its own.

Run: python -m tests.system.flooder KIND ENDPOINT CAR SECONDS [KEYS NAME]

KIND is one of FLOODS. It prints how many messages it sent, and ends by itself.
"""

import json
import os
import socket
import ssl
import sys
import threading
import time
from pathlib import Path

import zenoh

from wallride.runtime.wire.zenoh_config import Tls, client_config

NONSENSE = os.urandom(60)
LARGE = bytes(1_000_000)
MAX_S = 60.0
MAX_STRANGERS = 8
"""Threads that open connections at the same time."""


def nonsense(session, car, until_s):
    """Send commands of the right length and no meaning."""
    return _command(session, car, until_s, NONSENSE)


def large(session, car, until_s):
    """Send commands of 1 MB."""
    return _command(session, car, until_s, LARGE)


def _command(session, car, until_s, payload):
    sent = 0
    publisher = session.declare_publisher(f"wallride/{car}/operator/command")
    while time.monotonic() < until_s:
        publisher.put(payload)
        sent += 1
    return sent


def wild(session, car, until_s):
    """Send to keys with wildcards, which reach every subscription where no access control forbids it."""
    keys = (f"wallride/{car}/**", "wallride/*/operator/command", "**", f"wallride/{car}/operator/comm$*")
    sent = 0
    while time.monotonic() < until_s:
        session.put(keys[sent % len(keys)], NONSENSE)
        sent += 1
    return sent


def questions(session, car, until_s):
    """Ask for every setting, without waiting for an answer."""
    return _ask(session, until_s, (f"wallride/{car}/param/list",), b"")


def large_questions(session, car, until_s):
    """Ask with 1 MB of text."""
    return _ask(session, until_s, (f"wallride/{car}/param/get",), LARGE)


def every_question(session, car, until_s):
    """Ask everything that may be asked."""
    names = ("list", "get", "history", "set", "save")
    return _ask(session, until_s, tuple(f"wallride/{car}/param/{name}" for name in names), b"{}")


def _ask(session, until_s, keys, payload):
    sent, open_, room = 0, [0], threading.Condition()

    def done():
        with room:
            open_[0] -= 1
            room.notify()

    while time.monotonic() < until_s:
        with room:
            if open_[0] >= 256:
                room.wait(0.01)
                continue
            open_[0] += 1
        ended = zenoh.handlers.Callback(lambda _reply: None, done)
        session.get(keys[sent % len(keys)], ended, payload=payload, timeout=1.0)
        sent += 1
    return sent


def stranger(endpoint, until_s):
    """Open TLS connections without a certificate, one after the other in several threads."""
    host, _, port = endpoint.rpartition("/")[2].rpartition(":")
    counts = [0] * MAX_STRANGERS

    def knock(i):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        while time.monotonic() < until_s:
            try:
                with (
                    socket.create_connection((host, int(port)), timeout=1) as raw,
                    context.wrap_socket(raw, server_hostname="localhost") as link,
                ):
                    link.recv(1)
            except OSError:
                pass
            counts[i] += 1

    threads = [threading.Thread(target=knock, args=(i,)) for i in range(MAX_STRANGERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sum(counts)


FLOODS = {
    "nonsense": nonsense,
    "large": large,
    "wild": wild,
    "questions": questions,
    "large_questions": large_questions,
    "every_question": every_question,
}


def main(kind, endpoint, car, seconds, keys="", name=""):
    """Flood once, and print the count."""
    until_s = time.monotonic() + min(float(seconds), MAX_S)
    if kind == "stranger":
        print(stranger(endpoint, until_s))
        return
    folder = Path(keys)
    tls = Tls(folder / "ca.pem", folder / f"{name}.pem", folder / f"{name}.key") if keys else None
    config = client_config(endpoint, tls)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        print(FLOODS[kind](session, car, until_s), flush=True)
    os._exit(0)  # what is still queued need not be sent


if __name__ == "__main__":
    main(*sys.argv[1:])
