"""wallride's values as ROS 2 messages: the same bytes for zenoh, a recorder and a live view. No ROS needed.

`rosbags` writes the same bytes, but is not used on the car: it compiles each type when that is first written (3 to 17
ms in which the event loop stands still) and takes 0.1 s to load. In the tests it is the reference for every message.
"""
