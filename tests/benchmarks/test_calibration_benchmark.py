"""The tables of the calibration benchmark."""

from calibration.evaluation import VARIANTS, Outcome
from calibration.tables import loop_table


def outcome(*stopped: str) -> Outcome:
    errors = {"none": 1.0, "told": 0.4, "calibrated": 0.2, "exact": 0.1}
    hand = {name: [errors[name]] * 3 for name in VARIANTS if name not in stopped}
    state = {name: each for name, each in hand.items() if name != "none"}
    return Outcome(hand=hand, state=state)


def test_a_run_that_ended_early_counts_as_a_reduction_of_minus_100() -> None:
    (line, *_) = loop_table([outcome(), outcome(), outcome("calibrated")]).splitlines()[2:]
    assert line == "| insertion | 2.00 (2.00) | 4.00 | 80 % | 90 % | 60 % | 10.0 (190.0) |"
    (line, *_) = loop_table([outcome(), *[outcome("told")] * 2]).splitlines()[2:]
    assert "| 80 % | 90 % | -100 % |" in line
