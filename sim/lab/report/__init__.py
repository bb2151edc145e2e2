"""The experiments of the lab report's section 3: gains by five tests, trials with safety, sudden obstacles."""
