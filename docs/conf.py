"""The book: README, docs and benchmarks as a site. `make book` writes it to build/book from the pages as they are."""

project = "wallride"
extensions = ["myst_parser", "sphinx_copybutton"]
html_theme = "furo"
html_title = "wallride"
root_doc = "docs/book"
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**", "benchmarks/*.md"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
# Links to files that are no pages, such as sources and examples, are taken along as downloads.
suppress_warnings = ["misc.highlighting_failure"]
