"""Draw where a recorded drive went and how well it kept its distance: python plot.py RECORDING.mcap FILE.png."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import wallride

car = wallride.open_recording(sys.argv[1])
path = np.array([(odom.x_m, odom.y_m) for odom in car.topic("odom")])
error = np.array([(number.stamp_s, number.value) for number in car.topic("distance_error")])
scan = car.latest("scan")

figure, (above, below) = plt.subplots(2)
above.plot(*path.T, label="base_link in odom [m]")
above.set_aspect("equal")
below.plot(error[:, 0] - error[0, 0], error[:, 1], label="distance error [m] over time [s]")
for axes in (above, below):
    axes.legend()
figure.suptitle(f"{car.name}: side {car.parameters['wall_follow.side']}, {np.isfinite(scan.ranges_m).sum()} last beams")
figure.savefig(sys.argv[2])
