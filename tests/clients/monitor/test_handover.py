"""The browser gets the page's address from a file; no other user sees it."""

import webbrowser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from tests.clients.monitor.test_command import running
from wallride.clients.monitor.server import handed_over

URL = "http://127.0.0.1:8447/?token=abcdefghijklmnop"


def test_the_file_is_its_users_alone_and_goes_with_the_monitor(tmp_path):
    with handed_over(URL, {"XDG_RUNTIME_DIR": str(tmp_path)}) as address:
        assert address.startswith("file:///")
        assert "token" not in address
        file = Path(unquote(urlsplit(address).path))
        assert tmp_path in file.parents
        assert file.stat().st_mode & 0o777 == 0o600
        assert file.parent.stat().st_mode & 0o777 == 0o700
        assert f'content="0; url={URL}"' in file.read_text()
    assert list(tmp_path.iterdir()) == []
    with handed_over(URL, {}) as address:
        assert Path(unquote(urlsplit(address).path)).parent.stat().st_mode & 0o777 == 0o700


async def test_the_browser_is_given_the_file_and_the_terminal_the_address(scene, monkeypatch):
    opened = []

    def noted(address):
        opened.append(address)
        return True

    monkeypatch.setattr(webbrowser, "open", noted)
    async with running("--connect", scene.endpoint, until=lambda _: opened) as said:
        assert "?token=" in said[0]
        assert len(said) == 1, "no warning of a network"
        page = Path(unquote(urlsplit(opened[0]).path))
        assert said[0].removeprefix("the monitor is at ") in page.read_text()
    assert not page.exists()
