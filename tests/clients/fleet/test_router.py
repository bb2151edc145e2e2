"""`wallride router FILE`: a file that would let everyone in is refused, with the place and the remedy."""

import json

import pytest

from clients.connection import ConnectionProblemError
from clients.fleet.router import read_config

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
