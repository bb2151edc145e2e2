"""What the lidar can be trusted to show, sector by sector, and where unknown regions begin."""
