"""wallride's values as ROS 2 messages: the bytes that zenoh, a recorder and a live view all get. No ROS needed.

Why not `rosbags` on the car, which writes the same bytes: it compiles each type when that is first written (3 to 17 ms
in which the event loop stands still) and takes 0.1 s to load. In the tests it is the judge of every message.
"""
