"""The experiments of the lab report's evaluation: gains by five tests, trials with safety, sudden obstacles."""
