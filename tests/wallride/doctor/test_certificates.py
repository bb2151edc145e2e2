"""Certificates: expired, about to expire, readable by all, missing."""

from datetime import UTC, datetime, timedelta

import pytest

from tests.wallride.doctor.fakes import NOW, changed, healthy, settings
from wallride.clients.keys.folder import KeyFolder
from wallride.doctor.access import check_access
from wallride.doctor.findings import Level
from wallride.runtime.wire.zenoh_config import Person, Role

MADE = datetime.fromtimestamp(NOW, UTC)


@pytest.fixture
def keys(tmp_path):
    folder = KeyFolder(tmp_path / "keys")
    folder.begin("car1", [], MADE, 90, renew=False)
    folder.add(Person("ann", Role.OPERATOR), tmp_path / "ann", MADE, 90, renew=False)
    return folder.path


async def judged(root, keys, after_days=0):
    chosen = settings(f"telemetry.keys_dir={keys}", 'telemetry.listen=["tls/[::]:7448"]')
    computer = changed(healthy(root), now_unix_s=(MADE + timedelta(days=after_days)).timestamp())
    return next(one for one in await check_access(computer, chosen) if one.subject == "certificates")


@pytest.mark.parametrize(
    ("after_days", "level", "words"),
    [(0, Level.OK, "1 people"), (70, Level.WARN, "in 20 days"), (100, Level.WARN, "expired")],
)
async def test_the_certificates_age(after_days, level, words, tmp_path, keys):
    found = await judged(tmp_path, keys, after_days)
    assert found.level is level
    assert words in found.words
    assert ("keys init --renew" in found.remedy) is (level is Level.WARN)


async def test_a_key_that_every_user_can_read(tmp_path, keys):
    (keys / "car.key").chmod(0o644)
    found = await judged(tmp_path, keys)
    assert found.level is Level.FAIL
    assert "chmod o-rwx" in found.remedy


async def test_no_keys_at_all(tmp_path):
    found = await judged(tmp_path, tmp_path / "none")
    assert found.level is Level.FAIL
    assert "wallride keys init" in f"{found.words} {found.remedy}"
