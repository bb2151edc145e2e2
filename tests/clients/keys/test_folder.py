"""The folder of keys: what is made, who may read it, and which names must never come to life again."""

import os
import stat
import threading
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from wallride.clients.keys.authority import Authority
from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.security.access_list import KeysError
from wallride.runtime.security.certificates import common_name, read_identity
from wallride.runtime.security.key_files import car_keys, client_keys, uplink_sessions
from wallride.runtime.wire.router_config import router_access_control
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, access_control

NOW = datetime(2026, 5, 1, 12, tzinfo=UTC)
ALICE = Person("alice", Role.OPERATOR)
ROUTER = "tls/track.local:7449"


@pytest.fixture
def folder(tmp_path):
    folder = KeyFolder(tmp_path / "car")
    folder.begin("car1", ["10.0.0.5", "pit.example"], NOW, 365, renew=False)
    return folder


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def certificate(path):
    return x509.load_pem_x509_certificate(path.read_bytes())


def test_the_car_and_a_person_can_use_what_was_made(folder, tmp_path):
    entry = folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    assert entry.expires == date(2026, 5, 31)
    car, alice = car_keys(folder.path, NOW), client_keys(tmp_path / "alice", NOW - timedelta(hours=3))
    assert car.people == (ALICE,)
    assert (car.warnings, alice.identity.name, alice.identity.role) == ((), "alice", "operator")
    assert {"car1", "car1.local", "localhost", "127.0.0.1", "10.0.0.5", "pit.example"} <= set(car.identity.names)
    assert car.tls == Tls(folder.path / "ca.pem", folder.path / "car.pem", folder.path / "car.key")


def test_only_their_owner_reads_keys(folder, tmp_path):
    before = os.umask(0)
    try:
        folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    finally:
        os.umask(before)
    assert mode(tmp_path / "alice") == 0o700
    assert {path.name: mode(path) for path in (tmp_path / "alice").iterdir()} == {
        "ca.pem": 0o644,
        "alice.pem": 0o644,
        "alice.key": 0o600,
    }
    assert mode(folder.path / "ca.key") == 0o600
    assert mode(folder.path / "car.key") & 0o007 == 0


def test_a_person_cannot_serve_and_a_car_cannot_ask(folder, tmp_path):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    usages = [
        list(certificate(path).extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
        for path in (tmp_path / "alice/alice.pem", folder.path / "car.pem")
    ]
    assert usages == [[ExtendedKeyUsageOID.CLIENT_AUTH], [ExtendedKeyUsageOID.SERVER_AUTH]]
    assert not certificate(folder.path / "car.pem").extensions.get_extension_for_class(x509.BasicConstraints).value.ca


def test_renewed_keys_end_the_ones_before_also_revoked_ones(folder, tmp_path):
    folder.add(ALICE, tmp_path / "0", NOW, 30, renew=False)
    for renewal, days in ((1, 10), (2, 10), (3, 50)):  # the last one after its certificate has expired
        folder.revoke("alice", NOW.date())
        assert car_keys(folder.path, NOW).people == ()
        if days == 10:
            with pytest.raises(KeysError, match="is there already, revoked on 2026-05-01; --renew"):
                folder.add(ALICE, tmp_path / "new", NOW, 30, renew=False)
        entry = folder.add(ALICE, tmp_path / f"{renewal}", NOW + timedelta(days=days), 30, renew=days == 10)
        assert entry.person == Person("alice", Role.OPERATOR, renewal)
        shown = [common_name(certificate(tmp_path / f"{number}" / "alice.pem")) for number in range(renewal + 1)]
        subjects = access_control(car_keys(folder.path, NOW).people, "car1")["subjects"]
        listed = {name for subject in subjects for name in subject.get("cert_common_names", ())}
        assert [name in listed for name in shown] == [False] * renewal + [True]
        assert client_keys(tmp_path / f"{renewal}", NOW + timedelta(days=days)).identity.name == "alice"


def test_a_renewed_car_and_planner_are_known_to_a_router_by_their_newest_keys():
    people = [Person("car1", Role.CAR, 2), Person("lane", Role.PLANNER, 1), Person("bob", Role.ADMIN, 3)]
    found = {one["id"]: one["cert_common_names"] for one in router_access_control(people)["subjects"]}
    assert (found["car-car1"], found["planner-lane"], found["admin"]) == (["car1.2"], ["lane.1"], ["bob.3"])


def test_a_revocation_beside_an_addition_is_not_lost(folder, tmp_path, monkeypatch):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    revoking = threading.Thread(target=lambda: KeyFolder(folder.path).revoke("alice", NOW.date()))
    certify = Authority.certify_person

    def while_another_revokes(*arguments):
        revoking.start()
        revoking.join(0.2)  # which it does not, because the list is held
        return certify(*arguments)

    monkeypatch.setattr(Authority, "certify_person", while_another_revokes)
    folder.add(Person("bob", Role.VIEWER), tmp_path / "bob", NOW, 30, renew=False)
    revoking.join()
    assert [(entry.person.name, entry.revoked) for entry in folder.people()] == [("alice", NOW.date()), ("bob", None)]


def tries(folder, tmp_path):
    """Yield what writes into the folder."""
    yield lambda: folder.begin("car1", [], NOW, 30, renew=True)
    yield lambda: folder.add(Person("bob", Role.VIEWER), tmp_path / "bob", NOW, 30, renew=False)
    yield lambda: folder.revoke("alice", NOW.date())


@pytest.mark.parametrize(
    ("name", "mode", "says"),
    [
        ("", 0o777, "every user may write"),
        ("people.toml", 0o666, "every user may write"),
        ("ca.pem", 0o646, "every user may write"),
        ("ca.key", 0o644, "other users may read this key"),
    ],
)
def test_a_folder_that_others_may_change_is_refused_and_named(folder, tmp_path, name, mode, says):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    assert car_keys(folder.path, NOW).warnings == ()
    (folder.path / name).chmod(mode)
    before = {path.name: path.read_bytes() for path in folder.path.iterdir()}
    for write in tries(folder, tmp_path):
        with pytest.raises(KeysError, match=f"nothing was written: .*{says}"):
            write()
    assert {path.name: path.read_bytes() for path in folder.path.iterdir()} == before
    assert any(says in warning for warning in car_keys(folder.path, NOW).warnings), "of the log, check and doctor"


def test_a_folder_of_another_user_or_behind_their_link_is_refused(folder, tmp_path, monkeypatch):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    monkeypatch.setattr(os, "geteuid", lambda: 4242)  # nothing here is this user's but what is root's
    if folder.path.stat().st_uid == 0:
        os.chown(folder.path, 4243, -1)
    for write in tries(folder, tmp_path):
        with pytest.raises(KeysError, match="belongs to user"):
            write()
    if os.getuid() == 0:
        os.chown(folder.path, 0, -1)
        (tmp_path / "link").symlink_to(folder.path)
        os.chown(tmp_path / "link", 4243, -1, follow_symlinks=False)
        with pytest.raises(KeysError, match="link belongs to user"):
            KeyFolder(tmp_path / "link").revoke("alice", NOW.date())


def test_a_folder_that_is_exchanged_after_the_look_at_it_is_not_written_into(folder, tmp_path, monkeypatch):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    elsewhere = tmp_path / "elsewhere"

    def look_too_early(path):
        if not path.is_symlink():
            path.rename(elsewhere)
            path.symlink_to(elsewhere)
        return []

    monkeypatch.setattr("wallride.clients.keys.folder.open_to_others", look_too_early)
    before = {path.name: path.read_bytes() for path in folder.path.iterdir()}
    for write in tries(folder, tmp_path):
        with pytest.raises(OSError, match=r"Not a directory|symbolic links"):
            write()
    elsewhere.rename(folder.path.with_name("theirs"))
    folder.path.unlink()
    folder.path.with_name("theirs").rename(folder.path)
    monkeypatch.setattr("wallride.clients.keys.folder.open_to_others", lambda _: [])
    monkeypatch.setattr(os, "geteuid", lambda: 4242)  # another user's, by its descriptor
    if folder.path.stat().st_uid == 0:
        os.chown(folder.path, 4243, -1)
    for write in tries(folder, tmp_path):
        with pytest.raises(KeysError, match="another user put a folder of their own there"):
            write()
    assert {path.name: path.read_bytes() for path in folder.path.iterdir()} == before


def test_the_cars_key_is_given_to_the_service_before_it_has_its_name(tmp_path, monkeypatch):
    given = []
    monkeypatch.setattr("wallride.clients.keys.folder._service_group", lambda: 77)
    monkeypatch.setattr(
        os, "fchown", lambda file, *owner: given.append((Path(f"/proc/self/fd/{file}").readlink().name, owner))
    )
    for by_name in ("chown", "chmod", "lchown"):
        monkeypatch.setattr(os, by_name, lambda *_, **__: pytest.fail("by name: another file may have it by now"))
    KeyFolder(tmp_path / "car").begin("car1", [], NOW, 30, renew=False)
    assert given == [("car.key.new", (-1, 77))]
    assert mode(tmp_path / "car" / "car.key") == 0o640


def test_revoking_again_keeps_the_first_day_and_revoking_nobody_says_who_there_is(folder, tmp_path):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    folder.revoke("alice", date(2026, 5, 2))
    assert folder.revoke("alice", date(2026, 5, 9)).revoked == date(2026, 5, 2)
    with pytest.raises(KeysError, match=r"bob: is not in .*people\.toml; there is alice"):
        folder.revoke("bob", NOW.date())


def test_a_name_is_given_twice_only_on_purpose(folder, tmp_path):
    folder.add(ALICE, tmp_path / "1", NOW, 30, renew=False)
    with pytest.raises(KeysError, match=r"there already, as operator; --renew"):
        folder.add(Person("alice", Role.ADMIN), tmp_path / "2", NOW, 30, renew=False)
    folder.add(Person("alice", Role.VIEWER), tmp_path / "2", NOW, 60, renew=True)
    (entry,) = folder.people()
    assert (entry.person.role, entry.expires) == (Role.VIEWER, date(2026, 6, 30))


@pytest.mark.parametrize("name", ["Alice", "a b", "", "-a", "a/b", "../a", "a" * 25, "älice", "a]\nrole", "car", "ca"])
def test_names_that_would_break_something_are_refused(folder, tmp_path, name):
    with pytest.raises(KeysError, match="name"):
        folder.add(Person(name, Role.VIEWER), tmp_path / "x", NOW, 30, renew=False)
    assert folder.people() == ()


def test_a_car_has_keys_under_every_name_that_its_settings_take(tmp_path):
    name = "a" * 32
    assert CarSettings(name=name).name == name
    fleet = KeyFolder(tmp_path / "fleet")
    fleet.make_router("track", [], NOW, 30, renew=False)
    fleet.add(Person(name, Role.CAR), tmp_path / "keys", NOW, 30, renew=False)
    assert [entry.person.name for entry in fleet.people()] == [name]
    assert len(uplink_sessions([ROUTER], tmp_path / "keys", name, NOW, (), Role.OPERATOR)[0]) == 1, (
        "the car connects with them"
    )
    with pytest.raises(KeysError, match=r"is not a car's name; names are 1 to 32"):
        fleet.add(Person("a" * 33, Role.CAR), tmp_path / "more", NOW, 30, renew=False)
    with pytest.raises(KeysError, match=r"is not a name; names are 1 to 24"):
        fleet.add(Person("a" * 25, Role.PLANNER), tmp_path / "more", NOW, 30, renew=False)


@pytest.mark.parametrize("days", [-400, 400])
def test_a_car_of_a_fleet_starts_whatever_the_time_is_and_says_what_is_wrong(tmp_path, days):
    fleet = KeyFolder(tmp_path / "fleet")
    fleet.make_router("track", (), NOW, 90, renew=False)
    fleet.add(Person("car1", Role.CAR), tmp_path / "car1-keys", NOW, 90, renew=False)
    later = NOW + timedelta(days=days)
    configs, warnings = uplink_sessions([ROUTER], tmp_path / "car1-keys", "car1", later, (), Role.OPERATOR)
    assert len(configs) == 1
    assert warnings[0].startswith("nothing goes to a router: ")
    with pytest.raises(KeysError):
        client_keys(tmp_path / "car1-keys", later)


def test_init_neither_overwrites_nor_guesses(folder):
    authority = (folder.path / "ca.pem").read_bytes()
    with pytest.raises(KeysError, match=r"has keys already; --renew"):
        folder.begin("car1", [], NOW, 365, renew=False)
    before = (folder.path / "car.pem").read_bytes()
    folder.begin("car1", [], NOW, 365, renew=True)
    assert (folder.path / "ca.pem").read_bytes() == authority
    assert (folder.path / "car.pem").read_bytes() != before
    (folder.path / "ca.key").unlink()
    with pytest.raises(KeysError, match="only one of"):
        folder.begin("car1", [], NOW, 365, renew=True)


def test_renewing_keeps_people(folder, tmp_path):
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    folder.begin("car1", [], NOW, 365, renew=True)
    assert [entry.person for entry in folder.people()] == [ALICE]


@pytest.mark.parametrize("san", ["two words", "tls/car1:7448", "", "-x", "a," * 3])
def test_a_wrong_san_is_named(tmp_path, san):
    with pytest.raises(KeysError, match=r"--san .*neither a host name nor an IP address"):
        KeyFolder(tmp_path).begin("car1", [san], NOW, 365, renew=False)


@pytest.mark.parametrize("car", ["Car1", "*", "a/b", "**", ""])
def test_a_wrong_name_of_the_car_is_refused(tmp_path, car):
    with pytest.raises(KeysError, match="not a car's name"):
        KeyFolder(tmp_path / "new").begin(car, [], NOW, 365, renew=False)
    assert not (tmp_path / "new").exists()


def test_adding_before_init_says_so(tmp_path):
    with pytest.raises(KeysError, match="wallride keys init"):
        KeyFolder(tmp_path).add(ALICE, tmp_path / "alice", NOW, 30, renew=False)


def test_the_authoritys_key_may_be_kept_elsewhere(folder, tmp_path):
    (folder.path / "ca.key").rename(tmp_path / "ca.key")
    assert car_keys(folder.path, NOW).identity.name == "car1"
    with pytest.raises(KeysError, match=r"ca\.key: is not here; put it back"):
        folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    (tmp_path / "ca.key").rename(folder.path / "ca.key")
    folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)


def test_a_folder_that_is_there_is_not_touched(folder, tmp_path):
    (tmp_path / "alice").mkdir()
    with pytest.raises(KeysError, match="--out"):
        folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    assert folder.people() == ()


def test_nothing_outlives_the_authority(folder, tmp_path):
    with pytest.raises(KeysError, match=r"ends on 2036.*--days"):
        folder.add(ALICE, tmp_path / "alice", NOW + timedelta(days=3500), 365, renew=False)


def test_an_authority_with_the_wrong_key_is_noticed(folder, tmp_path):
    other = KeyFolder(tmp_path / "other")
    other.begin("car1", [], NOW, 365, renew=False)
    (folder.path / "ca.key").write_bytes((other.path / "ca.key").read_bytes())
    with pytest.raises(KeysError, match=r"ca\.key is not the key of ca\.pem"):
        folder.add(ALICE, tmp_path / "alice", NOW, 30, renew=False)
    assert read_identity(car_keys(folder.path, NOW).tls, for_car=True).name == "car1"


def test_under_sudo_the_folder_is_given_away_last_and_no_link_is_followed(folder, tmp_path, monkeypatch):
    given = []
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(
        os, "fchown", lambda file, *owner: given.append((str(Path(f"/proc/self/fd/{file}").readlink()), owner))
    )
    monkeypatch.setattr(os, "chown", lambda *_, **__: pytest.fail("by name: another file may have it by now"))
    monkeypatch.setenv("SUDO_UID", "1234")
    monkeypatch.setenv("SUDO_GID", "1235")
    mine = tmp_path / "alice-keys"
    folder.add(ALICE, mine, NOW, 30, renew=False)
    names = [path for path, _ in given]
    assert sorted(names[:-1]) == [str(mine / name) for name in ("alice.key", "alice.pem", "ca.pem")]
    assert names[-1] == str(mine)
    assert {owner for _, owner in given} == {(1234, 1235)}
    given.clear()
    opened, bobs = os.open, tmp_path / "bobs-keys"

    def open_a_moment_late(path, flags, *rest, **how):
        if path == "ca.pem" and not flags & os.O_CREAT:
            (bobs / "ca.pem").unlink()
            (bobs / "ca.pem").symlink_to("/etc/passwd")
        return opened(path, flags, *rest, **how)

    monkeypatch.setattr(os, "open", open_a_moment_late)
    with pytest.raises(OSError, match="symbolic links"):
        folder.add(Person("bob", Role.VIEWER), bobs, NOW, 30, renew=False)
    assert not [path for path, _ in given if path in {"/etc/passwd", str(bobs)}]
