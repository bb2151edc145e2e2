"""Off-car programs: what a person runs on a laptop to watch and to operate a car.

They know the car only by what it says on the wire: `runtime.wire`, `runtime.teleop_wire`, `runtime.ros_messages`, and
the session that carries it (`runtime.bus`, `runtime.zenoh_config`).
"""
