"""YAML files of every kind: text to data with line and column, and data to pydantic models.

Circuits, robots, scenarios and all others are read through here, so that all give the same messages.
"""

from circuitkit.base.source.data_files import (
    data_folder,
    data_folders,
    files_by_name,
    find_data_file,
    path_of,
    shipped_file,
    shipped_names,
)
from circuitkit.base.source.reader import (
    Data,
    Document,
    Mark,
    Place,
    Pointing,
    parse_yaml,
    place_text,
    read_yaml,
    scan_text,
    scan_yaml,
)
from circuitkit.base.source.validation import (
    STRAY_TEXT,
    FileModel,
    Finding,
    describe,
    keys_of,
    model_problems,
    unfilled,
    validate_model,
)
from circuitkit.base.source.writer import dump_yaml

__all__ = [
    "STRAY_TEXT",
    "Data",
    "Document",
    "FileModel",
    "Finding",
    "Mark",
    "Place",
    "Pointing",
    "data_folder",
    "data_folders",
    "describe",
    "dump_yaml",
    "files_by_name",
    "find_data_file",
    "keys_of",
    "model_problems",
    "parse_yaml",
    "path_of",
    "place_text",
    "read_yaml",
    "scan_text",
    "scan_yaml",
    "shipped_file",
    "shipped_names",
    "unfilled",
    "validate_model",
]
