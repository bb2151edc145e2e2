#!/usr/bin/env bash
# Installs Debian's ROS 1 packages (as root) and builds the C++ peers into benchmarks/ros1/build/.
# Nothing here is part of the product.
set -euo pipefail
cd "$(dirname "$0")"
if ! pkg-config --exists roscpp sensor_msgs geometry_msgs || ! /usr/bin/python3 -c "import rospy, rosmaster" 2>/dev/null; then
  apt-get update
  apt-get install -y --no-install-recommends g++ pkg-config libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev \
    python3-rospy python3-sensor-msgs python3-geometry-msgs python3-rosmaster python3-numpy
fi
mkdir -p build
for program in nodes client; do
  # shellcheck disable=SC2046 # a list of words is wanted
  g++ -O2 -std=c++17 -o "build/$program" "$program.cpp" $(pkg-config --cflags --libs roscpp sensor_msgs geometry_msgs)
done
echo "built; run: python benchmarks/ros1/compare.py"
