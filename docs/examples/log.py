"""Write a car's odometry and distance error to a CSV file: python log.py SECONDS FILE.csv [RECORDING.mcap]."""

import csv
import sys
from pathlib import Path

import wallride

seconds, file, *recording = sys.argv[1:]
source = wallride.open_recording(recording[0]) if recording else wallride.connect()
with source as car, Path(file).open("w", newline="") as out:
    table = csv.writer(out)
    table.writerow(("stamp_s", "x_m", "y_m", "speed_mps", "distance_error_m"))
    error_m, begin_s = float("nan"), None
    for topic, value in car.topics("odom", "distance_error"):
        begin_s = begin_s if begin_s is not None else value.stamp_s
        if value.stamp_s - begin_s > float(seconds):
            break
        if topic == "distance_error":
            error_m = value.value
        else:
            table.writerow((value.stamp_s, value.x_m, value.y_m, value.speed_mps, error_m))
