"""`wallride monitor`, the car in a browser. Read `messages`, `outbox`, `driving`, `feed`, `session`, `server`."""
