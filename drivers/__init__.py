"""Device drivers: bytes on one side, SI values on the other; independent of driving.

Read in this order: `api` (the interfaces of a lidar and a motor), `link` (bytes to and from a port), then a device,
each with the same three files: `settings`, `codec` (pure), `driver` (thin).
"""
