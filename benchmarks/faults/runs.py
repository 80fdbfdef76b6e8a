"""All runs of one seed of the fault campaign."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from faults.evaluation import Outcome, Traces, evaluate_run
from faults.instrument import Instrument
from faults.recorder import RunRecorder
from faults.scenarios import DURATION, START_KINDS, build_config, draw_fault, with_start_values
from tautscope.config import Config, Profile
from tautscope.errors import ConfigError
from tautscope.loop.safety import DETECTORS, Reaction
from tautscope.twin.faults import Fault


def run_seed(
    seed: int,
    kinds: Sequence[str],
    profile: Profile = "best",
    off: tuple[str, ...] = (),
    longest: float = DURATION[1],
) -> list[Outcome]:
    """Run each kind of fault with one seed; transient ones last `longest` at most [s]."""
    config = build_config(seed, profile, off)
    outcomes = run_start_faults(config, seed, [kind for kind in kinds if kind in START_KINDS])
    later = [kind for kind in kinds if kind not in START_KINDS]
    return outcomes + (Instrument(config, seed, off).run_faults(later, longest) if later else [])


def run_with_each_off(
    seed: int, kinds: Sequence[str], profile: Profile = "best"
) -> dict[str, list[Outcome]]:
    """Run each kind of fault with one seed and each detector off in turn.

    A detector that raises no flag, neither with the fault nor without, does not influence the run;
    the run with all detectors on then stands for the one without it.
    """
    all_on = run_seed(seed, kinds, profile)
    found = {}
    for name in DETECTORS:
        affected = [each.kind for each in all_on if name in each.raised]
        repeated = {each.kind: each for each in run_seed(seed, affected, profile, (name,))}
        # `raised` tells which runs were repeated: the detector that is off raises nothing.
        found[name] = [
            replace(repeated[each.kind], raised=each.raised) if each.kind in repeated else each
            for each in all_on
        ]
    return found


def run_start_faults(config: Config, seed: int, kinds: Sequence[str]) -> list[Outcome]:
    """Run faults of the start values, compared with the loop that has the right ones."""
    outcomes: list[Outcome] = []
    nominal: Traces | None = None
    for kind in kinds:
        fault = draw_fault(kind, seed, 0.0)
        try:
            wrong = with_start_values(config, fault)
        except ConfigError:
            outcomes.append(_refused(config, seed, fault))
            continue
        if nominal is None:
            right = with_start_values(config, Fault("ok"))
            nominal = Instrument(right, seed, is_cold=True).run()
        run = Instrument(wrong, seed, is_cold=True).run()
        outcomes.append(evaluate_run(seed, fault, run, nominal, nominal.summary))
    return outcomes


def _refused(config: Config, seed: int, fault: Fault) -> Outcome:
    """Return the outcome of a configuration that was refused before any motion."""
    nothing = np.zeros((0, 3))
    recorder = RunRecorder(lambda: 0.0, 0.0, config.control.period)
    recorder.record_flag("ConfigError", 0.0)
    recorder.record_reaction(0.0, Reaction.DISABLE)
    run = Traces(nothing, nothing, recorder.summary(), nothing, nothing)
    return evaluate_run(seed, fault, run, None, {"flags": {}})
