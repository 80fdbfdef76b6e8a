"""The summary of flags: how many images, since when, and the reaction."""

import pytest
from drawn import DrawnRig, short_experiment
from tautscope import axes
from tautscope.config import Config
from tautscope.loop.references import SineSequence
from tautscope.loop.safety import DETECTORS, MEANINGS, REMEDIES, Reaction, by_urgency
from tautscope.runs.experiment import run_experiment
from tautscope.runs.flag_summary import FlagSummary
from tautscope.runs.recording import Recording


def summarise(
    images: list[tuple[Reaction, tuple[str, ...]]],
    latched: tuple[str, ...],
    config: Config | None = None,
) -> list[str]:
    flags = FlagSummary(config or Config())
    for index, (reaction, warnings) in enumerate(images):
        flags.add(0.04 * index, warnings, reaction)
    return list(flags.lines(latched))


def test_a_line_says_how_often_when_and_the_strongest_reaction() -> None:
    images = [
        (Reaction.NONE, ()),
        (Reaction.WARN, ("lost",)),
        (Reaction.FADE, ("lost", "late")),
        (Reaction.HOLD_ESTIMATE, ("late", "safety.off = frozen: nobody looks for it")),
    ]
    lost, late = summarise(images, ("lost", "late"))
    assert lost.startswith(
        "lost (nothing was measured that agrees with the prediction: no marker, or no value of a "
        "sensor) at 2 of 4 images"
    )
    assert "first 0.0 s into the run, for 0.0 s in all; the compensation faded out" in lost
    assert late.startswith("late (") and "at 2 of 4 images, first 0.1 s" in late


def test_a_line_says_for_how_long_and_whether_to_the_end() -> None:
    flags, period = FlagSummary(Config()), Config().control.period
    flags.add(0.0, (), Reaction.NONE)
    for tick in range(100, 1000):
        names = ("dropped", *["tremor"] * (tick < 500))
        reaction = Reaction.FADE if tick == 990 else Reaction.HOLD_ESTIMATE
        flags.add_tick(period * tick, names, reaction)
    dropped, tremor = flags.lines(("dropped", "tremor"))
    assert "at 0 of 1 images, first 0.5 s into the run, for 4.5 s in all, also at" in dropped
    assert "the compensation faded out meanwhile" in dropped
    assert "first 0.5 s into the run, for 2.0 s in all; the estimates were held" in tremor


def test_a_flag_within_a_tick_is_listed() -> None:
    (line,) = summarise([(Reaction.NONE, ())], ("reference_jump",))
    assert line.startswith("reference_jump (the reference jumped")
    assert line.endswith("for less than a control period")


def test_of_another_robot_they_are_measurements() -> None:
    (line,) = summarise([(Reaction.WARN, ("late",))], ("late",), axes(2, width_limit=1.0))
    assert "at 1 of 1 measurements, first" in line


@pytest.mark.parametrize("reaction", Reaction)
def test_every_reaction_has_a_consequence(reaction: Reaction) -> None:
    assert summarise([(reaction, ("lost",))], ("lost",))[0].partition("; ")[2]


def test_every_flag_has_a_meaning_and_a_remedy() -> None:
    assert list(MEANINGS) == list(DETECTORS)
    assert sorted(REMEDIES) == sorted(DETECTORS)
    assert by_urgency(("tremor", "drive_fault", "lost")) == ["drive_fault", "lost", "tremor"]
    for name, meaning in MEANINGS.items():
        assert meaning.endswith("."), name
        assert not meaning.startswith("The same,"), f"{name} does not stand alone"


class Blinded(DrawnRig):
    """Images without an instrument from 4 to 5 s."""

    def step(self, command):
        sample = super().step(command)
        if sample.frame is not None and 4 <= sample.frame.captured_at < 5:
            sample.frame.image[:] = sample.frame.image[0, 0]
        return sample


def test_a_recording_has_the_flags_of_its_run(compensated: Recording) -> None:
    config = short_experiment()
    rig = Blinded(config)
    found = run_experiment(rig, SineSequence(config.experiment), config)
    (line,) = (line for line in found.warnings if line.startswith("lost ("))
    lost = int((found.frames["status"] == "no_markers").sum())
    assert lost >= 10
    count, total = (int(word) for word in line.split(" at ")[1].split(" images")[0].split(" of "))
    assert total == len(found.frames)
    # A flag stays in force for a few good images.
    assert lost <= count <= lost + 2 * config.safety.good_frames
    assert not any(line.startswith("lost (") for line in compensated.warnings)
