"""Controllers of a biped."""
