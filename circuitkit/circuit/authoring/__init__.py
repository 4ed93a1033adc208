"""What helps who writes circuits: starters, normal form, schema, differences, explanations, the flat file."""
