"""`wallride router FILE`: its folder starts at any place; a file that would let everyone in is refused."""

import argparse
import json
import shutil
from pathlib import Path

import pytest

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet.router import read_config
from wallride.clients.keys.command import run
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint

GUARDED = {
    "mode": "router",
    "listen": {"endpoints": ["tls/[::]:7449"]},
    "access_control": {"enabled": True, "default_permission": "deny"},
}


def test_a_guarded_configuration_is_read_with_its_comments(tmp_path):
    (file := tmp_path / "track.json5").write_text(f"// written\n{json.dumps(GUARDED, indent=2)}\n")
    assert read_config(file) == GUARDED


@pytest.mark.parametrize(
    ("part", "says"),
    [
        ({"mode": "peer"}, 'no mode "router":'),
        ({"listen": {"endpoints": []}}, r"no listen\.endpoints:"),
        ({"listen": 7}, r"no listen\.endpoints:"),
        ({"listen": {"endpoints": "tls/[::]:7449"}}, r"no listen\.endpoints:"),
        ({"listen": {"endpoints": [7]}}, r"no listen\.endpoints:"),
        ({"listen": {"endpoints": ["tls/[::]:7449#enable_mtls=false"]}}, r"no listen\.endpoints:"),
        ({"access_control": None}, "no access_control"),
        ({"access_control": {"enabled": False, "default_permission": "deny"}}, "no access_control that is enabled"),
        ({"access_control": {"enabled": True, "default_permission": "allow"}}, 'no .* with default_permission "deny"'),
        (dict.fromkeys(GUARDED), r'no mode "router", listen\.endpoints, access_control'),
    ],
)
def test_a_configuration_that_is_not_guarded_is_refused(tmp_path, part, says):
    (file := tmp_path / "track.json5").write_text(json.dumps(GUARDED | part))
    with pytest.raises(ConnectionProblemError, match=f"track.json5: has {says}.*wallride keys router"):
        read_config(file)


@pytest.mark.parametrize("text", ["[]", "{", "[" * 100_000])
def test_what_is_no_configuration_at_all_is_refused(tmp_path, text):
    (file := tmp_path / "track.json5").write_text(text)
    with pytest.raises(ConnectionProblemError, match="is not what `wallride keys router` wrote"):
        read_config(file)


def written(folder, at=None):
    """Return the folder of a router that `wallride keys router` wrote, and what it printed."""
    listen = [free_endpoint().replace("tcp/", "tls/")]
    options = argparse.Namespace(
        action="router", name="track", dir=folder, san=[], listen=listen, at=at, scan_hz=10.0, days=30, renew=False
    )
    return folder / "track", "\n".join(run(options, "unused"))


async def test_a_folder_that_was_copied_elsewhere_starts_there(tmp_path, monkeypatch):
    folder, said = written(tmp_path / "fleet")
    assert "wallride router track/track.json5" in said
    assert "cd track && zenohd -c track.json5" in said
    copy = tmp_path / "another computer" / "track"
    shutil.copytree(folder, copy)
    shutil.rmtree(tmp_path / "fleet")
    assert str(tmp_path) not in (copy / "track.json5").read_text()
    monkeypatch.chdir(copy.parent)
    bus = Bus(read_config(Path("track/track.json5")))
    await bus.open()
    assert bus.endpoint
    await bus.close()


def test_a_key_that_is_not_there_is_named_with_the_file_and_the_remedy(tmp_path):
    folder, said = written(tmp_path / "fleet", at=tmp_path / "there")
    assert f"wallride router {tmp_path / 'there' / 'track.json5'}" in said
    with pytest.raises(ConnectionProblemError) as caught:
        read_config(folder / "track.json5")
    message = str(caught.value)
    assert str(folder / "track.json5") in message
    assert str(tmp_path / "there" / "ca.pem") in message
    assert "wallride keys router track" in message
    assert "--at" in message


@pytest.mark.parametrize("transport", [[], {"link": {"tls": {"listen_private_key": 1}}}])
def test_keys_of_a_wrong_shape_are_refused(tmp_path, transport):
    (file := tmp_path / "track.json5").write_text(json.dumps(GUARDED | {"transport": transport}))
    with pytest.raises(ConnectionProblemError, match="is not what"):
        read_config(file)
