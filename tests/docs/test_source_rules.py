"""Rules that no linter knows: one name for one class, rooms that can be overlooked, plain subjects, short pages."""

import ast
import re
import tomllib
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("benchmarks", "clients", "docs", "drivers", "runtime", "sim", "wallride")
MAX_MODULES = 20
MAX_PARAMETERS, MANY_PARAMETERS, MAX_WITH_MANY = 8, 6, 10
MAX_LINES, MAX_FUNCTION_LINES = 400, 42
MAX_RIDDLES = 10
MAX_PAGE_WORDS = 40_000
RIDDLES = re.compile(r"\b(whoever|nobody|somebody|everybody)\b", re.IGNORECASE)


def sources(*endings):
    return [path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.suffix in endings]


@dataclass
class Module:
    """What is in a module. functions: name, number of parameters, lines. imports: with each name by its module's."""

    lines: int
    classes: list[tuple[str, int]] = field(default_factory=list)
    functions: list[tuple[str, int, int]] = field(default_factory=list)
    imports: set[str] = field(default_factory=set)

    def take(self, node):
        if isinstance(node, ast.ClassDef):
            self.classes.append((node.name, node.lineno))
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            taken = len([name for name in parameters_of(node) if name != "self"])
            self.functions.append((node.name, taken, (node.end_lineno or 0) - node.lineno + 1))
        elif isinstance(node, ast.Import):
            self.imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            self.imports |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}


def statements(node):
    """Yield every statement below a node; most nodes of a tree are expressions, which have no statement in them."""
    for name in ("body", "handlers", "cases", "orelse", "finalbody"):
        for below in getattr(node, name, ()):
            yield below
            yield from statements(below)


@cache
def modules():
    """Return the modules by their paths; read once."""
    found = {}
    for path in sources(".py"):
        text = path.read_text()
        module = found[str(path.relative_to(ROOT))] = Module(len(text.splitlines()))
        for statement in statements(ast.parse(text)):
            module.take(statement)
    return found


def test_no_class_name_stands_for_two_things():
    places = defaultdict(list)
    for path, module in modules().items():
        for name, line in module.classes:
            places[name].append(f"{path}:{line}")
    assert len(places) > 300
    assert not {name: where for name, where in places.items() if len(where) > 1}


def test_no_folder_has_more_modules_than_can_be_overlooked():
    counts = Counter(path.parent for path in sources(".py") if path.name != "__init__.py")
    assert max(counts.values()) > 10
    assert not {str(folder.relative_to(ROOT)): count for folder, count in counts.items() if count > MAX_MODULES}


def parameters_of(function):
    arguments = function.args
    named = [one.arg for one in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return [*named, *(one.arg for one in (arguments.vararg, arguments.kwarg) if one is not None)]


def test_what_a_function_takes_can_be_remembered():
    counts = {f"{path}:{name}": count for path, one in modules().items() for name, count, _ in one.functions}
    assert len(counts) > 2000
    assert {name: count for name, count in counts.items() if count > MAX_PARAMETERS} == {}
    many = sorted(name for name, count in counts.items() if count > MANY_PARAMETERS)
    assert len(many) <= MAX_WITH_MANY, many


def test_a_file_and_a_function_can_be_read_at_once():
    assert {path for path, module in modules().items() if module.lines > MAX_LINES} == set()
    functions = {f"{path}:{name}": lines for path, one in modules().items() for name, _, lines in one.functions}
    longest = {name for name, lines in functions.items() if lines > MAX_FUNCTION_LINES}
    assert longest == set()


def test_sentences_have_a_component_as_their_subject():
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in sources(".py", ".c", ".h", ".js", ".html")
        for line in path.read_text().splitlines()
        if RIDDLES.search(line)
    ]
    assert len(found) <= MAX_RIDDLES, "\n".join(found)


def test_no_module_imports_itself_by_way_of_others():
    places = {
        ".".join(("wallride", *Path(path).with_suffix("").parts)).replace("wallride.wallride", "wallride"): module
        for path, module in modules().items()
        if not path.startswith(("benchmarks/", "docs/"))
    }
    assert len(places) > 300
    graph = {name: module.imports & places.keys() for name, module in places.items()}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise AssertionError(" -> ".join(error.args[1])) from None


def test_contracts_on_packages_are_exhaustive():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    inside = [contract for contract in contracts if "containers" in contract]
    assert {room for contract in inside for room in contract["containers"]} == {
        "wallride",
        "wallride.runtime",
        "wallride.runtime.control",
        "wallride.sim",
    }
    assert all(contract["exhaustive"] for contract in inside)


def test_no_advice_installs_wallride_from_an_index_where_it_is_not():
    advice = re.compile(r"pip install\s+(-\S+\s+)*['\"]?wallride")
    places = [*sources(".py", ".md", ".sh", ".js"), ROOT / "README.md", ROOT / "pyproject.toml"]
    assert len(places) > 300
    assert not [str(path.relative_to(ROOT)) for path in places if advice.search(path.read_text())]


def test_no_example_prints_nan_since_a_beam_without_a_return_is_nan():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "docs" / "examples").glob("*.py")]
    assert not [page.name for page in pages if re.search(r"ranges_m\.(min|max|mean)\(", page.read_text())]


def written_pages():
    """Return the pages that are written by hand: not those that the reference and the fault tests generate."""
    pages = {*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").rglob("*.md")}
    return {page for page in pages if "reference" not in page.parts and page.name != "faults.md"}


def test_the_pages_are_short_enough_to_be_read():
    words = {str(page.relative_to(ROOT)): len(page.read_text(encoding="utf-8").split()) for page in written_pages()}
    assert len(words) > 60
    longest = ", ".join(f"{page} {words[page]}" for page in sorted(words, key=lambda page: -words[page])[:5])
    assert sum(words.values()) <= MAX_PAGE_WORDS, (
        f"the pages have {sum(words.values())} words, {MAX_PAGE_WORDS} are allowed: say each fact once, on the page "
        f"where a reader looks for it, and link to it from the others; leave to docs/reference what is generated, and "
        f"replace a figure by its successor. Longest: {longest}"
    )
