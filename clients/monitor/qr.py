"""An address as a QR code for a terminal, so that a phone need not be typed on."""

import io
import sys

import segno

FULL_BLOCK = "█"


def qr_lines(address: str, encoding: str | None = None) -> str:
    """Return the code as lines of half blocks; "" where the terminal's encoding has none.

    encoding: of the terminal, by default that of standard output.
    """
    try:
        FULL_BLOCK.encode(encoding or sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return ""
    out = io.StringIO()
    segno.make(address, error="l", micro=False).terminal(out=out, border=2, compact=True)
    return out.getvalue().rstrip("\n")
