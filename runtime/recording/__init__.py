"""Every drive on disk, without the drive noticing: what decides (`tape`), what is shown, and the last half minute."""
