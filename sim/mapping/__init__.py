"""A map and the path of the lap, from one recorded drive. Read `lap_record`, `keyframes`, `closing`, `raster`."""
