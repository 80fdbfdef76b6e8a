"""What the main objects print: their contents, or a call that makes an equal object."""

import numpy as np
import pytest
import tautscope
from tautscope import (
    Camera,
    Compensator,
    Config,
    Estimator,
    HysteresisReduction,
    Instrument,
    Play,
    Twin,
    config,
    load_config,
)
from tautscope.dof import Dof, display_text
from tautscope.loop.references import OperatorMotion, SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.vision import MarkerDetector
from tautscope.metrics import loop_width
from tautscope.runs.recording import Recording

NAMES = vars(config)
LONGEST = 200
"""A line or two of a terminal."""


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_a_configuration_prints_the_call_that_makes_it(profile: str) -> None:
    changed = Config(profile=profile).replace(
        **{"twin.seed": 3, "insertion.free_gain": 4.0, "camera.source.url": "clip.avi"}
    )
    assert eval(repr(changed), NAMES) == changed
    assert len(repr(changed)) < 400
    assert repr(Config(profile=profile)) == f"Config(profile={profile!r})"


def test_a_configuration_of_a_rig_prints_the_call_that_makes_it() -> None:
    rig = load_config("bench")
    assert rig.drives is not None
    assert eval(repr(rig), NAMES) == rig


def test_play_prints_the_call_that_makes_it() -> None:
    play = Play(delta_minus=-1e-7, delta_plus=0.25)
    play.step(3.0)
    again = eval(repr(play), {"Play": Play})
    assert (again.delta_minus, again.delta_plus, again.output) == (-1e-7, 0.25, 2.75)


def test_compiled_objects_print_their_values() -> None:
    compensator = Compensator(free_gain=4, gain_limit=5, delta_minus=-1, delta_plus=1)
    assert "free_gain=4.0, gain_limit=5.0" in repr(compensator)
    assert "delta_minus=-1.0, delta_plus=1.0, command=nan)" in repr(compensator)
    compensator.step(0.5)
    compensator.set_offsets(-2, 3)
    assert "delta_minus=-2.0, delta_plus=3.0, command=0.5)" in repr(compensator)
    estimator = Estimator(
        update_distance=0.1, contact_tolerance=0.2, smoothing_factor=0.3, delta_minus=0,
        delta_plus=0.5,
    )  # fmt: skip
    assert repr(estimator) == (
        "Estimator(update_distance=0.1, contact_tolerance=0.2, smoothing_factor=0.3, "
        "delta_minus=0.0, delta_plus=0.5)"
    )
    camera = Camera(fx=600, fy=601, cx=360, cy=288, distortion=[0.0] * 8)
    assert "600.0, 601.0" in repr(camera) and "360.0, 288.0" in repr(camera)
    instrument = Instrument(
        bending_length=0.02, marker_a=0.001, marker_b=0.01, radius=0.00115, band_length=0.003
    )
    assert "bending_length=0.02" in repr(instrument)


def test_the_loop_and_its_reports_print_their_state() -> None:
    settings = load_config(profile="paper")
    loop, twin = HysteresisReduction(settings), Twin(settings)
    assert repr(twin) == "<Twin: seed 0, 25 images/s, closed>"
    sample = twin.reset()
    loop.step(SineSequence(settings.experiment)(0.0), 0.0)
    report = None
    while report is None:
        sample = twin.step(sample.applied)
        loop.step(sample.applied, sample.time)
        if sample.frame is not None:
            report = loop.on_frame(sample.frame)
    assert report.detection is not None
    texts = {
        repr(loop): ["profile paper", "1 updates", display_text(report.delta_plus)[:1]],
        repr(report): [
            f"{report.captured_at:.3f} s",
            report.status,
            f"tip at {report.state_estimate[0]:.3g}, ",
        ],
        repr(report.detection): ["band A at (", f"{report.detection.features[2]:.1f}"],
        repr(sample): [f"{sample.time:.3f} s", "frame 0", f"applied {sample.applied[0]:.3g}, "],
        repr(sample.frame): ["720 x 576"],
        repr(twin): [f"at {twin.time:.3f} s"],
        repr(MarkerDetector(settings)): ["bgr", "576, 720"],
        repr(SineSequence(settings.experiment)): ["insertion 0 to ", "rotation ", "bending "],
        repr(OperatorMotion(settings.experiment, 7)): ["seed=7"],
    }
    for text, parts in texts.items():
        assert len(text) < LONGEST, text
        assert all(part in text for part in parts), text


def test_a_recording_prints_its_length(compensated: Recording) -> None:
    ticks, images = len(compensated.trace), len(compensated.frames)
    assert f"{ticks} ticks" in repr(compensated) and f"{images} updates" in repr(compensated)
    assert "with compensation" in repr(compensated)


def test_a_width_and_a_snapshot_print_no_arrays(compensated: Recording) -> None:
    width = loop_width([0, 1, 1, 0, 0], [0, 0, 1, 1, 0])
    assert repr(width) == "<LoopWidth: mean 1, largest 1, 41 of 41 levels>"
    assert compensated.snapshot is not None
    assert "720 x 576" in repr(compensated.snapshot)


def test_values_are_printed_in_their_display_units() -> None:
    assert display_text([0.00981, 1.756, -0.5]) == "9.81 mm, 1.76 rad, -0.5 rad"
    assert [dof.display_unit for dof in Dof] == ["mm", "rad", "rad"]


def test_a_sample_and_a_frame_without_contents() -> None:
    assert "no frame" in repr(Sample(0.0, np.zeros(3)))
    assert "3 x 2" in repr(Frame(np.zeros((2, 3, 3), np.uint8), 0.0, 0))
    assert "720 x 576" in repr(Frame(np.zeros((864, 720), np.uint8), 0.0, 0))


def test_every_public_object_has_a_text_of_its_own() -> None:
    protocols = {"Rig", "TautscopeError", "Dof"}
    for name in set(tautscope.__all__) - protocols:
        kind = getattr(tautscope, name)
        if isinstance(kind, type):
            assert kind.__repr__ is not object.__repr__, name
