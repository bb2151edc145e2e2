"""The lab report's two laws."""
