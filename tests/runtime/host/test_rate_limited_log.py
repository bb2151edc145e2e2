"""A log that nobody outside can fill."""

import logging

from wallride.runtime.host.rate_limited_log import RateLimitedLog


def test_a_flood_is_a_line_now_and_then_with_a_count(caplog):
    now = [0.0]
    quiet = RateLimitedLog(logging.getLogger("test.quiet"), lambda: now[0])
    times = []
    for _ in range(30_000):  # 5 minutes at 100 Hz
        before = len(caplog.records)
        quiet.log("kind", "something")
        if len(caplog.records) > before:
            times.append(now[0])
        now[0] += 0.01
    assert [round(time_s) for time_s in times] == [0, 1, 3, 7, 15, 31, 63, 123, 183, 243]
    assert caplog.messages[0] == "something"
    assert caplog.messages[1].startswith("something (and 9")


def test_after_a_rest_it_speaks_at_once_and_kinds_do_not_hush_each_other(caplog):
    now = [0.0]
    quiet = RateLimitedLog(logging.getLogger("test.quiet"), lambda: now[0])
    for at_s in (0.0, 0.5, 2.0, 10.0, 12.0):
        now[0] = at_s
        quiet.log("a", f"a at {at_s}")
        quiet.log("b", f"b at {at_s}")
    assert [text for text in caplog.messages if text.startswith("a")] == [
        "a at 0.0", "a at 2.0 (and 1 more)", "a at 10.0", "a at 12.0",
    ]  # fmt: skip
    assert sum(text.startswith("b") for text in caplog.messages) == 4
