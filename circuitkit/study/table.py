"""Results as an Arrow table, which Parquet keeps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from circuitkit.base.errors import MissingDependencyError
from circuitkit.base.units import parse_quantity
from circuitkit.study.rows import Row, measures_in
from circuitkit.study.spec import Study

if TYPE_CHECKING:
    import pyarrow


def arrow() -> Any:  # noqa: ANN401 - a module that ships no types
    """The module pyarrow.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        import pyarrow  # an extra
        import pyarrow.parquet  # the same
    except ImportError as error:
        package, extra = "pyarrow", "study"
        raise MissingDependencyError(package, extra, "writing the results of a sweep") from error
    return pyarrow


def table_of(study: Study, rows: Sequence[Row]) -> pyarrow.Table:
    """Rows as an Arrow table with the same columns whatever their order.

    Raises:
        MissingDependencyError: pyarrow is not installed.
    """
    pa = arrow()
    fields = [_labelled(pa, study, axis) for axis in study.axes]
    if study.search is not None:
        fields.append(_with_unit(pa.field(study.search.field, pa.float64()), study.search.step))
    fields.append(pa.field("seed", pa.int64()))
    fields += [pa.field(name, _type_of(pa, name, rows)) for name in measures_in(study, rows)]
    fields += [pa.field(name, pa.string()) for name in ("scenario", "version", "key")]
    columns = [pa.array([row.get(field.name) for row in rows], type=field.type) for field in fields]
    return pa.Table.from_arrays(columns, schema=pa.schema(fields))


def _type_of(pa: Any, name: str, rows: Iterable[Row]) -> Any:  # noqa: ANN401 - a module that ships no types
    """Truth values, or numbers."""
    return pa.bool_() if any(isinstance(row.get(name), bool) for row in rows) else pa.float64()


def _labelled(pa: Any, study: Study, axis: str) -> Any:  # noqa: ANN401 - a module that ships no types
    values = study.axes[axis]
    if all(isinstance(value.label, bool) for value in values):
        return pa.field(axis, pa.bool_())
    if all(isinstance(value.label, float) for value in values):
        return _with_unit(pa.field(axis, pa.float64()), values[0].text)
    return pa.field(axis, pa.string())


def _with_unit(field: Any, text: str) -> Any:  # noqa: ANN401 - as above
    return field.with_metadata({"unit": parse_quantity(text).dimension.si_symbol})
