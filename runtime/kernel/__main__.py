"""`python -m runtime.kernel`: seal the twins, after the tests have compared them with the Python."""

from runtime import kernel

kernel.seal()
print(kernel.use().words)  # noqa: T201 - this is the command line
