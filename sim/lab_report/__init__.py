"""`wallride lab report`: the lab report's evaluation as a page. Read: `command`, `page`, `markdown`, `figures`."""
