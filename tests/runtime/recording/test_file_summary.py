"""The duration of a recording, from the last bytes of its file; a torn or foreign one has none."""

import pytest

from wallride.runtime.recording.file_summary import FOOTER, FOOTER_OPCODE, duration_s
from wallride.runtime.recording.recover import MAGIC

BEGIN_NS = 1_790_000_000_000_000_000


@pytest.fixture
def whole(tmp_path):
    """A recording of 2.5 s."""
    from mcap.writer import Writer

    path = tmp_path / "whole.mcap"
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=100)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for at_ms in (500, 0, 1000, 2500):
            writer.add_message(channel, BEGIN_NS + at_ms * 1_000_000, b"{}" * 40, 0)
        writer.finish()
    return path


def test_it_is_from_the_first_message_to_the_last(whole):
    assert duration_s(whole) == 2.5


def test_a_file_that_is_cut_anywhere_has_none(whole):
    content = whole.read_bytes()
    for length in range(0, len(content), 7):
        whole.write_bytes(content[:length])
        assert duration_s(whole) is None


@pytest.mark.parametrize("summary_at", [0, 8, 20, 1 << 62])
def test_a_footer_that_leads_nowhere_has_none(tmp_path, summary_at):
    path = tmp_path / "made.mcap"
    footer = FOOTER.pack(FOOTER_OPCODE, FOOTER.size - 9, summary_at, 0, 0)
    path.write_bytes(MAGIC + bytes(60) + footer + MAGIC)
    assert duration_s(path) is None


def test_a_recording_without_a_message_has_none(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "empty.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        writer.finish()
    assert duration_s(path) is None
