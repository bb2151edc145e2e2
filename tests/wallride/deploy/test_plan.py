"""A deployment's plan from a car's facts: what it does, and why it must not begin."""

from dataclasses import replace

import pytest

from wallride.deploy.closure import CarPlatform
from wallride.deploy.facts import CarPython, DeployError, InstalledVersion, read_facts
from wallride.deploy.plan import Wishes, make_plan, refuse_full_disk
from wallride.deploy.python_archive import read_archive
from wallride.deploy.ssh import explain

SAID = """machine=aarch64
libc=glibc 2.35
python=3.10.12 /usr/bin/python3.10
python=3.11.0 /usr/bin/python3.11
root=sudo
in_use=/opt/wallride-versions/20261101-080000
version=/opt/wallride-versions/20261101-080000 abc, deployed then
before=/opt/wallride-versions/20261001-080000
service=active
free_versions_kb=8000000
free_copies_kb=9000000
compiler=/usr/bin/gcc
state=disarmed
end=yes
"""
FACTS = read_facts(SAID)


def test_facts_are_read():
    assert (FACTS.machine, FACTS.glibc, FACTS.root, FACTS.state) == ("aarch64", (2, 35), "sudo", "disarmed")
    assert FACTS.pythons[1] == CarPython((3, 11, 0), "/usr/bin/python3.11")
    assert FACTS.versions == [InstalledVersion("/opt/wallride-versions/20261101-080000", "abc, deployed then")]
    assert (FACTS.busy, FACTS.has_compiler, FACTS.missing_tools) == (False, True, [])


@pytest.mark.parametrize(
    "text", ["", "Welcome to the shell\n", SAID.replace("end=yes\n", ""), SAID.replace("2.35", "x.y")]
)
def test_an_answer_that_is_none_or_cut_off_is_refused(text):
    with pytest.raises(DeployError, match="no usable answer"):
        read_facts(text)


def test_an_update():
    plan = make_plan(FACTS, Wishes())
    assert plan.platform == CarPlatform("aarch64", (2, 35), (3, 11, 0))
    assert list(plan.arguments) == [
        "--yes", "--wheelhouse", "wheelhouse", "--python", "/usr/bin/python3.11", "--keep", "3",
    ]  # fmt: skip
    assert "in use there: /opt/wallride-versions/20261101-080000 (abc, deployed then)" in plan.lines
    assert any("start the service, and watch it" in line for line in plan.lines)
    assert plan.warnings == []


@pytest.mark.parametrize(
    ("facts", "wishes", "flags"),
    [
        (replace(FACTS, in_use="", service="", state=""), Wishes(), ["--start"]),
        (replace(FACTS, in_use="", service="", state=""), Wishes(no_service=True), ["--no-service"]),
        (replace(FACTS, service="inactive", state=""), Wishes(), []),
        (replace(FACTS, service="inactive", state=""), Wishes(start=True), ["--start"]),
        (replace(FACTS, state="driving"), Wishes(force=True), ["--force"]),
    ],
)
def test_what_is_told_to_install_sh(facts, wishes, flags):
    assert list(make_plan(facts, wishes).arguments[7:]) == flags


def test_a_service_that_was_stopped_stays_so():
    lines = make_plan(replace(FACTS, service="inactive", state=""), Wishes()).lines
    assert "leave the service stopped, as it is" in lines


def test_a_rollback_needs_no_wheels():
    plan = make_plan(replace(FACTS, pythons=[]), Wishes(rollback=True))
    assert (plan.platform, list(plan.arguments)) == (None, ["--rollback"])


@pytest.mark.parametrize(
    ("changes", "wishes", "said"),
    [
        *(({"state": state}, Wishes(), f"the car is {state}") for state in ("armed", "driving", "limited", "stopped")),
        ({"state": "armed"}, Wishes(rollback=True), "the car is armed"),
        ({"state": ""}, Wishes(), "does not say whether it is armed"),
        ({"busy": True}, Wishes(), "another installation is going on"),
        ({"busy": True}, Wishes(force=True), "another installation is going on"),
        ({"root": "no"}, Wishes(), "no sudo"),
        ({"missing_tools": ["tar"]}, Wishes(), "the car lacks tar"),
        ({"pythons": FACTS.pythons[:1]}, Wishes(), r"/usr/bin/python3.10 \(3.10.12\)"),
        ({"pythons": []}, Wishes(), "there is: none"),
        ({}, Wishes(python="python3.13"), "python3.13 is none"),
        ({"glibc": None}, Wishes(), "no glibc"),
        ({"before": ""}, Wishes(rollback=True), "no version before"),
    ],
)
def test_a_car_that_must_not_be_touched(changes, wishes, said):
    with pytest.raises(DeployError, match=said):
        make_plan(replace(FACTS, **changes), wishes)


@pytest.mark.parametrize("state", ["disarmed", "waiting for device", "e-stopped", "fault (latched)", "starting"])
def test_a_car_that_cannot_move_is_updated(state):
    assert make_plan(replace(FACTS, state=state), Wishes()).arguments[0] == "--yes"


def test_a_python_can_be_chosen():
    pythons = [*FACTS.pythons, CarPython((3, 13, 1), "/opt/python/bin/python3.13")]
    for name in ("python3.13", "/opt/python/bin/python3.13"):
        assert make_plan(replace(FACTS, pythons=pythons), Wishes(python=name)).python == pythons[-1]


STEM = "cpython-3.12.7+20241016-aarch64-unknown-linux-gnu-install_only"


@pytest.fixture
def archive(tmp_path):
    file = tmp_path / f"{STEM}.tar.gz"
    file.write_text("")
    return read_archive(file)


def test_a_python_comes_along_where_the_car_has_none_and_only_then(archive):
    old = replace(FACTS, pythons=FACTS.pythons[:1])
    plan = make_plan(old, Wishes(archive=archive))
    assert (plan.brings, plan.platform.python) == (archive, (3, 12, 7))
    assert plan.arguments[4] == f"python/{STEM}.tar.gz"
    there = CarPython((3, 12, 7), f"/opt/wallride-versions/python/{STEM}/bin/python3.12")
    plan = make_plan(replace(old, pythons=[*old.pythons, there]), Wishes(archive=archive))
    assert (plan.brings, plan.arguments[4]) == (None, there.path)
    with pytest.raises(DeployError, match="--python FILE"):
        make_plan(old, Wishes())
    with pytest.raises(DeployError, match="is for aarch64, and the car is x86_64"):
        make_plan(replace(old, machine="x86_64"), Wishes(archive=archive))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("python.tar.gz", "is no archive"),
        (f"{STEM}.tar.gz".replace("gnu", "musl"), "is no archive"),
        (f"{STEM}.tar.gz".replace("3.12.7", "3.10.9"), "is Python 3.10"),
        (f"{STEM}.tar.gz".replace("aarch64", "armv7"), "is not there"),
    ],
)
def test_a_file_that_is_no_python_for_a_car_is_refused(name, said, tmp_path):
    if said != "is not there":
        (tmp_path / name).write_text("")
    with pytest.raises(DeployError, match=said):
        read_archive(tmp_path / name)


@pytest.mark.parametrize(
    ("here", "warned"),
    [
        (None, 1),
        (CarPlatform("x86_64", (2, 35), (3, 11, 2)), 1),
        (CarPlatform("aarch64", (2, 35), (3, 12, 2)), 1),
        (CarPlatform("aarch64", (2, 36), (3, 11, 2)), 1),
        (CarPlatform("aarch64", (2, 31), (3, 11, 9)), 0),
    ],
)
def test_without_a_compiler_on_the_car_the_wheel_must_bring_what_is_compiled(here, warned):
    assert len(make_plan(replace(FACTS, has_compiler=False), Wishes(), here).warnings) == warned


@pytest.mark.parametrize(
    ("copies_kb", "versions_kb", "what"), [(150_000, 9e9, "the copy"), (9e9, 400_000, "/opt/wallride-versions")]
)
def test_a_disk_that_is_too_full_is_refused(copies_kb, versions_kb, what):
    full = replace(FACTS, free_copies_kb=int(copies_kb), free_versions_kb=int(versions_kb))
    with pytest.raises(DeployError, match=f"too full for {what}"):
        refuse_full_disk(full, 60_000_000, 210_000_000)
    refuse_full_disk(FACTS, 60_000_000, 210_000_000)


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("Host key verification failed.", "its host key is not known"),
        ("@ WARNING: REMOTE HOST IDENTIFICATION HAS CHANGED! @\nHost key verification failed.", "has changed"),
        ("me@car: Permission denied (publickey).", "ssh-copy-id me@car"),
        ("ssh: Could not resolve hostname car: Name or service not known", "give its address"),
        ("ssh: connect to host car port 22: Connection refused", "no ssh server answers"),
        ("ssh: connect to host car port 22: Connection timed out", "is it on"),
        ("ssh: connect to host car port 22: No route to host", "is it on"),
        ("kex_exchange_identification: banner line contains invalid characters", "banner line"),
        ("", "without a word"),
    ],
)
def test_errors_of_ssh_have_a_remedy(said, remedy):
    assert remedy in explain("me@car", said)
