"""A biped: its gait, channels, controllers and measures."""
