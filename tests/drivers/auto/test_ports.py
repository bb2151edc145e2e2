"""Where a lidar is looked for: every serial port once, never the motor's."""

from wallride.drivers.auto.ports import places
from wallride.drivers.hokuyo.settings import HokuyoSettings

USUAL = HokuyoSettings().address


def plug(devices, *names):
    """Make ports of a fake /dev; a name with "->" is a link."""
    for name in names:
        link, _, target = name.partition("->")
        path = devices / link
        path.parent.mkdir(parents=True, exist_ok=True)
        if target:
            path.symlink_to(devices / target)
        else:
            path.touch()


def test_an_address_that_is_named_is_the_only_one(tmp_path):
    plug(tmp_path, "ttyUSB0")
    assert places("tcp://10.0.0.1:1", "serial:///dev/x", tmp_path) == ["tcp://10.0.0.1:1"]


def test_each_port_is_looked_at_once_by_the_name_that_stays(tmp_path):
    plug(tmp_path, "ttyUSB0", "ttyACM3", "serial/by-id/usb-CP2102->ttyUSB0")
    assert places("", "serial:///dev/x", tmp_path) == [
        f"serial://{tmp_path}/serial/by-id/usb-CP2102",
        f"serial://{tmp_path}/ttyACM3",
        USUAL,
    ]


def test_nothing_is_sent_to_the_port_of_the_motor(tmp_path):
    plug(tmp_path, "ttyACM0", "ttyUSB0", "wallride-vesc->ttyACM0", "serial/by-id/usb-STM->ttyACM0")
    found = places("", f"serial://{tmp_path}/wallride-vesc?baud=115200", tmp_path)
    assert found == [f"serial://{tmp_path}/ttyUSB0", USUAL]


def test_an_own_motors_address_in_another_form_takes_no_port(tmp_path):
    plug(tmp_path, "ttyUSB0")
    assert places("", "can0", tmp_path) == [f"serial://{tmp_path}/ttyUSB0", USUAL]
