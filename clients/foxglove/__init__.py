"""`wallride foxglove`: a car's topics live for Foxglove, Lichtblick and PlotJuggler."""
