"""YAML of ROS files: what ROS's loaders take is taken; what is none is refused with its line and key, soon."""

import math
import random
from contextlib import suppress

import pytest

from wallride.runtime.ros import yaml_file
from wallride.runtime.ros.yaml_file import YamlFileError, mappings, number, read_yaml


@pytest.fixture
def read(tmp_path):
    def write_and_read(content):
        path = tmp_path / "f.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_yaml(path)

    return write_and_read


@pytest.mark.parametrize(("content", "value"), [
    ("a: 1\t# metres", {"a": 1}),
    ("a:\t1\t\n\t\nb: 2\n\t# note\n", {"a": 1, "b": 2}),
    ("\ufeffa: 1", {"a": 1}),
    ("a: 1".encode("utf-16"), {"a": 1}),
    ("a: 1 # 20 \xb0".encode("latin-1"), {"a": 1}),
    ("a: '4614.0'\nb: \"yes\"", {"a": "4614.0", "b": "yes"}),
    ("a: [1, -2.5, .inf, 1e3, 0x10, 010, 1_000, .5, 5.]", {"a": [1, -2.5, math.inf, 1000.0, 16, 8, 1000, 0.5, 5.0]}),
    ("a: yes\nb: Off\nc: ~\nd:\ne: No", {"a": True, "b": False, "c": None, "d": None, "e": False}),
    ("base: &b {x: 1, y: 2}\na:\n  <<: *b\n  y: 3", {"base": {"x": 1, "y": 2}, "a": {"x": 1, "y": 3}}),
    ("%YAML 1.1\n---\na: !degrees 3\n1: x", {"a": 3, "1": "x"}),
    ("/**:\r\n  ros__parameters:\r\n    a: 1\r\n", {"/**": {"ros__parameters": {"a": 1}}}),
])  # fmt: skip
def test_what_ros_takes_is_taken(read, content, value):
    assert list(mappings(read(content))) == [value]


def test_a_second_key_counts_and_is_said_and_documents_come_one_by_one(read):
    found = read("a: 1\nb: 2\na: 3\n---\nc: 4\n--- text\n")
    assert list(mappings(found)) == [{"a": 3, "b": 2}, {"c": 4}]
    assert found.notes == ["line 3: a is there a second time; this one counts"]


@pytest.mark.parametrize(("content", "refusal"), [
    ("a: 1\nvesc:\n  port: 'x\n", r"f\.yaml, line \d, vesc\.port: is not YAML: .*end of stream"),
    ("a:\n\tb: 1", r"line 2, a: is not YAML: .*cannot start any token"),
    ("a: [1, 2\nb: 3", r"line \d, a: is not YAML"),
    ("x: " + "[" * 4000, r"line 1, x: nests deeper than 50 levels"),
    ("a: &x [*x]", r"line 1, a: \*x refers to nothing that is complete before it"),
    ("a: *b", r"\*b refers to nothing"),
    ("a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
        f"a{k}: &a{k} [{','.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 9)
    ), r"line 5, a4: holds more than 50000 values"),
    ("#" * 300_000, r"f\.yaml: has more than 256 kB"),
])  # fmt: skip
def test_what_is_none_or_too_much_is_refused_with_line_and_key(read, content, refusal):
    with pytest.raises(YamlFileError, match=refusal):
        read(content)


def test_damaged_files_end_in_a_value_or_a_refusal(read):
    chance = random.Random(7)
    text = "/**:\n  ros__parameters: &p\n    gain: 4614.0\t# x\n    list: [1, {a: b}]\nq: *p\n'k': \"v\"\n"
    for _ in range(300):
        damaged = list(text)
        for _ in range(3):
            damaged[chance.randrange(len(damaged))] = chance.choice("\t\n:[]{}&*'\"-?|>%@`#, ax1\0\x85")
        with suppress(YamlFileError):
            read("".join(damaged))


@pytest.mark.parametrize(("value", "expected"), [("4614.0", 4614.0), (3, 3.0), ("x", None), (True, None), ([1], None)])
def test_numbers_as_text_are_numbers(value, expected):
    assert number(value) == expected


def test_the_bound_on_values_counts_each_reference(read, monkeypatch):
    monkeypatch.setattr(yaml_file, "MAX_VALUES", 20)
    assert read("a: &a [1, 2, 3]\nb: [*a, *a]").documents
    with pytest.raises(YamlFileError):
        read("a: &a [1, 2, 3]\nb: [*a, *a, *a, *a, *a]")
