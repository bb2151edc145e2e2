"""A question that was not answered is asked again: "yy" is neither yes nor no, and a mistyped length is no measure."""

import pytest

from wallride.runtime.host.terminal_text import asked, yes_or_no


@pytest.fixture
def typing(monkeypatch):
    """Return a function that sets the lines to be typed; at their end the terminal is closed."""

    def type_in(*lines):
        waiting = iter(lines)
        said = []

        def answer(question):
            said.append(question)
            try:
                return next(waiting)
            except StopIteration:
                raise EOFError from None

        monkeypatch.setattr("builtins.input", answer)
        return said

    return type_in


@pytest.mark.parametrize(("typed", "answer"), [("y", True), (" YES ", True), ("n", False), ("No", False)])
def test_what_is_an_answer_is_taken(typed, answer, typing):
    typing(typed)
    assert yes_or_no("forward?") is answer


@pytest.mark.parametrize("typed", ["yy", "", "j", "0", "yes no"])
def test_what_is_no_answer_is_asked_again(typed, typing, capsys):
    said = typing(typed, "y")
    assert yes_or_no("did the wheels turn forward?") is True
    assert said == ["did the wheels turn forward? [y/n] "] * 2
    assert "type y or n" in capsys.readouterr().out


@pytest.mark.parametrize("default", [True, False])
def test_enter_is_the_answer_in_capitals_and_a_mistype_is_not(default, typing):
    typing("")
    assert yes_or_no("do it?", default=default) is default
    typing("yy", "n" if default else "y")
    assert yes_or_no("do it?", default=default) is not default


@pytest.mark.parametrize("default", [True, False, None])
def test_a_closed_terminal_ends_the_question(default, typing):
    typing("what?")
    assert yes_or_no("do it?", default=default) is default


def test_a_number_that_cannot_be_read_is_asked_again(typing):
    said = typing("0,4x", "0.4")
    assert asked("length [m]: ", float, None) == 0.4
    assert len(said) == 2
