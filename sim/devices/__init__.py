"""Device emulators that speak the real bytes over TCP and pseudo-terminals, with faults to inject."""
