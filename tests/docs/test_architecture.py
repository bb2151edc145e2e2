"""The tree and the layers of docs/architecture.md are those of the code."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TREE = PAGE.partition("## The tree")[2].partition("```\n\n")[0]


@pytest.mark.parametrize("folder", ["drivers", "runtime", "runtime/control"])
def test_the_tree_has_every_package(folder):
    packages = {file.parent.name for file in (ROOT / folder).glob("*/__init__.py")}
    lacking = sorted(packages - set(re.findall(r"(\w+)/", TREE)))
    assert not lacking, f"add {lacking} to the tree in docs/architecture.md"


def test_the_layers_of_the_runtime_are_those_of_the_contract():
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = config["tool"]["importlinter"]["contracts"]
    (layers,) = (one["layers"] for one in contracts if one.get("containers") == ["wallride.runtime"])
    assert f"`{' > '.join(layers)}`" in " ".join(PAGE.split()), "write the layers of pyproject.toml there"
