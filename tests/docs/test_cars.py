"""README and the page on real cars say the same of where wallride has driven."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NONE_YET = "No drive of wallride on a real car has been reported so far."


def test_the_first_page_says_on_which_real_cars_it_has_driven():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    page = " ".join((ROOT / "docs" / "cars.md").read_text(encoding="utf-8").split())
    assert "[real cars](docs/cars.md)" in readme
    assert (NONE_YET in page) == ("(none was reported yet)" in readme)
    assert "## Report yours" in page
    assert "wallride report RUN.mcap" in page
