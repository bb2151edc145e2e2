"""`wallride new`: a first law or driver of one's own, with tests beside it."""

import argparse
import keyword
import sys
from importlib.machinery import PathFinder
from pathlib import Path

from wallride.failure import fail
from wallride.parser import Commands
from wallride.runtime.host.output_files import Content, write_files

HERE = Path(__file__).parent
KINDS = {"pd": ("pd_follower", "Pd"), "gap": ("gap_follower", "Gap")}
"""File and name of each example."""
CLASS = "Follower"
DRIVERS = ("lidar", "motor")
DRIVER, EMULATOR = "Driver", "Emulator"


def add(commands: Commands) -> None:
    """Add `new` and what it makes."""
    new = commands.add_parser("new", help="begin something of your own: a law, a driver")
    things = new.add_subparsers(dest="thing", required=True, metavar="THING")
    law = things.add_parser("law", help="write a first law of your own and its test, to change (docs/your-own-law.md)")
    law.add_argument("file", type=Path, metavar="FILE.py", help="the law's file, for example my_laws.py")
    law.add_argument(
        "--kind", choices=sorted(KINDS), default="pd",
        help="pd: after the lab report's wall follower; gap: drives for the freest direction (default: pd)",
    )  # fmt: skip
    law.set_defaults(run=run)
    driver = things.add_parser(
        "driver", help="write a first driver of your own, its emulator and tests (docs/your-own-driver.md)"
    )
    driver.add_argument("name", metavar="NAME", help="the module's name, for example my_lidar")
    driver.add_argument("--kind", choices=DRIVERS, required=True, help="lidar or motor")
    driver.set_defaults(run=run_driver)


def run(options: argparse.Namespace) -> int:
    """Write both files; 2 where one exists, or the name cannot be imported."""
    law: Path = options.file
    if law.suffix != ".py" or not law.stem.isidentifier():
        return fail(f"{law}: name a Python file of letters, digits and _, for example my_laws.py")
    if taken := _taken(law.stem):
        return fail(f"{law}: {taken}; take another name, for example my_laws.py")
    test = law.with_name(f"test_{law.name}")
    for path in (law, test):
        if path.exists():
            return fail(f"{path}: exists already; nothing was written")
    if not law.absolute().parent.is_dir():
        return fail(f"{law}: there is no directory {law.parent}; make it first")
    source, prefix = KINDS[options.kind]
    write_files({law: _text(source, prefix, law.stem), test: _text("law_test", "Pd", law.stem)})
    print(f"{law}: class {CLASS}; {test}: its test (python -m pytest {test})")
    print(f"drive it:  wallride sim --set wall_follow.method={law.stem}:{CLASS}")
    return 0


def run_driver(options: argparse.Namespace) -> int:
    """Write three files here; 2 where one exists, or the name cannot be imported."""
    name, kind = str(options.name).removesuffix(".py"), str(options.kind)
    if not name.isidentifier():
        return fail(f"{name}: give a name of letters, digits and _, for example my_{kind}")
    if taken := _taken(name):
        return fail(f"{name}: {taken}; take another name, for example my_{kind}")
    names = {f"{kind}_driver_test": f"test_{name}", f"{kind}_driver": name, f"{kind}_emulator": f"{name}_emulator"}
    for module in names.values():
        if Path(f"{module}.py").exists():
            return fail(f"{module}.py: exists already; nothing was written")
    made: dict[Path, Content] = {}
    for source, module in names.items():
        text = (HERE / f"{source}.py").read_text(encoding="utf-8")
        for one, own in names.items():
            text = text.replace(f"wallride.new.{one}", own)
        text = text.replace(f"{kind.capitalize()}Driver", DRIVER).replace(f"{kind.capitalize()}Device", EMULATOR)
        made[Path(f"{module}.py")] = text
    write_files(made)
    print(f"{name}.py: class {DRIVER}; {name}_emulator.py: its device; test_{name}.py: python -m pytest test_{name}.py")
    print(f"drive it:  wallride sim --set {kind}.driver={name}:{DRIVER}")
    return 0


def _taken(name: str) -> str:
    """Return why Python would not import a new module of this name, "" where it would."""
    if keyword.iskeyword(name):
        return f"{name} is a word of Python's own"
    found = PathFinder.find_spec(name)
    if name in sys.stdlib_module_names or (found is not None and found.origin is not None):
        return f"there is a module {name} already, which would be imported instead"
    return ""


def _text(source: str, prefix: str, module: str) -> str:
    """Return an example under the user's names."""
    text = (HERE / f"{source}.py").read_text(encoding="utf-8")
    text = text.replace("wallride.new.pd_follower", module)
    return text.replace(f"{prefix}Follower", CLASS).replace(f"{prefix}Settings", f"{CLASS}Settings")
