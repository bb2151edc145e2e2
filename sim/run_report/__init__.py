"""Report of a run as one page. Read: `run` (the data of a run), `figures` (its numbers), `charts`, `page`."""
