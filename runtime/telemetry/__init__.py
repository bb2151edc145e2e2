"""What leaves the car: status, topics, markers, sinks."""
