"""A run as one page to hand in. Read: `run` (what is known of a run), `figures` (its numbers), `charts`, `page`."""
