"""The operator's side on the car: sessions, commands, rejections, silence."""
