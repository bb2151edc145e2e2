"""`wallride vesc`: changes of an emulated controller's configuration, what keeps them from being made, and faults."""

import asyncio
import json
from pathlib import Path

import pytest

from tests.wallride.doctor.fakes import changed, healthy, link, settings
from wallride.drivers.address import parse_address
from wallride.drivers.link import open_link
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.app_config import change_app_config, decode_app_config
from wallride.sim.devices.vesc import VescEmulator
from wallride.vesc import change
from wallride.vesc.change import SettingsWish, VescAccess, VescChangeError, recommended
from wallride.vesc.port import refuse_taken_port


class Rig:
    """An emulated controller as it is sold, and a person who agrees to everything."""

    def __init__(self, folder, firmware=(6, 5)):
        self.folder, self.said, self.asked = folder, [], 0
        self.vesc = VescEmulator(
            folder / "vesc", firmware=firmware, clock=asyncio.get_running_loop().time, timeout_s=1.0,
            timeout_brake_a=0.0,
        )  # fmt: skip
        self.vesc.config.servo_output = False
        self.agrees, self.as_it_was = True, self.vesc.config.told(firmware)
        self.vesc.start()

    def access(self):
        return VescAccess(
            parse_address(f"serial://{self.vesc.link}"), self.folder / "kept", self.said.append, self.agree
        )

    def agree(self):
        self.asked += 1
        return self.agrees

    async def set(self, wish=None):
        return await change.set_values(self.access(), wish or recommended())

    def kept(self):
        return sorted((self.folder / "kept").glob("*.json"))

    @property
    def configuration(self):
        return self.vesc.config.told(self.vesc.firmware)[1:]

    def written(self):
        return [payload for _, payload in self.vesc.wire if payload[0] == codec.Packet.SET_APPCONF]


@pytest.fixture
async def rig(tmp_path):
    one = Rig(tmp_path)
    yield one
    one.vesc.close()


def values(rig):
    config = decode_app_config(rig.configuration)
    return config.timeout_s, config.timeout_brake_a, config.servo_output


async def test_what_protects_a_car_is_set_and_kept_over_a_power_cycle_and_taken_back(rig):
    assert await rig.set() == 0, rig.said
    assert values(rig) == (0.15, 10.0, True)
    assert any("1000 ms  ->  150 ms" in line for line in rig.said)
    assert any("as wanted" in line for line in rig.said)
    rig.vesc.reboot()
    rig.vesc.replug()
    assert values(rig) == (0.15, 10.0, True)
    assert rig.vesc.demand(asyncio.get_running_loop().time() + 0.2).value == 10.0, "and it brakes so after so long"
    (kept,) = rig.kept()
    assert await change.restore(rig.access(), kept) == 0
    assert values(rig) == (1.0, 0.0, False)
    assert await change.restore(rig.access(), kept) == 0
    assert rig.said[-1].endswith("nothing to do")


async def test_all_other_bytes_stay_and_no_motor_command_is_sent(rig):
    await rig.set()
    (request,) = rig.written()
    changed_places = {place for place in range(278) if request[1 + place] != rig.as_it_was[1 + place]}
    assert changed_places == {7, 8, 9, 10, 31}  # 1000 -> 150 ms, 0 -> 10 A, servo output
    assert rig.vesc.motor_wire() == []
    assert rig.vesc.servo == 0.5


async def test_only_what_is_named_changes(rig):
    assert await rig.set(SettingsWish(timeout_s=0.1)) == 0
    assert values(rig) == (0.1, 0.0, False)


async def test_a_second_time_there_is_nothing_to_do(rig):
    await rig.set()
    assert await rig.set() == 0
    assert (len(rig.written()), rig.asked, len(rig.kept())) == (1, 1, 1)


async def test_without_consent_nothing_is_written(rig):
    rig.agrees = False
    assert await rig.set() == 0
    assert (rig.asked, rig.written(), rig.kept()) == (1, [], [])


@pytest.mark.parametrize("firmware", [(3, 60), (3, 62), (4, 2), (5, 2), (5, 3), (6, 0), (6, 5), (7, 0)])
async def test_every_known_firmware(firmware, tmp_path):
    one = Rig(tmp_path, firmware)
    assert await one.set() == 0, one.said
    assert values(one) == (0.15, 10.0, True if firmware >= (5, 3) else None)
    one.vesc.close()


async def refused(rig, *words, wish=None):
    """Nothing is written, and the sentence has these words."""
    before = rig.configuration
    with pytest.raises(VescChangeError) as error:
        await rig.set(wish)
    assert [word for word in words if word not in str(error.value)] == [], error.value
    assert rig.configuration == before


async def test_an_unknown_layout_is_told_what_to_set_by_hand(rig):
    rig.vesc.config.signature = 12345
    await refused(rig, "Timeout 150 ms, Timeout Brake Current 10 A", "Enable Servo Output", "VESC Tool")
    rig.vesc.config.signature = None
    rig.vesc.firmware = (6, 4)
    await refused(rig, "firmware 6.04", "not known")
    assert rig.written() == []


async def test_a_servo_output_that_is_not_there_is_not_set(rig):
    rig.vesc.firmware = (5, 2)
    await refused(rig, "5.03 or later", wish=SettingsWish(servo_output=True))


async def test_a_rolling_car_is_left_alone(rig):
    rig.vesc.report(erpm=900)
    await refused(rig, "the wheels turn")
    rig.vesc.report(erpm=0)

    async def push():
        for step in range(400):
            rig.vesc.report(erpm=120, tachometer=step)
            await asyncio.sleep(0.01)

    pushing = asyncio.create_task(push())
    await refused(rig, "the wheels turn")
    pushing.cancel()
    assert rig.written() == []


async def test_a_controller_that_gets_commands_is_left_alone(rig):
    async def command():
        while True:
            rig.vesc._on_payload(codec.set_brake_current(5.0))
            await asyncio.sleep(0.02)

    other = asyncio.create_task(command())
    await asyncio.sleep(0.1)
    await refused(rig, "a program commands the motor")
    other.cancel()
    assert rig.written() == []


async def test_a_port_that_another_program_has_is_left_alone(rig):
    other = await open_link(rig.access().address, asyncio.get_running_loop().time)
    await refused(rig, "another program holds it")
    other.close()


async def test_a_running_service_keeps_its_port(tmp_path):
    one = changed(healthy(tmp_path / "root"), devices=Path("/"))
    chosen = settings("motor.address=serial:///dev/none-23")
    with pytest.raises(VescChangeError, match="not there now"):
        refuse_taken_port(one, chosen)
    link(tmp_path / "root", "run/systemd/units/invocation:wallride.service", "1234abcd")
    with pytest.raises(VescChangeError, match="service runs"):
        refuse_taken_port(one, chosen)


async def test_without_a_copy_nothing_is_written(rig):
    (rig.folder / "kept").write_text("a file where the folder should be")
    await refused(rig, "without a copy")
    assert rig.written() == []


@pytest.mark.parametrize(("fault", "words"), [("refused", "wrong signature"), ("mute", "did not take it")])
async def test_a_refused_write_changes_nothing_and_is_said(rig, fault, words):
    rig.vesc.config.fault = fault
    await refused(rig, words, "VESC Tool")


async def test_a_byte_that_changes_unasked_is_found(rig):
    rig.vesc.config.fault = "spoiled"
    assert await rig.set() == 3
    assert "1 bytes are not as wanted (first at 277)" in rig.said[-1]
    assert f"restore {rig.kept()[0]}" in rig.said[-1]
    rig.vesc.config.fault = ""
    assert await change.restore(rig.access(), rig.kept()[0]) == 0
    assert rig.vesc.config.told((6, 5)) == rig.as_it_was


@pytest.mark.parametrize(("fault", "stored"), [("cut before", False), ("cut after", True)])
async def test_a_cable_that_is_pulled_in_the_middle(rig, fault, stored):
    rig.vesc.config.fault = fault

    async def plug_in_again():
        while not rig.written():
            await asyncio.sleep(0.01)
        rig.vesc.config.fault = ""
        await asyncio.sleep(0.1)
        rig.vesc.replug()

    plugging = asyncio.create_task(plug_in_again())
    if stored:
        assert await rig.set() == 3
        assert "did not confirm that it stored it" in "".join(rig.said)
        assert values(rig) == (0.15, 10.0, True)
    else:
        await refused(rig, "did not take it", "nothing was changed")
    await plugging


async def test_a_cable_that_stays_pulled_is_an_unknown_state(rig):
    rig.vesc.config.fault = "cut after"
    assert await rig.set() == 3
    assert "the values before or the new ones" in rig.said[-1]
    assert str(rig.kept()[0]) in rig.said[-1]


async def test_a_damaged_frame_is_not_taken(rig, monkeypatch):
    whole = codec.frame

    def damaged(payload):
        data = whole(payload)
        return data[:-40] + bytes(40) if payload[0] == codec.Packet.SET_APPCONF else data

    monkeypatch.setattr(codec, "frame", damaged)
    await refused(rig, "did not take it")


async def test_a_copy_without_a_command_timeout_is_not_written_back(rig):
    await rig.set()
    file = rig.kept()[0]
    kept = json.loads(file.read_text())
    without = change_app_config(
        bytes.fromhex(kept["configuration"]), timeout_s=0.0, timeout_brake_a=0.0, servo_output=True
    )
    file.write_text(json.dumps(kept | {"configuration": without.hex()}))
    with pytest.raises(VescChangeError, match="keeps its speed when this computer hangs; it is not written back"):
        await change.restore(rig.access(), file)
    assert len(rig.written()) == 1
    assert values(rig)[0] == 0.15


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda text: text | {"uuid": "00" * 12}, "another VESC"),
        (lambda text: text | {"configuration": "00000001" + text["configuration"][8:]}, "another than"),
        (lambda text: text | {"configuration": text["configuration"][:-2]}, "another than"),
        (lambda text: text | {"configuration": "xyz"}, "no copy"),
        (lambda text: {}, "no copy"),
        (lambda text: [], "no copy"),
    ],
)
async def test_a_copy_of_something_else_is_not_restored(spoil, words, rig):
    await rig.set()
    file = rig.kept()[0]
    file.write_text(json.dumps(spoil(json.loads(file.read_text()))))
    with pytest.raises(VescChangeError, match=words):
        await change.restore(rig.access(), file)
    with pytest.raises(VescChangeError, match="No such file"):
        await change.restore(rig.access(), rig.folder / "none.json")
    assert len(rig.written()) == 1


async def test_a_controller_that_is_to_brake_with_no_current_is_told_so(rig):
    await rig.set(SettingsWish(0.5, 0.0, None))
    assert "  WITHOUT a brake current the car rolls on when its computer falls silent" in rig.said
    rig.said.clear()
    await rig.set()
    assert not any("WITHOUT" in line for line in rig.said)
