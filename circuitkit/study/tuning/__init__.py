"""Tuning: values of a circuit, a controller or a gait are searched for what does best in many runs."""
