"""What every package stands on: errors, units, files, and the reader of YAML files."""
