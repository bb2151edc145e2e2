"""Outgoing data of the car: status, topics, markers, sinks."""
