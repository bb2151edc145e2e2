"""A car that says too much, or nothing, ends neither the operator's memory nor their patience."""

import pytest

from wallride.deploy.car_process import MAX_LINE_B, MAX_SAID_B, CarProcess, TooMuchError


def there(script, silent_s=60.0, **how):
    return CarProcess(["sh", "-c", script], silent_s, **how)


def test_an_answer_and_its_exit_code():
    with there("read -r word; echo heard $word; echo trouble >&2; exit 3") as process:
        process.write(b"one\n")
        process.close_input()
        assert process.answer() == "heard one\n"
        assert process.end() == 3
    assert process.words == "trouble\n"
    assert not process.silent


def test_an_answer_without_an_end_is_refused_and_ends_the_command():
    with pytest.raises(TooMuchError), there("exec yes") as process:
        process.answer()


def test_of_endless_errors_the_beginning_is_kept():
    with there(f"yes | head -c {3 * MAX_SAID_B} >&2") as process:
        assert process.answer() == ""
        assert process.end() == 0
    assert len(process.words) == MAX_SAID_B


@pytest.mark.parametrize("script", ["exec sleep 600", "exec sleep 600 >&2"])
def test_silence_is_ended(script):
    with there(script, silent_s=0.1) as process:
        assert process.answer() == ""
        assert process.end() != 0
    assert process.silent


def test_a_copy_that_is_not_taken_is_ended():
    with there("exec sleep 600", silent_s=0.1) as process:
        with pytest.raises(BrokenPipeError):
            process.write(bytes(1 << 24))
        process.end()
    assert process.silent


def test_lines_come_in_bounded_pieces():
    with there(f"head -c {2 * MAX_LINE_B} /dev/zero | tr '\\0' x; echo; echo end >&2", merged=True) as process:
        process.close_input()
        found = list(process.lines())
        assert process.end() == 0
    assert [len(line) for line in found] == [MAX_LINE_B, MAX_LINE_B, 0, 3]
