"""Makes figure 8 with the claims of section 5.1, the computation time of a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from matplotlib.figure import Figure

from circuitkit.draw.style import (
    EXCITATORY,
    GREY,
    INK,
    PALE,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    tidy,
)
from circuitkit.paper.reproduce.drawing import WIDTH_IN, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    all_hold,
    one_line,
    plain,
    seeds_in_words,
)
from circuitkit.paper.reproduce.timing import (
    Times,
    mpc_solves,
    network_steps,
    time_in_the_loop,
    time_in_turns,
)
from circuitkit.simulation import load_scenario, make_plan

CIRCUIT, SCENARIO, MPC = "binn_lateral", "nao_push", "mpc"
RUNS = 20  # section 5.1
STEPS, QUICK_STEPS = 1_000_000, 50_000  # section 5.1: 10^6
SOLVES, QUICK_SOLVES = 2_000, 200
LOOP_SEEDS, QUICK_LOOP_SEEDS = range(20), range(2)
CONTROL_STEP_S = 10e-3  # section 5.1

PAPER_MEAN_S, PAPER_VARIATION = 0.0027e-3, 0.0062
_OF_A_STEP = 1e-3  # section 5.1: less than 0.1 % of the iteration step
_NEGLIGIBLE = 0.01  # of the other methods' time
_MS = 1e3


@dataclass(frozen=True)
class Bar:
    """One bar of the figure.

    Attributes:
        label: Beside it.
        seconds: Its length.
        ours: Whether it was measured here, or is quoted by the paper.
    """

    label: str
    seconds: float
    ours: bool


QUOTED = (
    Bar("BiNN (the paper)", PAPER_MEAN_S, ours=False),
    Bar("Ishihara and Morimoto 2015", 20e-3, ours=False),
    Bar("Carpentier et al. 2016", 40e-3, ours=False),
    Bar("Tedrake et al. 2015", 300e-3, ours=False),
)


class Fig8(ReportFigure):
    """Times a step of the network, beside a solve of the MPC."""

    kind: ClassVar[str] = "fig8"
    order: ClassVar[int] = 8
    title: ClassVar[str] = "Figure 8: computation time"
    effort: ClassVar[Effort] = Effort(full_s=120.0, quick_s=12.0)

    def run(self, job: Job) -> Finding:
        """Time the network's step and the MPC's solve in turns, then whole controllers in the loop."""
        plan = make_plan(load_scenario(SCENARIO))
        steps, solves = (QUICK_STEPS, QUICK_SOLVES) if job.quick else (STEPS, SOLVES)
        job.log(f"timing {RUNS} runs of {steps} steps and {solves} solves")
        alone = time_in_turns(
            {
                "compiled": (network_steps(CIRCUIT, "compiled"), steps),
                "numpy": (network_steps(CIRCUIT, "numpy"), steps),
                "solve": (mpc_solves(MPC, plan), solves),
            },
            RUNS,
        )
        seeds = QUICK_LOOP_SEEDS if job.quick else LOOP_SEEDS
        job.log("timing controllers in the loop")
        loop = time_in_the_loop(plan, ("circuit", "mpc", "mpc_full", "dcm_ankle"), seeds)
        file = save(_figure(_bars(alone)), job.folder, "fig8")
        caption = (
            "Computation time of a step, on a logarithmic scale. Dark: measured on one core of the machine "
            "that made this report. Pale: as the paper quotes it, from other machines and for other tasks."
        )
        picture = Picture(
            file, caption, "Bars of computation times from a microsecond to a third of a second"
        )
        return Finding(
            job.figure,
            self.title,
            _claims(alone),
            (picture,),
            (_table_alone(alone), _table_loop(loop, len(seeds))),
            one_line(_TEXT),
            f"inputs and states from seed 0; in the loop {seeds_in_words(seeds)}",
            data={"alone": _data(alone), "in_the_loop": _data(loop), "runs": RUNS},
        )


_TEXT = """
A step of the network is eqs. 11 and 12 for all 11 neurons and the output, called from Python with other
inputs each time: by generated C, and by the numpy backend, which needs no compiler. The MPC's solve is one
quadratic program of the ZMPs ahead with their bounds, from states that pushes have moved off the walk, by
daqp with all that does not change factorised beforehand. All take turns on one core; counted is the
processor's time. The
other methods that the paper quotes plan whole motions of whole bodies; their times are theirs, and no measure
of an MPC for the CoM.
"""


def _bars(alone: Mapping[str, Times]) -> tuple[Bar, ...]:
    ours = (
        Bar("BiNN, generated C", alone["compiled"].mean_s, ours=True),
        Bar("BiNN, numpy", alone["numpy"].mean_s, ours=True),
        Bar("MPC (Wieber), one solve", alone["solve"].mean_s, ours=True),
    )
    return (ours[0], ours[1], QUOTED[0], ours[2], *QUOTED[1:])


def _figure(bars: Sequence[Bar]) -> Figure:
    left, top, row, bottom = 1.95, 0.15, 0.27, 0.75
    height = row * len(bars)
    with house_style():
        figure = new_figure(WIDTH_IN, top + height + bottom)
        axes = axes_at(figure, left, top, WIDTH_IN - left - 0.75, height)
        for ours, text, colour, hatch in (
            (True, "measured here", EXCITATORY, None),
            (False, "quoted by the paper", PALE, "////"),
        ):
            rows = [i for i, bar in enumerate(bars) if bar.ours is ours]
            axes.barh(
                rows,
                [bars[i].seconds * _MS for i in rows],
                height=0.62,
                color=colour,
                hatch=hatch,
                edgecolor=INK,
                linewidth=0.6,
                label=text,
            )
        for i, bar in enumerate(bars):
            axes.annotate(
                f"{plain(bar.seconds * _MS, 2)} ms",
                (bar.seconds * _MS, i),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=SMALL,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
            )
        step = CONTROL_STEP_S * _MS
        axes.axvline(
            step, color=GREY, linestyle="--", linewidth=1.0, zorder=0.5, label=f"control step, {step:g} ms"
        )
        axes.set_xscale("log")
        axes.set_xlim(10 ** (-4.3), 10**3)
        axes.set_yticks(range(len(bars)), [bar.label for bar in bars])
        axes.invert_yaxis()
        axes.set_xlabel("computation time of a step [ms]")
        tidy(axes)
        axes.grid(visible=False, axis="y")
        plain_legend(axes, "upper left", (-0.1, -0.42 / height), ncols=3, columnspacing=1.8)
    return figure


def _claims(alone: Mapping[str, Times]) -> tuple[Claim, ...]:
    compiled, numpy, solve = alone["compiled"], alone["numpy"], alone["solve"]
    how = f"{RUNS} runs of {compiled.steps} steps, one core"
    ours = f"{_ms(compiled.mean_s)} in C, {_ms(numpy.mean_s)} in numpy"
    as_quick = (compiled.mean_s <= PAPER_MEAN_S, numpy.mean_s <= PAPER_MEAN_S)
    part = max(compiled.mean_s, numpy.mean_s) / CONTROL_STEP_S
    others, longest = (choose(bar.seconds for bar in QUOTED[1:]) for choose in (min, max))
    slowest = max(compiled.mean_s, numpy.mean_s)
    return (
        Claim(
            "A step of the BiNN takes 0.0027 ms on average, or less",
            "0.0027 ms (i7-3517U, 1.9 GHz)",
            ours,
            how,
            all_hold(*as_quick),
            "" if all(as_quick) else _SLOWER,
            "section 5.1",
        ),
        Claim(
            "The coefficient of variation over the runs is 0.62 %",
            "0.62 %",
            f"{100 * compiled.variation:.2g} % in C, {100 * numpy.variation:.2g} % in numpy",
            how,
            all_hold(compiled.variation <= PAPER_VARIATION, numpy.variation <= PAPER_VARIATION),
            ""
            if max(compiled.variation, numpy.variation) <= PAPER_VARIATION
            else "It measures the machine more than the network: what else ran beside it, and its clock.",
            "section 5.1",
        ),
        Claim(
            "That is less than 0.1 % of the control step of 10 ms",
            "0.027 %",
            f"{_percent(compiled.mean_s)} in C, {_percent(numpy.mean_s)} in numpy",
            how,
            all_hold(part < _OF_A_STEP),
            source="section 5.1",
        ),
        Claim(
            "The time is negligible beside that of other methods (20, 40 and 300 ms)",
            f"{others / PAPER_MEAN_S:.0f} to {longest / PAPER_MEAN_S:.0f} times as long",
            f"{others / slowest:.0f} to {longest / slowest:.0f} times as long",
            "their times as the paper quotes them, ours from numpy",
            all_hold(slowest < _NEGLIGIBLE * others),
            source="section 5.1, Fig. 8",
        ),
        Claim(
            "The time is negligible beside that of the MPC that it is compared with",
            "-",
            f"a solve takes {_ms(solve.mean_s)}: {solve.mean_s / compiled.mean_s:.0f} × a step in C, "
            f"{solve.mean_s / numpy.mean_s:.0f} × one in numpy",
            f"{RUNS} runs of {solve.steps} solves, same core, in turns",
            all_hold(compiled.mean_s < _NEGLIGIBLE * solve.mean_s, numpy.mean_s < _NEGLIGIBLE * solve.mean_s),
            "A quadratic program for the CoM alone is solved in a small part of a control step too: "
            f"{_percent(solve.mean_s)} of it. Computation time no longer decides between them.",
            "beyond the paper",
        ),
    )


_SLOWER = (
    "Each call of the numpy backend from Python costs more than the arithmetic of 11 neurons; generated C "
    "does not have that price."
)


def _percent(seconds: float) -> str:
    """Write a time as a part of the control step."""
    return f"{plain(100 * seconds / CONTROL_STEP_S, 2)} %"


def _ms(seconds: float) -> str:
    return f"{plain(seconds * _MS, 2)} ms"


def _table_alone(alone: Mapping[str, Times]) -> Table:
    names = {
        "compiled": "a step of the BiNN, generated C",
        "numpy": "a step of the BiNN, numpy backend",
        "solve": "a solve of the MPC's quadratic program",
    }
    rows = [
        (names[name], f"{times.steps}", _ms(times.mean_s), f"{100 * times.variation:.2g} %")
        for name, times in alone.items()
    ]
    rows.append(
        ("a step of the BiNN, the paper", "1000000", _ms(PAPER_MEAN_S), f"{100 * PAPER_VARIATION:.2g} %")
    )
    headings = ("what", ">steps in a run", ">mean of a step", ">coefficient of variation")
    return Table(f"Alone, {RUNS} runs each", headings, tuple(rows))


def _table_loop(loop: Mapping[str, Times], runs: int) -> Table:
    names = {
        "circuit": "BiNN",
        "mpc": "MPC, joint angles",
        "mpc_full": "MPC, full CoM feedback",
        "dcm_ankle": "ankle PD on the DCM",
    }
    rows = tuple((names[name], _ms(times.mean_s), _percent(times.mean_s)) for name, times in loop.items())
    headings = ("controller", ">mean of a control step", ">part of its 10 ms")
    caption = (
        f"Whole controllers in closed loop with the pushed robot, {runs} runs: reading the sensors' "
        "channels, computing, writing the command. The MPC is solved once a preview step, for the robot and "
        "for its undisturbed twin, and by its closed form where no bound is reached"
    )
    return Table(caption, headings, rows)


def _data(times: Mapping[str, Times]) -> dict[str, object]:
    return {
        name: {
            "mean_s": each.mean_s,
            "coefficient_of_variation": each.variation,
            "steps": each.steps,
            "means_s": each.means_s,
        }
        for name, each in times.items()
    }
