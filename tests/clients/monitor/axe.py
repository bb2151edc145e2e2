"""axe-core in a page: the rules of WCAG as a program. The script is a file of the package axe-playwright-python."""

import importlib.util
import json
from pathlib import Path

GRAVE = {"serious", "critical"}


def script():
    """Return axe-core's source; `make` installs the package that carries it."""
    found = importlib.util.find_spec("axe_playwright_python")
    assert found is not None, "axe-core is missing: run make, or pip install --no-deps axe-playwright-python"
    assert found.submodule_search_locations is not None
    return (Path(found.submodule_search_locations[0]) / "axe.min.js").read_text()


async def violations(tab):
    """Return what is seriously wrong with the page as it stands: (rule, impact, where)."""
    if not await tab.run("Boolean(window.axe)"):
        await tab.run(script() + "; undefined")
    found = json.loads(
        await tab.run("axe.run(document, {resultTypes: ['violations']}).then((all) => JSON.stringify(all.violations))")
    )
    return [
        (one["id"], one["impact"], [node["target"] for node in one["nodes"]][:5])
        for one in found
        if one["impact"] in GRAVE
    ]
