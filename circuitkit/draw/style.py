"""Colours, type and axes of every picture, and how a picture becomes a file.

The colours differ in lightness as much as in hue, so that they stay apart in grey and for the colour-blind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from circuitkit.base.errors import InputError, Problem, suggest
from circuitkit.base.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONT = "DejaVu Sans"  # comes with matplotlib, so that pictures are the same everywhere
NORMAL, SMALL = 9.0, 7.5  # sizes of type, [pt]
POINTS_PER_INCH = 72.0
INK, GREY, PALE, PAPER = "#222222", "#666666", "#d9d9d9", "#ffffff"
EXCITATORY, INHIBITORY, SENSORIAL, READOUT = "#2783bf", "#8c1510", "#6d6d6d", "#222222"
GATE = "#7b4fa0"
KIND_COLOUR = {
    "excitatory": EXCITATORY,
    "inhibitory": INHIBITORY,
    "sensorial": SENSORIAL,
    "readout": READOUT,
    "gate": GATE,
}
ROLE_FILL = {"input": "#f1f1f1", "excitatory": "#dcebf7", "inhibitory": "#f0c9bd", "output": "#fbf3d0"}
CYCLE = (EXCITATORY, INHIBITORY, "#e6a100", "#3a7d44", GATE, "#555555")  # for curves in one axes
DASHES = ("-", "--", "-.", ":")
_DPI = 200
_MAX_PIXELS = 12000
_LEAST_SHARE = 0.01  # of the size of the values: what axes span at least
_NOTHING = 1e-9  # of the span of axes: rounding, not a number at a tick
_TICK_DIGITS = 6
PICTURES = (".png", ".svg", ".pdf")

_RC: Any = {  # matplotlib has a type for these keys, of several pages
    "font.family": FONT,
    "font.size": NORMAL,
    "axes.titlesize": NORMAL,
    "axes.labelsize": SMALL + 0.5,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "mathtext.fontset": "dejavusans",
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,  # nobody adds a number at the corner to those at the ticks
    "svg.hashsalt": "circuitkit",  # the same picture is the same file
    "pdf.fonttype": 42,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's settings for our pictures, inside the block only; figures are made and saved in it.

    What the user has set for other pictures, such as TeX for all text, is none of them.
    """
    import matplotlib as mpl  # 0.2 s, which running a circuit need not wait for

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_RC)
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """Make an empty figure of its own, unknown to pyplot, [in]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # 0.2 s, as above
    from matplotlib.figure import Figure  # 0.2 s, as above

    figure = Figure(figsize=(width_in, height_in), facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def axes_at(
    figure: Figure,
    left_in: float,
    top_in: float,
    width_in: float,
    height_in: float,
    sharex: Axes | None = None,
) -> Axes:
    """Return axes at a place that is measured from the upper left corner of the figure, [in]."""
    width, height = figure.get_size_inches()
    bottom = height - top_in - height_in
    return figure.add_axes(
        (left_in / width, bottom / height, width_in / width, height_in / height), sharex=sharex
    )


def plain_legend(axes: Axes, corner: str, at: tuple[float, float], **more: Any) -> None:  # noqa: ANN401 - whatever `Axes.legend` takes
    """Add a legend without a frame whose corner stands at a place, in units of the axes."""
    options: Any = {"loc": corner, "bbox_to_anchor": at, "frameon": False, "borderpad": 0.0, **more}
    axes.legend(**options)


def tidy(axes: Axes, *, grid: bool = True) -> None:
    """Give axes two thin sides, small ticks and, if wanted, a pale grid behind."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set(color=GREY, linewidth=0.7)
    axes.tick_params(color=GREY, labelcolor=INK, width=0.7, length=2.5)
    axes.set_axisbelow(True)
    if grid:
        axes.grid(color=PALE, linewidth=0.5)


def widened(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """Return limits of axes that span at least a hundredth of their size, or so much.

    What hardly changes is then seen to hardly change.
    """
    lacking = max(least, _LEAST_SHARE * max(abs(low), abs(high))) - (high - low)
    return (low - lacking / 2, high + lacking / 2) if lacking > 0 else (low, high)


def plain_ticks(axes: Axes) -> None:
    """Write numbers at the vertical axis in full: no offset and no factor stand at its end."""

    def text(value: float, _: float) -> str:
        low, high = axes.get_ylim()
        return number(0.0 if abs(value) < _NOTHING * (high - low) else value, _TICK_DIGITS)

    axes.yaxis.set_major_formatter(text)


def number(value: float, digits: int = 4) -> str:
    """Return a number as one prints it: four digits, a real minus, no `1e+03`."""
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}e{int(exponent)}"
    return text.replace("-", "\N{MINUS SIGN}")


def require_suffix(path: str | Path, allowed: tuple[str, ...]) -> str:
    """Return the suffix of a file to write, in small letters.

    Raises:
        InputError: It is none of those allowed.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in allowed:
        found = f"the suffix '{suffix}'" if suffix else "no suffix"
        message = f"found {found}; allowed: {', '.join(allowed)}"
        raise InputError(Problem("", 0, 0, str(path), message, suggest(suffix, allowed) if suffix else ""))
    return suffix


def write_picture(path: str | Path, make: Callable[[], Figure]) -> None:
    """Make a figure and write it, once it is clear that its file may be called so.

    Args:
        path: Where the picture goes: .png, .svg or .pdf.
        make: Makes the figure.

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    require_suffix(path, PICTURES)
    save_figure(make(), path)


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as .png, .svg or .pdf; the file is whole or not there.

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    suffix = require_suffix(path, PICTURES)
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix, {})
    with house_style(), replacing(Path(path)) as part:
        figure.savefig(part, dpi=min(_DPI, _MAX_PIXELS / max(figure.get_size_inches())), metadata=metadata)
