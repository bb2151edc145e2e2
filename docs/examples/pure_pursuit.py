"""Drive a car along the path of a recording, from the same start: python pure_pursuit.py RECORDING.mcap SECONDS."""

import sys
import time

import numpy as np

import wallride

LOOKAHEAD_M, SPEED_MPS = 0.8, 1.0
path = np.array([(odom.x_m, odom.y_m) for odom in wallride.open_recording(sys.argv[1]).topic("odom")])
with wallride.connect() as car, car.drive(max_speed_mps=SPEED_MPS) as hand:
    wheelbase_m, until_s = car.parameters["car.wheelbase_m"], time.monotonic() + float(sys.argv[2])
    for odom in car.topic("odom", newest=True):
        offsets_m = path - (odom.x_m, odom.y_m)
        away_m = np.hypot(*offsets_m.T)
        ahead = np.flatnonzero(away_m[away_m.argmin() :] > LOOKAHEAD_M)
        if not ahead.size or time.monotonic() > until_s:
            break  # the end of the path, or of the time
        dx_m, dy_m = offsets_m[away_m.argmin() + ahead[0]]
        left_m = np.cos(odom.yaw_rad) * dy_m - np.sin(odom.yaw_rad) * dx_m
        hand.send(SPEED_MPS, np.arctan(2 * wheelbase_m * left_m / (dx_m**2 + dy_m**2)))
