"""The on-car process.

Read in this order: `command` (who speaks and who is obeyed), `queues` (how words reach the mux and expire),
`settings`, `control` (the pure laws), `tasks` (thin loops around them), `app` (the one place where tasks meet).
"""
