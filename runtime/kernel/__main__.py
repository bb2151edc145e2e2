"""`python -m runtime.kernel`: print which functions of the hot path run in C."""

from runtime import kernel

print(kernel.state().words)  # noqa: T201 - this is the command line
