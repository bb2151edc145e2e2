"""Which wheels a car needs: by its machine and Python, not by those of the computer that gathers them."""

import pytest
from packaging.requirements import Requirement

from wallride.deploy.closure import CarPlatform, best_wheel, pinned, reach, read_pins, requirements_of

JETSON = CarPlatform("aarch64", (2, 35), (3, 11, 0))
KNOWN = {
    "wallride": requirements_of(
        "Name: wallride\nRequires-Dist: numpy>=2\nRequires-Dist: wallride[keys]; extra == 'car'\n"
        "Requires-Dist: shtab; extra == 'car'\nRequires-Dist: Cryptography; extra == 'keys'\n"
        "Requires-Dist: matplotlib; extra == 'sim'\n"
    ),
    "numpy": [],
    "shtab": [],
    "cryptography": requirements_of(
        "Name: c\nRequires-Dist: cffi>=2; platform_python_implementation != 'PyPy'\n"
        "Requires-Dist: typing_extensions; python_version < '3.13'\nRequires-Dist: winonly; sys_platform == 'win32'\n"
        "Requires-Dist: simd; platform_machine == 'aarch64'\n"
    ),
}


@pytest.mark.parametrize(
    ("car", "unknown"),
    [
        (JETSON, ["cffi", "simd", "typing_extensions"]),
        (CarPlatform("x86_64", (2, 36), (3, 13, 5)), ["cffi"]),
    ],
)
def test_markers_are_judged_by_the_car(car, unknown):
    needed, missing = reach([Requirement("wallride[car]")], KNOWN, car.environment())
    assert [one.name for one in missing] == unknown
    assert {"wallride", "numpy", "shtab", "cryptography"} < set(needed)
    assert "matplotlib" not in needed


def test_a_circle_of_requirements_ends():
    known = {"a": [Requirement("b[x]")], "b": [Requirement("a; extra == 'x'")]}
    assert reach([Requirement("a")], known, JETSON.environment()) == (["a", "b"], [])


@pytest.mark.parametrize(
    ("files", "best"),
    [
        (["numpy-2.4.6-cp311-cp311-manylinux_2_27_aarch64.manylinux_2_28_aarch64.whl"], 0),
        (["numpy-2.4.6-cp311-cp311-manylinux_2_27_x86_64.whl"], None),
        (["numpy-2.4.6-cp312-cp312-manylinux_2_27_aarch64.whl"], None),
        (["numpy-2.4.6-cp311-cp311-manylinux_2_39_aarch64.whl"], None),
        (["numpy-2.4.6-cp311-cp311-musllinux_1_2_aarch64.whl"], None),
        (["numpy-2.4.5-cp311-cp311-manylinux_2_27_aarch64.whl"], None),
        (["numpy-2.4.6-py3-none-any.whl", "numpy-2.4.6-cp311-cp311-manylinux_2_17_aarch64.whl"], 1),
        (["numpy-2.4.6-cp38-abi3-manylinux2014_aarch64.whl"], 0),
        (["numpy.whl", "notes.txt"], None),
    ],
)
def test_the_best_wheel_that_runs_there(files, best):
    pins = read_pins("# pins\nnumpy==2.4.6\n")
    found = best_wheel(files, Requirement("numpy>=2"), pins, JETSON.tags())
    assert found == (files[best] if best is not None else None)


def test_without_a_pin_the_newest_that_fits():
    files = [f"cffi-{version}-py3-none-any.whl" for version in ("1.9", "2.1", "2.10", "3.0")]
    assert best_wheel(files, Requirement("cffi>=2,<3"), {}, JETSON.tags()) == "cffi-2.10-py3-none-any.whl"


def test_what_pip_is_asked_for():
    pins = read_pins("typing_extensions==4.16.0\n")
    assert pinned(Requirement("typing-extensions>=4"), pins) == "typing-extensions==4.16.0"
    assert pinned(Requirement("cffi>=2"), pins) == "cffi>=2"
