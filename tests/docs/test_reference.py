"""docs/reference is what the code says today, and names every topic and question that there is."""

import pytest

from wallride import reference
from wallride.runtime.wire import topics, zenoh_config


@pytest.mark.parametrize("name", ["settings.md", "topics.md", "commands.md", "states.md"])
def test_the_page_is_what_the_code_says(name):
    written = (reference.FOLDER / name).read_text(encoding="utf-8")
    assert written == reference.pages()[name], f"docs/reference/{name} is stale: run  {reference.COMMAND}"


TOKENS = {topics.ALIVE, topics.PLAYED, topics.REFUSED}


def test_every_published_topic_has_a_meaning():
    constants = {
        value
        for name, value in vars(topics).items()
        if name.isupper() and isinstance(value, str) and name != "ROOT" and not name.startswith("_")
    }
    towards = {key.split("/")[0] for key, *_ in reference.TO_THE_CAR}
    published = {topic for topic in constants if topic.split("/")[0] not in {*towards, *TOKENS}}
    told = {*topics.TELEMETRY, topics.BEAT}
    assert not published - told, f"add {sorted(published - told)} to TELEMETRY in runtime/wire/topics.py"
    assert set(reference.MEANINGS) == told


def test_every_question_and_its_role_is_what_a_car_grants():
    prefix = topics.key("car", "")
    granted = {
        key.removeprefix(prefix): str(grant.role.value)
        for grant in zenoh_config.grants("car")
        if grant.messages[0] in {"query", "put"} and grant.flow == "ingress"
        for key in grant.keys
    }
    granted |= {
        key.removeprefix(prefix): "planner NAME"
        for grant in zenoh_config.planner_grants("car", "NAME", None)
        if grant.flow == "ingress"
        for key in grant.keys
    }
    assert granted == {key: role for key, _, role, _ in reference.TO_THE_CAR if key != topics.SIMULATOR}


def test_commands_are_listed_down_to_the_last():
    page = reference.commands_page()
    for command in (
        "wallride run",
        "wallride param set",
        "wallride keys add",
        "wallride lab walls",
        "wallride bench cpu",
    ):
        assert f"### {command}\n" in page or f"## {command}\n" in page
    assert "`--obstacle TEXT`" in page
