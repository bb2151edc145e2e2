"""The world and what a lidar sees of it: walls, maps, obstacles, beams."""
