"""How the car itself moves: by wheels, steering and tyres, corrected by the scans."""
