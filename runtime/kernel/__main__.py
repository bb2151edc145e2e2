"""`python -m wallride.runtime.kernel`: print which functions of the hot path run in C."""

from wallride.runtime import kernel

print(kernel.state().words)  # noqa: T201 - this is the command line
