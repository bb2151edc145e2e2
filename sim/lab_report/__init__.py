"""`wallride lab report`: the lab report's section 3 as a page. Read: `command`, `page`, `markdown`, `figures`."""
