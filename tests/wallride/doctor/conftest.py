"""A look at one device is taken in virtual time; a whole emulated car has its own."""

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen_for("test_serial_lidars.py", "test_pwm_motors.py")
