"""World model and lidar simulation: walls, maps, obstacles, beams."""
