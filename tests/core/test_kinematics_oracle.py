"""Kinematics, Eq. (7), against MuJoCo: a chain of many short links whose hinges share the bend.

The error of a chain of equal links with equal hinge angles is of second order in the link length;
the test extrapolates it from two chains.
"""

from functools import cache

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope import _core

BENDING_LENGTH, MARKER_A, MARKER_B = 18.5e-3, 5e-3, 15e-3


@cache
def chain(links: int) -> mujoco.MjModel:
    """A slide, a rotation, `links` links with a hinge before, between and after them, the tip."""
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    step = BENDING_LENGTH / links
    xml = f'<body>{inertia}<joint type="slide" axis="0 0 1"/><joint axis="0 0 1"/>'
    for link in range(links + 1):
        offset = 0.0 if link == 0 else step
        xml += f'<body pos="0 0 {offset!r}">{inertia}<joint axis="0 1 0"/>'
    xml += f'<site name="a" pos="0 0 {MARKER_A}"/><site name="b" pos="0 0 {MARKER_B}"/>'
    xml += "</body>" * (links + 2)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><worldbody>{xml}</worldbody></mujoco>'
    )


def rigid_body_markers(state: NDArray[np.float64], links: int) -> NDArray[np.float64]:
    model = chain(links)
    data = mujoco.MjData(model)
    bend = np.full(links + 1, state[2] / links)
    # The first and last hinge have half the angle: the chain is tangent to the arc at both ends.
    bend[[0, -1]] /= 2
    data.qpos[:] = [state[0], state[1], *bend]
    mujoco.mj_kinematics(model, data)
    return np.array(data.site_xpos)


@pytest.mark.parametrize("seed", range(4))
def test_markers_equal_those_of_a_rigid_body_chain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    instrument = _core.Instrument(
        bending_length=BENDING_LENGTH,
        marker_a=MARKER_A,
        marker_b=MARKER_B,
        radius=1.75e-3,
        band_length=4e-3,
    )
    states = rng.uniform([0.0, -3.0, -2.5], [0.04, 3.0, 2.5], (20, 3))
    states[0, 2] = 0.0
    states[1, 2] = 1e-5
    for state in states:
        coarse, fine = rigid_body_markers(state, 30), rigid_body_markers(state, 60)
        found = instrument.markers(state)
        limit = fine + (fine - coarse) / 3
        np.testing.assert_allclose(found, limit, atol=2e-9, err_msg=f"seed {seed}, {state}")
        if abs(state[2]) > 0.5:
            ratio = np.linalg.norm(coarse - found) / np.linalg.norm(fine - found)
            assert ratio == pytest.approx(4.0, rel=0.01), f"not second order: seed {seed}, {state}"
