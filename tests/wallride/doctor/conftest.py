"""Looks at devices are taken in virtual time; commands run in processes of their own, and people think in real time."""

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen_for(
    "test_planted_in_the_devices.py", "test_pwm_motors.py", "test_serial_lidars.py"
)
