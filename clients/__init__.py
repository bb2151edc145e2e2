"""Off-car programs, run on a laptop to watch and to operate a car.

They know the car only by its messages on the wire: `runtime.wire`, `runtime.teleop_wire`, `runtime.ros_messages`, and
the session that carries it (`runtime.bus`, `runtime.zenoh_config`).
"""
