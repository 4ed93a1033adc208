"""Columns over time as NetCDF 3."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from circuitkit.base.files import OutputError, replacing

TIME = "time_s"


def write_netcdf(
    path: Path, attributes: Mapping[str, Any], columns: Mapping[str, tuple[Any, Mapping[str, str]]]
) -> None:
    """Write columns as variables of the dimension `time_s`, the column of that name being its coordinate.

    Args:
        path: The file.
        attributes: Of the file.
        columns: By name, the values [n] and the attributes of the variable, such as `units`.

    Raises:
        OutputError: The file cannot be written, or a name or a value is none that NetCDF has.
    """
    from scipy.io import netcdf_file  # 0.1 s, which only this format needs

    try:
        with replacing(path) as part, netcdf_file(str(part), "w", version=2) as file:
            for name, value in attributes.items():
                setattr(file, name, value)
            file.createDimension(TIME, len(np.asarray(columns[TIME][0])))
            for name, (values, described) in columns.items():
                variable = file.createVariable(name, "f8", (TIME,))
                variable[:] = values
                for word, text in described.items():
                    setattr(variable, word, text)
    except (TypeError, ValueError) as error:
        message = f"cannot write '{path}': {error}"
        raise OutputError(message) from error
