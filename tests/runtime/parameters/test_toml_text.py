"""Values set and removed in the text of a TOML file, whatever its shape: only they change."""

import random
import tomllib

import pytest

from wallride.runtime.parameters.toml_text import comments, remove, set_value

SECTIONS = {
    "safety": ["hold_s", "grip_mu", "creep_mps"], "safety.recovery": ["tries", "back_m"], "safety.window": ["memory_m"],
    "wall_follow": ["kp", "kd"], "car": ["name", "wheelbase_m"], "mux": ["tick_hz"],
}  # fmt: skip
PATHS = [(*section.split("."), key) for section, keys in SECTIONS.items() for key in keys]
ONE_LINE = ("0.25", "1", "true", '"a # b"', "'x = ] }'", "[1, 2]", '["a", "b,]"]', '"\\" \\u00e4"')
VALUES = (*ONE_LINE, '"""m\n # x\n"""', "'''\n[car]\n'''", "1e-7", "0x1f", "[ # c\n 1,\n 2 ]")


class Written:
    """A random file: each section below a header, in dotted keys or inline, in any order, with comments."""

    def __init__(self, seed):
        self.chance = random.Random(seed)
        self.first, self.blocks = [], []
        for section in ("safety", "wall_follow", "car", "mux"):
            if self.chance.random() > 0.2:
                self.section(section)
        self.chance.shuffle(self.first)
        self.chance.shuffle(self.blocks)
        notes = ("", "\n", "# a note\n", "\n# a note\n\n")
        text = "\n".join([*self.first, *(self.chance.choice(notes) + "\n".join(block) for block in self.blocks)])
        self.text = (text + self.chance.choice(("", "\n"))).replace("\n", self.chance.choice(("\n", "\n", "\r\n")))

    def lines(self, prefix, keys, *, inline=False):
        """Return some of the keys with values; comments where there is room."""
        taken = [key for key in keys if self.chance.random() < 0.7]
        if inline:
            return [f"{prefix}{key} = {self.chance.choice(ONE_LINE)}" for key in taken]
        return [self.said(f"{prefix}{key} = {self.chance.choice(VALUES)}") for key in taken]

    def said(self, line):
        return line + self.chance.choice(("", "", "  # why", "# tight"))

    def section(self, name):
        quoted = self.chance.choice((name, f'"{name}"'))
        below = {one.partition(".")[2]: keys for one, keys in SECTIONS.items() if one.startswith(f"{name}.")}
        below = {one: keys for one, keys in below.items() if self.chance.random() < 0.7}
        shape = self.chance.choice(("header", "header", "header", "dotted", "inline"))
        if shape == "inline":
            parts = self.lines("", SECTIONS[name], inline=True)
            for one, keys in below.items():
                inner = self.lines("", keys, inline=True)
                nested = self.chance.random() < 0.5
                parts += [f"{one} = {{ {', '.join(inner)} }}"] if nested else [f"{one}.{line}" for line in inner]
            self.first.append(self.said(f"{quoted} = {{ {', '.join(parts)} }}"))
            return
        place, prefix = ([self.said(f"[{quoted}]")], "") if shape == "header" else (self.first, f"{quoted} . ")
        place += self.lines(prefix, SECTIONS[name])
        for one, keys in below.items():
            how = self.chance.choice(("header", "dotted", "inline"))
            if how == "header" and shape == "header":
                self.blocks.append([f"[{quoted}.{one}]", *self.lines("", keys)])
            elif how == "inline":
                place.append(self.said(f"{prefix}{one} = {{{', '.join(self.lines('', keys, inline=True))}}}"))
            else:
                place += self.lines(f"{prefix}{one}.", keys)
        if shape == "header":
            self.blocks.append(place)


def filled(tree):
    """Return a tree without empty sections."""
    below = {key: filled(value) if isinstance(value, dict) else value for key, value in tree.items()}
    return {key: value for key, value in below.items() if value != {}}


def change(tree, path, value):
    for key in path[:-1]:
        tree = tree.setdefault(key, {})
    if value is None:
        tree.pop(path[-1], None)
    else:
        tree[path[-1]] = value


def test_random_files_take_random_changes_and_nothing_else_changes():
    for seed in range(200):
        text, chance = Written(seed).text, random.Random(-seed)
        tree, marks, said = tomllib.loads(text), set(), text.count("# why") + text.count("a note")
        for path in chance.sample(PATHS, chance.randint(1, 6)):
            value = chance.choice((0.25, 7, True, 'ä " # \x7f 🚗', ["e", "f"], 1e-9, None))
            before = comments(text).get(path, "")
            if value is None:
                text = remove(text, path)
                said -= "why" in before
                marks.discard(path)
            else:
                mark = chance.random() < 0.5
                text = set_value(text, path, value, f"{before}; seen" if mark else None)
                marks |= {path} if mark else set()
            change(tree, path, value)
            assert filled(tomllib.loads(text)) == filled(tree), (seed, path, text)
        assert all("seen" in comments(text)[path] for path in marks), (seed, text)
        assert text.count("# why") + text.count("a note") == said, (seed, "a comment was lost", text)


@pytest.mark.parametrize(
    ("text", "path", "after"),
    [
        ("[car]\nname = 'a' # mine\n", "car.name", "[car]\nname = 1 # mine\n"),
        ("[car]\n\n[mux]\ntick_hz = 50", "car.name", "[car]\nname = 1\n\n[mux]\ntick_hz = 50"),
        ("car = { name = 'a' }  # one\n", "car.name", "car = { name = 1 }  # one\n"),
        ("car = { }\n", "car.name", "car.name = 1\n"),
        ("car.name = 'a'", "car.wheelbase_m", "car.name = 'a'\ncar.wheelbase_m = 1\n"),
        ("", "safety.recovery.tries", "[safety.recovery]\ntries = 1\n"),
        ("[safety]\nrecovery.tries = 2\n", "safety.recovery.back_m",
         "[safety]\nrecovery.tries = 2\nrecovery.back_m = 1\n"),
    ],
)  # fmt: skip
def test_a_value_is_put_where_its_section_is(text, path, after):
    assert set_value(text, tuple(path.split(".")), 1) == after


def test_a_comment_makes_dotted_keys_of_an_inline_table_which_has_no_room_for_it():
    text = "safety = { hold_s = 0.3, recovery = { tries = 2 } } # both\n"
    after = "# both\nsafety.hold_s = 0.3\nsafety.recovery.tries = 3 # seen\n"
    assert set_value(text, ("safety", "recovery", "tries"), 3, "seen") == after


def test_a_value_in_place_of_a_section_is_a_mistake():
    with pytest.raises(ValueError, match="car is a value, not a section"):
        set_value("car = 3\n", ("car", "name"), 1)
