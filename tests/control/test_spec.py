"""Controller files: what ships can be read, mistakes are named at their place."""

from __future__ import annotations

import re

import pytest
from walking import plan_of

from circuitkit.base.errors import InputError
from circuitkit.control import Controller, load_controller, shipped_controllers
from circuitkit.control.spec import KINDS

MPC = """\
controller: own
kind: wieber_mpc
feedback: joint_angles
position_gain: 30 %
preview_step: 20 ms
preview_steps: 75
zmp_weight: 1e6 /s^6
margin: 5 mm
follow: 100 %
lean_per_zmp: 1 rad/m
limit: 15 deg
"""


@pytest.mark.parametrize("name", shipped_controllers())
def test_every_shipped_file_is_named_after_itself_and_builds(name):
    spec = load_controller(name)
    assert spec.controller == name
    controller: Controller = plan_of(duration=1.5).controller(name)
    assert controller.name == name
    controller.reset(2)


def test_every_kind_is_found_by_its_name():
    assert KINDS["dcm_ankle"].__name__ == "DcmAnkleSpec"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "controller: own\nkind: dcm_ankel\n",
            "2:7: kind: unknown kind 'dcm_ankel'; allowed: KINDS; did you mean 'dcm_ankle'?",
        ),
        (
            "controller: own\nkind: dcm_ankle\nlateral:\n  proportional: 8 rad/m\n  limti: 15 deg\n",
            "5:3: lateral.limti: unknown key 'limti'; allowed: derivative, derivative_filter, limit, "
            "proportional, walk_delay, walk_sway; did you mean 'limit'?",
        ),
        (
            "controller: own\nkind: dcm_ankle\nlateral: {proportional: 8 deg, limit: 15 deg}\n",
            "3:25: lateral.proportional: found '8 deg', which is angle; "
            "allowed: a quantity such as '8 rad/m'",
        ),
        (
            "controller: own\nkind: dcm_ankle\n",
            "1:1: neither lateral nor sagittal is there; allowed: one of them, or both",
        ),
        (
            MPC + "velocity_gain: 50 %\n",
            "1:1: found velocity_gain 0.5 with feedback joint_angles; allowed: 0, or feedback com",
        ),
        (
            MPC + "axes: [sagittal]\n",
            "1:1: found the axis sagittal with feedback joint_angles; allowed: lateral, of which eq. 3 "
            "speaks, or feedback com",
        ),
        (
            MPC.replace("joint_angles", "joint_angels"),
            "3:11: feedback: found 'joint_angels'; allowed: joint_angles, com; did you mean 'joint_angles'?",
        ),
    ],
)
def test_mistakes_are_told_with_line_and_column(tmp_path, text, message):
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(message.replace("KINDS", ", ".join(KINDS.kinds)))):
        load_controller(path)


def test_values_can_be_changed_and_are_checked_like_the_files():
    assert load_controller("dcm_ankle", {"lateral.limit": "0.1 rad"}).lateral.limit == 0.1
    with pytest.raises(InputError, match="unknown key 'limti'"):
        load_controller("dcm_ankle", {"lateral.limti": "1 deg"})


def test_an_unknown_controller_is_told_with_built_ins_and_files():
    message = (
        f"unknown controller 'dcm_ancle'; allowed: open_loop, circuit, {', '.join(shipped_controllers())}"
    )
    with pytest.raises(InputError, match=re.escape(message) + "; did you mean 'dcm_ankle'"):
        plan_of(duration=1.5).controller("dcm_ancle")
