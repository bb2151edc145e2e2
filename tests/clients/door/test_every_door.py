"""No server of the clients opens a port or a WebSocket beside the door."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
OPENS = re.compile(r"\b(TCPSite|UnixSite|AppRunner|run_app|WebSocketResponse|start_(?:unix_)?server|create_server)\(")


def test_every_web_server_is_behind_the_door():
    places = {
        path.relative_to(ROOT).as_posix()
        for folder in ("clients", "wallride", "runtime")
        for path in (ROOT / folder).rglob("*.py")
        if OPENS.search(path.read_text(encoding="utf-8"))
    }
    assert places == {"clients/door/door.py", "clients/door/listening.py"}
