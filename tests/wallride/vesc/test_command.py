"""`wallride vesc set` as a command, on `wallride emulate` as a process."""

import pytest

from tests.wallride.doctor.test_command import answer, emulated
from wallride.cli import main


@pytest.mark.timeout(180)  # seven processes
async def test_a_controller_as_it_is_sold_is_set_and_the_doctor_agrees(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    async with emulated(tmp_path / "ports", "--vesc-timeout", "1", "--vesc-brake", "0") as file:
        code, text = await answer("vesc", "set", "--config", str(file))
        assert (code, "say --yes" in text) == (2, True), text
        code, text = await answer("vesc", "set", "--config", str(file), "--yes", "--dry-run")
        assert (code, "--dry-run" in text) == (0, True), text
        code, text = await answer("vesc", "set", "--config", str(file), "--yes")
        assert (code, "as wanted" in text) == (0, True), text
        (kept,) = (tmp_path / "state/wallride/vesc").glob("*.json")
        code, text = await answer("doctor", str(file), "--only", "motor")
        assert code == 0, text
        code, text = await answer("vesc", "restore", str(kept), "--config", str(file), "--yes")
        assert (code, "150 ms  ->  1000 ms" in text) == (0, True), text


@pytest.mark.parametrize("options", [["--timeout-ms", "0"], ["--timeout-ms", "2000"], ["--brake-current-a", "nan"]])
def test_values_that_protect_no_car_are_refused(options, capsys):
    with pytest.raises(SystemExit) as end:
        main(["vesc", "set", *options])
    assert end.value.code == 2
    assert "write a number from" in capsys.readouterr().err


def test_a_port_that_is_not_there_is_one_sentence(capsys):
    assert main(["vesc", "set", "--set", "motor.address=serial:///dev/none-23"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
