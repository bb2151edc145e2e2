"""Options of the lab's larger commands; each imports its code when it runs."""
