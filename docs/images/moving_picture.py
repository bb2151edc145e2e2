"""Makes README's pictures of the page: drive.webp, beside the simulator's terminal while the car drives; two stills.

From the repository's root: .venv/bin/python -m docs.images.moving_picture. Needs Chromium, as the browser tests do.
"""

import asyncio
import io
import os
import pty
import re
import sys
import tempfile
from pathlib import Path

from PIL import Image
from rich.console import Console
from rich.text import Text

from tests.clients.monitor.browser import Page, chromium

TARGET = Path("docs/images/drive.webp")
DESK, PHONE = Path("docs/images/monitor.png"), Path("docs/images/monitor-phone.png")
COLUMNS, ROWS = 64, 40
HEIGHT_PX, TERMINAL_PX, PAGE_PX = 640, 500, 880
WIDTH_PX = 1100
FRAMES, EVERY_S = 60, 0.25
STILL_AFTER_S = 8.0
MAX_BYTES = 1_900_000
SCENE = ("sim", "loop", "--set", "wall_follow.speed_mps=2", "--duration", "600", "--obstacle", "box ahead=6 after=9")
HOME = "\x1b[H"
STYLE = (
    "<body style='margin:0;background:#16181c;color:#d8dbe0'>"
    "<pre style='margin:14px;font:12px/1.14 DejaVu Sans Mono,monospace'>"
)


class FilmedTerminal:
    """A terminal with the simulator in it. text: everything that it wrote, the newest frame last."""

    def __init__(self) -> None:
        self.text = ""
        self._number, self._file = pty.fork()
        if not self._number:
            size = {"COLUMNS": str(COLUMNS), "LINES": str(ROWS), "TERM": "xterm-256color", "BROWSER": "true"}
            os.execve(sys.executable, [sys.executable, "-m", "wallride", *SCENE], {**os.environ, **size})
        asyncio.get_running_loop().add_reader(self._file, self._read)

    def _read(self) -> None:
        try:
            self.text += os.read(self._file, 1 << 16).decode(errors="replace")
        except OSError:  # the other end is closed
            asyncio.get_running_loop().remove_reader(self._file)
        self.text = self.text[-200_000:]

    @property
    def page(self) -> str:
        """Address of the page, "" until the simulator has said it."""
        found = re.search(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+", self.text)
        return found[0] if found else ""

    def html(self) -> str:
        """Return the newest whole frame."""
        frames = self.text.split(HOME)
        lines = frames[-2].replace("\r", "").split("\n") if len(frames) > 2 else []
        console = Console(width=COLUMNS, record=True, file=io.StringIO(), color_system="truecolor")
        console.print(Text.from_ansi("\n".join(lines[:ROWS])), soft_wrap=True)
        return STYLE + console.export_html(inline_styles=True, code_format="{code}") + "</pre>"

    async def end(self) -> None:
        """Ask the simulator to end, as Ctrl-C does, and wait for it."""
        os.write(self._file, b"\x03")
        await asyncio.to_thread(os.waitpid, self._number, 0)


async def shot(tab: Page, file: Path, width_px: int) -> Image.Image:
    """Return a picture of a tab, so wide."""
    await tab.picture(file)
    with Image.open(file) as picture:
        return picture.convert("RGB").crop((0, 0, width_px, HEIGHT_PX))


async def pictures() -> list[Image.Image]:
    """Drive, and look at both."""
    terminal = FilmedTerminal()
    frames = []
    with tempfile.TemporaryDirectory() as folder:
        async with chromium(Path(folder) / "profile") as browser:
            left, right = await browser.open(), await browser.open()
            await left.look(width=TERMINAL_PX, height=HEIGHT_PX, dark=True)
            await right.look(width=PAGE_PX, height=HEIGHT_PX, dark=True)
            async with asyncio.timeout(120):
                while not terminal.page:
                    await asyncio.sleep(0.2)
            await right.go(terminal.page)
            await right.until("document.querySelector('#state').textContent !== 'no car'", within_s=30)
            for _ in range(FRAMES):
                began_s = asyncio.get_running_loop().time()
                frame = await left.call("Page.getFrameTree")
                await left.call(
                    "Page.setDocumentContent", frameId=frame["frameTree"]["frame"]["id"], html=terminal.html()
                )
                both = Image.new("RGB", (TERMINAL_PX + PAGE_PX, HEIGHT_PX))
                both.paste(await shot(left, Path(folder) / "left.png", TERMINAL_PX), (0, 0))
                await browser.show(right)
                both.paste(await shot(right, Path(folder) / "right.png", PAGE_PX), (TERMINAL_PX, 0))
                frames.append(both.resize((WIDTH_PX, HEIGHT_PX * WIDTH_PX // both.width), Image.Resampling.LANCZOS))
                await asyncio.sleep(max(0.0, began_s + EVERY_S - asyncio.get_running_loop().time()))
            await stills(right, terminal.page)
    await terminal.end()
    return frames


async def stills(tab: Page, url: str) -> None:
    """Take the page on a desk and on a phone, each with some seconds of plots."""
    for file, look in (
        (DESK, {"width": 1400, "height": 940}),
        (PHONE, {"width": 390, "height": 844, "scale": 2.0, "mobile": True}),
    ):
        await tab.look(**look)
        await tab.go(url)
        await asyncio.sleep(STILL_AFTER_S)
        await tab.picture(file)


def write(frames: list[Image.Image]) -> None:
    """Write the moving picture, as good as its size permits."""
    for quality in (60, 45, 30):
        frames[0].save(
            TARGET, save_all=True, append_images=frames[1:], duration=round(1000 * EVERY_S), loop=0, quality=quality,
            method=4,
        )  # fmt: skip
        if TARGET.stat().st_size < MAX_BYTES:
            break
    print(f"{TARGET}: {TARGET.stat().st_size / 1e6:.2f} MB, {len(frames)} frames, quality {quality}")


if __name__ == "__main__":
    write(asyncio.run(pictures()))
