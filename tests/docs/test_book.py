"""The book's table of contents names every page once, and nothing that is not there."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
BOOK = ROOT / "docs" / "book.rst"


def chapters():
    """Return the pages that the table of contents names, relative to the project, in order."""
    names = [line.strip() for line in BOOK.read_text().splitlines() if line.startswith("   ") and ":" not in line]
    found = []
    for name in names:
        paths = sorted((ROOT / "docs").glob(f"{name}.md")) if "*" in name else [ROOT / "docs" / f"{name}.md"]
        found += [path.resolve().relative_to(ROOT).as_posix() for path in paths]
    return found


def pages():
    """Return all pages of the project."""
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]
    return sorted(path.relative_to(ROOT).as_posix() for path in found)


def test_every_page_is_in_the_book_once():
    assert sorted(chapters()) == pages()


def test_a_newcomers_chapters_come_first():
    assert chapters()[:3] == ["README.md", "docs/bring-up.md", "docs/calibration.md"]
