"""A page beside a simulated drive learns why the drive ended: by contact, by its time, or in its terminal."""

import asyncio
import os
import signal
import sys
from urllib.parse import urlsplit

import pytest

from wallride.sim.live.screen import address_in

aiohttp = pytest.importorskip("aiohttp", reason="the monitor needs aiohttp: pip install '.[monitor]'")
pytestmark = pytest.mark.timeout(120)


async def last_words(tmp_path, *options, interrupt=False):
    """Return the reason with which the simulator's monitor closes a page's WebSocket."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "BROWSER": "true"}
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "wallride", "sim", "--seed", "1", *options, env=environment, start_new_session=True,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stderr is not None
    lines = []
    try:
        async for line in process.stderr:
            lines.append(line.decode().rstrip())
            if address := address_in(lines):
                break
        else:
            raise AssertionError("\n".join(lines))
        place = urlsplit(address)
        origin = f"{place.scheme}://{place.netloc}"
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(f"{origin}/ws?{place.query}", origin=origin) as page,
        ):
            if interrupt:
                process.send_signal(signal.SIGINT)
            while (message := await page.receive()).type in {aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY}:
                pass
        assert (message.type, message.data) == (aiohttp.WSMsgType.CLOSE, 1001)
        await asyncio.gather(process.stderr.read(), process.wait())
        return message.extra
    finally:
        if process.returncode is None:
            os.killpg(process.pid, signal.SIGKILL)
            await process.wait()


@pytest.mark.parametrize(
    ("options", "interrupt", "words"),
    [
        (["--duration", "8"], False, "its 8 s are over"),
        (["--obstacle", "box ahead=0.05 after=8"], False, "the car touched something"),
        ([], True, "it was stopped in its terminal"),
    ],
)
async def test_the_page_is_told_why_the_drive_ended(tmp_path, options, interrupt, words):
    said = await last_words(tmp_path, *options, interrupt=interrupt)
    assert said == f"The drive ended: {words}. Start another: make sim."
