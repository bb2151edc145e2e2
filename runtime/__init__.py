"""The on-car process. Read `arbitration.command`, `arbitration.queues`, `settings`, `control`, `tasks`, `app`."""
