"""A real Chromium without a screen, driven over its DevTools protocol with aiohttp alone.

Looked for in $WALLRIDE_CHROMIUM, then on the PATH. In a test's sandbox it needs --no-sandbox; the pages are our own.
"""

import asyncio
import base64
import contextlib
import json
import os
import shutil
import signal
import subprocess
import time
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import aiohttp
import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--no-default-browser-check",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--disable-dev-shm-usage", "--mute-audio", "--hide-scrollbars", "--remote-debugging-port=0",
)  # fmt: skip
START_WITHIN_S = 20.0


def find_chromium():
    """Return the browser's path, None when there is none."""
    named = os.environ.get("WALLRIDE_CHROMIUM")
    return named or next((path for name in NAMES if (path := shutil.which(name))), None)


def needs_chromium():
    """Skip a test without a browser; fail it where CI says that there is one."""
    if find_chromium() is None:
        if os.environ.get("WALLRIDE_NEEDS_CHROMIUM"):
            pytest.fail("no Chromium here, and CI needs one: apt-get install chromium")
        pytest.skip("no Chromium here: apt-get install chromium, or set WALLRIDE_CHROMIUM to one")


class Page:
    """One tab. requests: every address that it asked for. errors: what it wrote to the console as an error."""

    def __init__(self, socket, target, browser):
        self._socket = socket
        self.target = target
        self.browser = browser
        self._number = 0
        self._waiting = {}
        self._events = {}
        self.requests = []
        self.errors = []
        self._reading = asyncio.create_task(self._read())

    async def call(self, method, **parameters):
        self._number += 1
        answer = self._waiting[self._number] = asyncio.get_running_loop().create_future()
        await self._socket.send_str(json.dumps({"id": self._number, "method": method, "params": parameters}))
        async with asyncio.timeout(20):
            return await answer

    async def run(self, script):
        """Evaluate JavaScript; a promise is awaited; an exception there is one here."""
        found = await self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            details = found["exceptionDetails"]
            raise AssertionError(details.get("exception", {}).get("description") or details["text"])
        return found["result"].get("value")

    async def until(self, script, *, within_s=10.0):
        """Wait until JavaScript says something true; return it."""
        try:
            async with asyncio.timeout(within_s):
                while not (value := await self.run(script)):
                    await asyncio.sleep(0.02)
        except TimeoutError:
            raise AssertionError(f"never came true: {script}; errors: {self.errors}") from None
        return value

    async def go(self, url):
        loaded = self._events["Page.loadEventFired"] = asyncio.get_running_loop().create_future()
        await self.call("Page.navigate", url=url)
        async with asyncio.timeout(20):
            await loaded

    async def look(self, *, width, height, scale=1.0, mobile=False, dark=False):
        """Choose the screen."""
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=mobile
        )
        await self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}],
        )

    async def picture(self, path, *, whole=False):
        shot = await self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        Path(path).write_bytes(base64.b64decode(shot["data"]))

    async def middle(self, selector):
        """Return where an element is, after scrolling to it."""
        box = await self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            " e.scrollIntoView({block: 'center'});"
            " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        return box[0], box[1]

    async def mouse(self, kind, x, y):
        buttons = 0 if kind == "mouseReleased" else 1
        await self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons, clickCount=1,
        )  # fmt: skip

    async def click(self, selector):
        x, y = await self.middle(selector)
        await self.mouse("mousePressed", x, y)
        await self.mouse("mouseReleased", x, y)

    async def touch(self, kind, *points):
        await self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in points])

    async def key(self, kind, key, code=None):
        await self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key)

    async def close(self):
        """Close the tab, as its owner would."""
        with contextlib.suppress(ConnectionError, asyncio.CancelledError):
            await self.call("Page.close")

    async def _read(self):
        async for message in self._socket:
            found = json.loads(message.data)
            if (answer := self._waiting.pop(found.get("id"), None)) is not None:
                if not answer.done():
                    if "error" in found:
                        answer.set_exception(AssertionError(found["error"]["message"]))
                    else:
                        answer.set_result(found["result"])
            elif "method" in found:
                self._on_event(found["method"], found["params"])
        for answer in self._waiting.values():
            answer.cancel()

    def _on_event(self, method, details):
        if method == "Network.requestWillBeSent":
            self.requests.append(details["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(details["url"])
        elif method == "Runtime.exceptionThrown":
            thrown = details["exceptionDetails"]
            self.errors.append(thrown.get("exception", {}).get("description") or thrown["text"])
        elif method == "Log.entryAdded" and details["entry"]["level"] == "error":
            self.errors.append(f"{details['entry']['text']} {details['entry'].get('url', '')}")
        if (waiting := self._events.pop(method, None)) is not None and not waiting.done():
            waiting.set_result(details)


class Browser:
    """A running Chromium, or a part of one with cookies, storage and tabs of its own (a browser context)."""

    def __init__(self, http, port, process, control, context=None):
        self._http = http
        self._port = port
        self._control = control
        self._context = {} if context is None else {"browserContextId": context}
        self.process = process

    async def open(self):
        """Return a new, empty tab."""
        target = (await self._control.call("Target.createTarget", url="about:blank", **self._context))["targetId"]
        page = Page(await _socket(self._http, self._port, f"/devtools/page/{target}"), target, self)
        for domain in ("Page", "Runtime", "Network", "Log"):
            await page.call(f"{domain}.enable")
        return page

    async def show(self, page):
        """Bring a tab to the front, which hides the others."""
        await self._control.call("Target.activateTarget", targetId=page.target)

    def renderers(self):
        """Return the process ids of the tabs, all of them children of our own browser."""
        found = []
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            with contextlib.suppress(OSError):
                words = (entry / "cmdline").read_bytes()
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                if b"--type=renderer" in words and self._is_ours(parent):
                    found.append(int(entry.name))
        return found

    def _is_ours(self, number):
        while number > 1:
            if number == self.process.pid:
                return True
            with contextlib.suppress(OSError, ValueError):
                number = int(Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[1])
                continue
            return False
        return False


@asynccontextmanager
async def chromium(folder):
    """Yield a browser with an empty profile in a folder."""
    with started(folder) as (process, place):
        async with _controlled(place) as (http, port, control):
            yield Browser(http, port, process, control)


@pytest.fixture(scope="session")
def running_chromium(tmp_path_factory):
    """One browser for all tests of this process: its start costs more than most of them."""
    needs_chromium()
    with started(tmp_path_factory.mktemp("chromium")) as running:
        yield running


@pytest.fixture
async def tab(running_chromium):
    """An empty tab in a context of its own, and so with cookies and storage of its own."""
    process, place = running_chromium
    async with _controlled(place) as (http, port, control):
        context = (await control.call("Target.createBrowserContext"))["browserContextId"]
        yield await Browser(http, port, process, control, context).open()
        await control.call("Target.disposeBrowserContext", browserContextId=context)


@contextmanager
def started(folder):
    """Yield the process of a new browser, and the port and the path of its DevTools."""
    with subprocess.Popen(
        [find_chromium(), *QUIET, f"--user-data-dir={folder}", "about:blank"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            yield process, _place(Path(folder) / "DevToolsActivePort", process)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # its own session: the browser and its children, nothing else


@asynccontextmanager
async def _controlled(place):
    port, path = place
    async with aiohttp.ClientSession() as http:
        yield http, port, Page(await _socket(http, port, path), None, None)


async def _socket(http, port, path):
    return await http.ws_connect(f"ws://127.0.0.1:{port}{path}", max_msg_size=0)


def _place(file, process):
    until_s = time.monotonic() + START_WITHIN_S
    while process.poll() is None and time.monotonic() < until_s:
        with contextlib.suppress(OSError, ValueError):
            port, path = file.read_text().splitlines()
            return int(port), path
        time.sleep(0.02)
    raise RuntimeError("the browser did not start")
