"""Problems planted on a healthy computer: each is found at its subject, and the remedy is named."""

import asyncio
from datetime import UTC, datetime

import pytest

from tests.runtime.test_line_files import in_the_box
from tests.runtime.test_map_files import box, write
from tests.wallride.doctor.fakes import PAD, ROUTES, changed, healthy, link, put, settings, usb
from wallride.doctor.access import check_access
from wallride.doctor.condition import check_condition
from wallride.doctor.examine import examine
from wallride.doctor.findings import Level, worst
from wallride.doctor.joystick import check_joystick
from wallride.doctor.network import check_network
from wallride.doctor.ports import check_ports
from wallride.doctor.program import check_course, check_program, judge_kernel

USB_LIDAR = "lidar.address=serial:///dev/wallride-lidar"


async def another_program(_endpoint):
    return "another program"


async def this_car(_endpoint):
    return "the car car1 (session 1234abcd)"


def everything(computer, chosen, holder=another_program):
    """Run every check that needs no device."""
    found = check_ports(computer, chosen) + check_network(computer, chosen) + check_condition(computer, chosen)
    found += [one for one in check_program(computer, chosen) if one.subject != "compiled functions"]
    found += asyncio.run(check_access(computer, chosen, holder))
    return found + check_joystick(computer)


def holds(*files):
    """Plant files, each by name and content."""
    return lambda computer: [put(computer.root, name, text) for name, text in files]


def routes(text):
    return holds(("proc/net/route", text))


def test_the_map_and_its_line_are_looked_at(tmp_path):
    lab, line = write(tmp_path, box()), "wall_follow.method=line"
    named = f"map.file={lab}"
    assert check_course(settings()) == []

    def found(*chosen):
        (one,) = check_course(settings(*chosen))
        return one.level, one.words

    assert found(named) == (Level.OK, "m, without a race line")
    assert found(named, line)[0] is Level.WARN
    assert "make it: wallride line" in found(named, line)[1]
    assert found(line)[0] is Level.WARN
    lab.with_name("m.line.csv").write_text(in_the_box())
    assert found(named, line, "car.max_steering_rad=0.6") == (Level.OK, "m, with a race line")
    assert found(named, f"map.line={tmp_path / 'away.csv'}")[0] is Level.FAIL
    assert found(f"map.file={tmp_path / 'away.yaml'}")[0] is Level.FAIL
    assert "map" in [one.subject for one in check_program(healthy(tmp_path / "one"), settings(named))]


@pytest.mark.parametrize(
    "words", [["/usr/bin/python3", "/opt/wallride/bin/wallride", "run"], ["python3", "-m", "wallride", "run"]]
)
def test_a_car_that_runs_has_the_devices_and_is_named(tmp_path, words):
    computer, chosen = healthy(tmp_path), settings("motor.address=serial:///dev/wallride-vesc")
    put(tmp_path, "proc/4711/comm", "python3\n")
    put(tmp_path, "proc/4711/cmdline", "\0".join([*words, "car.toml", ""]))
    link(tmp_path, "proc/4711/fd/9", "/dev/null")

    async def look():
        return [one async for one in examine(computer, chosen, ("ports", "lidar", "motor"))]

    (found,) = asyncio.run(look())
    assert (found.subject, found.level) == ("devices", Level.WARN)
    assert found.words == "the car runs and has them (wallride run, process 4711): they are not looked at"
    assert found.remedy == "end it, then look again: Ctrl-C in its terminal, or kill 4711"


def no_vesc(computer):
    (computer.root / "dev/wallride-vesc").unlink()


def no_rules(computer):
    (computer.root / "etc/udev/rules.d/99-wallride.rules").unlink()


def vesc_without_a_name(computer):
    no_vesc(computer)
    no_rules(computer)
    usb(computer.root, "ttyACM0", "0483", "5740")


def vesc_without_a_module(computer):
    no_vesc(computer)
    put(computer.root, "sys/bus/usb/devices/1-2/idVendor", "0483")
    put(computer.root, "sys/bus/usb/devices/1-2/idProduct", "5740")


def second_program(computer):
    put(computer.root, "proc/200/comm", "vesc_driver\n")
    link(computer.root, "proc/200/fd/7", "/dev/null")


def modem_manager(computer):
    no_rules(computer)
    put(computer.root, "proc/300/comm", "ModemManager\n")


def only_wifi_in_it(computer):
    lines = ROUTES.replace("0001A8C0", "0000A8C0").splitlines()
    put(computer.root, "proc/net/route", "\n".join(line for line in lines if not line.startswith("eth0")))


def lidars_own_address(computer):
    trie = (computer.root / "proc/net/fib_trie").read_text()
    put(computer.root, "proc/net/fib_trie", trie.replace("192.168.0.15", "192.168.0.10"))


def no_unit(computer):
    (computer.root / "etc/systemd/system/wallride.service").unlink()


def not_at_boot(computer):
    (computer.root / "etc/systemd/system/multi-user.target.wants/wallride.service").unlink()


COOLING = "sys/class/thermal/cooling_device0"
FILES = [
    (no_vesc, [], "motor port", Level.FAIL, "plug it in"),
    (vesc_without_a_name, [], "motor port", Level.FAIL, "sudo wallride service install"),
    (vesc_without_a_module, [], "motor port", Level.FAIL, "sudo modprobe cdc_acm"),
    (second_program, [], "motor port", Level.FAIL, "end that program"),
    (lambda one: link(one.root, "proc/100/fd/7", "/dev/null"), [],
     "motor port", Level.FAIL, "sudo systemctl stop wallride"),
    (lambda one: link(one.root, "dev/wallride-vesc", one.root / "dev/wallride-lidar"), [USB_LIDAR],
     "ports", Level.FAIL, "another port"),
    (lambda one: link(one.root, "dev/ttyACM3", "/dev/null"), ["motor.address=serial:///dev/ttyACM3"], "motor port",
     Level.WARN, "serial:///dev/wallride-vesc"),
    (holds(("usr/lib/udev/rules.d/85-brltty.rules", "")), [], "brltty", Level.WARN, "apt remove"),
    (modem_manager, [], "ModemManager", Level.WARN, "apt remove modemmanager"),
    (routes("\n".join(ROUTES.splitlines()[:3])), [], "lidar network", Level.FAIL, "ipv4.addresses 192.168.0.15/24"),
    (lidars_own_address, [], "lidar network", Level.FAIL, "another one, like 192.168.0.15/24"),
    (routes(ROUTES.replace("0101A8C0", "0A00A8C0")), [], "lidar network", Level.WARN, "ipv4.never-default yes"),
    (routes(ROUTES.replace("0001A8C0", "0000A8C0")), [], "lidar network", Level.WARN, "renumber"),
    (only_wifi_in_it, [], "lidar network", Level.FAIL, "the Wi-Fi use another network"),
    (holds(("sys/class/net/eth0/carrier", "0")), [], "lidar network", Level.FAIL, "plug the"),
    (holds(("sys/class/thermal/thermal_zone0/temp", "96000\n")), [], "heat and supply", Level.WARN, "give it air"),
    (holds((f"{COOLING}/type", "cpufreq-cpu0\n"), (f"{COOLING}/cur_state", "3\n")), [],
     "heat and supply", Level.WARN, "weak supply"),
    (holds(("sys/class/hwmon/hwmon1/oc1_event_cnt", "4\n")), [], "heat and supply", Level.WARN, "stronger supply"),
    (holds(("sys/devices/platform/soc/soc:firmware/get_throttled", "0x1\n")), [],
     "heat and supply", Level.WARN, "stronger supply"),
    (holds(("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n")), [],
     "processor", Level.WARN, "performance"),
    (no_unit, [], "service", Level.WARN, "sudo wallride service install"),
    (not_at_boot, [], "service", Level.WARN, "systemctl enable wallride"),
    (holds(("proc/bus/input/devices", PAD.replace("c21f", "c219"))), [], "gamepad", Level.WARN, "X"),
]  # fmt: skip

ANSWERS = [
    ({"may_use": lambda _: False, "groups": frozenset({"ann"})}, "motor port", Level.FAIL, "usermod -aG dialout ann"),
    ({"may_use": lambda _: False}, "motor port", Level.FAIL, "the group dialout"),
    ({"may_use": lambda path: "event" not in str(path)}, "gamepad", Level.WARN, "usermod -aG input ann"),
    ({"has_module": lambda _: False}, "gamepad", Level.WARN, ".[teleop]"),
    ({"now_unix_s": datetime(2019, 1, 1, tzinfo=UTC).timestamp()}, "clock", Level.WARN, "sudo date --set"),
    ({"free_bytes": lambda _: 200_000_000}, "disk", Level.WARN, "wallride logs trim"),
    ({"free_bytes": lambda _: 1_000_000}, "disk", Level.FAIL, "wallride logs trim"),
    ({"port_is_free": lambda _, port: port != 7447}, "session port", Level.FAIL, "listen elsewhere"),
    ({"port_is_free": lambda _, port: port != 8447}, "page port", Level.WARN, "monitor --port 0"),
]  # fmt: skip


def test_a_healthy_computer_is_all_ok(tmp_path):
    found = everything(healthy(tmp_path), settings())
    assert [one for one in found if one.level is not Level.OK] == []
    assert {one.subject for one in found} >= {"motor port", "lidar network", "scheduling", "disk", "session port"}


@pytest.mark.parametrize(("plant", "assignments", "subject", "level", "remedy"), FILES)
def test_a_planted_problem_is_the_only_one_found(plant, assignments, subject, level, remedy, tmp_path):
    computer = healthy(tmp_path)
    plant(computer)
    found = [one for one in everything(computer, settings(*assignments)) if one.level is not Level.OK]
    assert subject in {one.subject for one in found}
    of_it = next(one for one in found if one.subject == subject)
    assert (of_it.level, remedy in of_it.remedy) == (level, True), of_it
    also = {"service"} if plant in {vesc_without_a_name, modem_manager} else set()
    assert {one.subject for one in found} - also == {subject}


@pytest.mark.parametrize(("answers", "subject", "level", "remedy"), ANSWERS)
def test_a_planted_answer_is_the_only_problem_found(answers, subject, level, remedy, tmp_path):
    computer = changed(healthy(tmp_path), **answers)
    found = [one for one in everything(computer, settings()) if one.level is not Level.OK]
    of_it = next(one for one in found if one.subject == subject)
    assert (of_it.level, remedy in of_it.remedy) == (level, True), of_it
    assert {one.subject for one in found} <= {subject, "gamepad"}


def test_the_service_has_the_right_that_the_user_has_not(tmp_path):
    computer = changed(healthy(tmp_path), realtime_refusal=lambda: "Operation not permitted")
    assert worst(everything(computer, settings())) is Level.OK
    no_unit(computer)
    found = next(one for one in everything(computer, settings()) if one.subject == "scheduling")
    assert found.level is Level.WARN
    assert "let the service drive" in found.remedy


def test_a_port_that_this_very_car_has_is_all_right(tmp_path):
    computer = changed(healthy(tmp_path), port_is_free=lambda _host, port: port != 7447)
    assert worst(asyncio.run(check_access(computer, settings(), this_car))) is Level.OK
    assert worst(asyncio.run(check_access(computer, settings("car.name=other"), this_car))) is Level.FAIL


def test_an_own_law_with_a_mistake_is_a_fail(tmp_path, monkeypatch):
    (tmp_path / "broken_law_23.py").write_text("def\n")
    chosen = settings()
    monkeypatch.setattr("wallride.doctor.program.own_law_mistakes", lambda *_: ["broken_law_23: line 1"])
    found = next(one for one in check_program(healthy(tmp_path), chosen) if one.subject == "own laws")
    assert found.level is Level.FAIL
    assert "wallride check" in found.remedy


@pytest.mark.parametrize(
    ("words", "complete", "level", "remedy"),
    [
        ("30 of 30 functions of the hot path are compiled", True, Level.OK, ""),
        ("the hot path runs in Python (not built: wallride build-kernel)", False, Level.WARN, "apt install gcc"),
        ("29 of 30 ...; in Python: f (edited since its C was sealed)", False, Level.WARN, "--seal"),
    ],
)
def test_the_compiled_functions(words, complete, level, remedy):
    found = judge_kernel(words, complete=complete)
    assert found.level is level
    assert remedy in found.remedy
