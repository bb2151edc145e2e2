"""Options of the lab's commands on files: `sweep`, `compare`, `scenario`."""
