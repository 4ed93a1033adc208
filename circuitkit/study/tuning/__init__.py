"""Tuning: values of a circuit, a controller or a reference are searched for what does best in many runs."""
