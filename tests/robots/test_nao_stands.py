"""A NAO that only stands is pushed: what the page says of it."""

from __future__ import annotations

import numpy as np
import pytest
from seeds import changed, measured, run_seeds

from circuitkit.simulation import load_scenario, simulate
from circuitkit.simulation.scenario import parse_push, with_push


@pytest.mark.parametrize(
    ("force", "circuit", "stands"),
    [
        ("18N", "binn_lateral_tuned", 6),
        ("20N", "binn_lateral_capture_tuned", 6),
        ("24N", "binn_lateral_capture_tuned", 0),
    ],
)
def test_what_the_table_says_of_pushes_for_200_ms(force, circuit, stands):
    shipped = load_scenario("nao_stands")
    pushed = with_push(shipped, parse_push(f"{force},200ms,left", shipped))
    recording = run_seeds(changed("nao_stands", pushed, circuit=circuit, duration=6.0), range(6))
    assert measured(recording, "survived").sum() == stands


def test_unpushed_it_stands_still_with_the_zmp_between_the_feet():
    result = simulate("nao_stands", controller="open_loop", push="0.001N,100ms,left")
    zmp_x, zmp_y = (result.recording.channel(name)[300:, 0] for name in ("zmp_x", "zmp_y"))
    assert np.abs(zmp_y).max() < 0.002
    np.testing.assert_allclose(zmp_x.mean(), 0.0257, atol=0.004)
    assert np.abs(result.recording.channel("gyro_x")[400:]).max() < 0.02
