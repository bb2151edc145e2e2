"""The on-car process.

Read in this order: `arbitration.command` (the sources and their priority), `arbitration.queues` (how commands reach the
mux and expire), `settings`, `control` (the pure laws), `tasks` (thin loops around them), `app` (the one place where
tasks meet).
"""
