"""Off-car programs, run on a laptop to watch and to operate a car.

They know the car only by its messages: `wallride.runtime.wire` (topics, teleop, the bus that carries them) and
`wallride.runtime.ros`.
"""
