"""What the guards noticed is told with how often, when, and what was done about it."""

from types import SimpleNamespace

import pytest
from drawn import DrawnRig, short_experiment
from tautscope.loop.references import SineSequence
from tautscope.loop.safety import DETECTORS, MEANINGS, Reaction
from tautscope.runs.experiment import run_experiment
from tautscope.runs.flag_summary import Noticed
from tautscope.runs.recording import Recording


def told(seen: list[tuple[Reaction, tuple[str, ...]]], latched: tuple[str, ...]) -> list[str]:
    noticed = Noticed()
    for index, (reaction, warnings) in enumerate(seen):
        noticed.image(0.04 * index, SimpleNamespace(reaction=reaction, warnings=warnings))
    return list(noticed.lines(latched))


def test_a_line_says_how_often_when_and_the_strongest_reaction() -> None:
    seen = [
        (Reaction.NONE, ()),
        (Reaction.WARN, ("lost",)),
        (Reaction.FADE, ("lost", "late")),
        (Reaction.HOLD_ESTIMATE, ("late", "safety.off = frozen: the detector is switched off")),
    ]
    lost, late = told(seen, ("lost", "late"))
    assert lost.startswith(
        "lost (no marker was found, or none that agrees with the prediction) at 2 of 4 images"
    )
    assert "first 0.0 s into the run; meanwhile the compensation faded" in lost
    assert late.startswith("late (") and "at 2 of 4 images, first 0.1 s" in late


def test_what_comes_and_goes_between_images_is_told_too() -> None:
    (line,) = told([(Reaction.NONE, ())], ("reference_jump",))
    assert line.startswith("reference_jump (the reference was faster")
    assert line.endswith("between two images")


@pytest.mark.parametrize("reaction", Reaction)
def test_every_reaction_has_words(reaction: Reaction) -> None:
    assert told([(reaction, ("lost",))], ("lost",))[0].partition("; ")[2]


def test_every_flag_says_what_it_is() -> None:
    assert list(MEANINGS) == list(DETECTORS)
    for name, meaning in MEANINGS.items():
        assert meaning.endswith("."), name
        assert not meaning.startswith("The same,"), f"{name} does not stand alone"


class Blinded(DrawnRig):
    """Pictures without an instrument from 4 to 5 s."""

    def step(self, command):
        sample = super().step(command)
        if sample.frame is not None and 4 <= sample.frame.captured_at < 5:
            sample.frame.image[:] = sample.frame.image[0, 0]
        return sample


def test_a_run_tells_what_it_noticed(compensated: Recording) -> None:
    config = short_experiment()
    rig = Blinded(config)
    found = run_experiment(rig, SineSequence(config.experiment), config)
    (line,) = (line for line in found.warnings if line.startswith("lost ("))
    lost = int((found.frames["status"] == "no_markers").sum())
    assert lost >= 10
    count, total = (int(word) for word in line.split(" at ")[1].split(" images")[0].split(" of "))
    assert total == len(found.frames)
    # It stands a few good images longer.
    assert lost <= count <= lost + 2 * config.safety.good_frames
    assert not any(line.startswith("lost (") for line in compensated.warnings)
