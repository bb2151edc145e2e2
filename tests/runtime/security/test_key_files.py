"""Wrong, missing, foreign and expired keys: each is said before zenoh sees it."""

import shutil
import sys
from datetime import UTC, datetime, timedelta

import pytest

from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.security.access_list import KeysError, read_people
from wallride.runtime.security.key_files import car_keys, car_session, client_keys
from wallride.runtime.wire.zenoh_config import Person, Role

NOW = datetime(2026, 5, 1, 12, tzinfo=UTC)


@pytest.fixture
def car(tmp_path):
    folder = KeyFolder(tmp_path / "car")
    folder.begin("car1", [], NOW, 365, renew=False)
    folder.add(Person("alice", Role.OPERATOR), tmp_path / "alice", NOW, 365, renew=False)
    return folder.path


@pytest.fixture
def alice(car):
    return car.parent / "alice"


@pytest.fixture
def other(tmp_path):
    folder = KeyFolder(tmp_path / "other")
    folder.begin("car1", [], NOW, 365, renew=False)
    folder.add(Person("alice", Role.OPERATOR), tmp_path / "other-alice", NOW, 365, renew=False)
    return folder.path


@pytest.mark.parametrize("name", ["ca.pem", "car.pem", "car.key", "people.toml"])
def test_a_missing_file_is_named(car, name):
    (car / name).unlink()
    with pytest.raises(KeysError, match=rf"{name}: no such file.*wallride keys init"):
        car_keys(car, NOW)


@pytest.mark.parametrize("name", ["ca.pem", "car.pem", "car.key"])
def test_a_damaged_file_is_named(car, name):
    (car / name).write_text("-----BEGIN CERTIFICATE-----\nnonsense\n-----END CERTIFICATE-----\n")
    with pytest.raises(KeysError, match=rf"{name}: is not a .* in PEM"):
        car_keys(car, NOW)


def test_a_directory_in_place_of_a_file_is_named(car):
    (car / "car.pem").unlink()
    (car / "car.pem").mkdir()
    with pytest.raises(KeysError, match=r"car\.pem: cannot be read"):
        car_keys(car, NOW)


def test_the_key_of_another_certificate_is_noticed(car, other):
    shutil.copy(other / "car.key", car / "car.key")
    with pytest.raises(KeysError, match=r"car\.key is not the key of .*car\.pem"):
        car_keys(car, NOW)


def test_the_authority_of_another_car_is_noticed_although_it_has_the_same_name(alice, other):
    shutil.copy(other / "ca.pem", alice / "ca.pem")
    with pytest.raises(KeysError, match="two different cars"):
        client_keys(alice, NOW)


def test_a_persons_files_are_no_cars_and_the_reverse(car, alice):
    for suffix in ("pem", "key"):
        shutil.copy(car / f"car.{suffix}", car / f"held.{suffix}")
        shutil.copy(alice / f"alice.{suffix}", car / f"car.{suffix}")
        shutil.copy(car / f"held.{suffix}", alice / f"alice.{suffix}")
    with pytest.raises(KeysError, match=r"certificate of a person.*keys init"):
        car_keys(car, NOW)
    with pytest.raises(KeysError, match=r"certificate of a car.*keys add NAME"):
        client_keys(alice, NOW)


def test_a_key_that_everybody_can_read_is_refused(alice):
    (alice / "alice.key").chmod(0o644)
    with pytest.raises(KeysError, match=r"chmod o-rwx .*alice\.key"):
        client_keys(alice, NOW)


def test_an_expired_person_is_told_how_to_renew_and_a_month_before_too(alice):
    assert client_keys(alice, NOW + timedelta(days=334)).warnings == ()
    (warning,) = client_keys(alice, NOW + timedelta(days=336)).warnings
    assert "in 29 days" in warning
    with pytest.raises(KeysError, match=r"expired on 2027-05-01.*wallride keys add alice --renew"):
        client_keys(alice, NOW + timedelta(days=366))


@pytest.mark.parametrize(("hours", "says"), [(48, "in 2 days"), (24, "in 1 day"), (13, "in 1 day"), (12, "today")])
def test_the_last_days_are_said_in_proper_words(alice, hours, says):
    (warning,) = client_keys(alice, NOW + timedelta(days=365, hours=-hours)).warnings
    assert f"expires on 2027-05-01, {says};" in f"{warning};"


def test_a_person_whose_clock_is_wrong_is_told_so(alice):
    with pytest.raises(KeysError, match=r"not valid before 2026-04-30.*believes that it is 1970-01-01; set the clock"):
        client_keys(alice, datetime(1970, 1, 1, tzinfo=UTC))


@pytest.mark.parametrize(
    ("days", "says"), [(-5000, "set the clock"), (366, "keys init --renew"), (350, "expires on 2027-05-01, in 15 days")]
)
def test_the_car_starts_whatever_the_time_is_and_says_what_is_wrong(car, days, says):
    keys = car_keys(car, NOW + timedelta(days=days))
    assert keys.people
    assert says in keys.warnings[0]


def test_a_car_that_lists_nobody_says_so(car):
    (car / "people.toml").write_text("# nobody\n")
    assert "no person is listed" in car_keys(car, NOW).warnings[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[alice]\nrole = 'king'\nexpires = 2027-01-01", "role must be one of viewer, operator, admin"),
        ("[alice]\nexpires = 2027-01-01", "role must be one of"),
        ("[alice]\nrole = ['admin']\nexpires = 2027-01-01", "role must be one of"),
        ("[alice]\nrole = 'admin'", "must be dates"),
        ("[alice]\nrole = 'admin'\nexpires = '2027-01-01'", "without quotes"),
        ("[alice]\nrole = 'admin'\nexpires = 2027-01-01\nrevoked = true", "must be dates"),
        ("[alice]\nrole = 'admin'\nexpires = 2027-01-01\nrevokd = 2026-01-01", "nothing else"),
        ("[alice]\nrole = 'admin'\nexpires = 2027-01-01\nrenewed = -1", "renewed must be a number"),
        ("[alice]\nrole = 'admin'\nexpires = 2027-01-01\nrenewed = true", "renewed must be a number"),
        ("[Alice]\nrole = 'admin'\nexpires = 2027-01-01", "is not a name"),
        ("alice = 'admin'", "nothing else"),
        ("[alice\n", "not valid TOML"),
        ("['']\nrole = 'admin'\nexpires = 2027-01-01", "is not a name"),
    ],
)
def test_a_list_that_is_not_understood_opens_no_door(tmp_path, text, says):
    path = tmp_path / "people.toml"
    path.write_text(text)
    with pytest.raises(KeysError, match=says) as problem:
        read_people(path)
    assert str(path) in str(problem.value)


def test_a_persons_folder_holds_one_key(tmp_path, alice):
    with pytest.raises(KeysError, match=r"no such folder.*wallride keys add NAME"):
        client_keys(tmp_path / "nowhere", NOW)
    (alice / "bob.key").write_text("")
    with pytest.raises(KeysError, match=r"2 keys \(alice, bob\)"):
        client_keys(alice, NOW)
    for path in alice.glob("*.key"):
        path.unlink()
    with pytest.raises(KeysError, match="no key instead of one"):
        client_keys(alice, NOW)


def test_keys_are_looked_at_only_where_an_address_needs_them(car, tmp_path):
    config, warnings = car_session(["tcp/127.0.0.1:7447"], tmp_path / "nowhere", "car1", NOW)
    assert "access_control" not in config
    assert warnings == ()
    config, warnings = car_session(["tls/[::]:7448"], car, "car1", NOW)
    assert config["access_control"]["subjects"][-1]["cert_common_names"] == ["alice"]
    assert warnings == ()
    with pytest.raises(KeysError, match="no such file"):
        car_session(["tls/[::]:7448"], tmp_path / "nowhere", "car1", NOW)


def test_a_missing_package_is_named(car, monkeypatch):
    monkeypatch.delitem(sys.modules, "wallride.runtime.security.certificates", raising=False)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(KeysError, match=r"pip install '\.\[keys\]'"):
        car_keys(car, NOW)
