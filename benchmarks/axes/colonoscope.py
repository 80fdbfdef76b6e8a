"""An operator's motion on the simulated colonoscope, and the delay of its tracker."""

from tautscope.calibration.robot import fit, move, sweep_motion
from tautscope.commands.robot_calibration import result
from tautscope.config import load_config
from tautscope.report.operator_motion import evaluate_operator_motion, motion_of
from tautscope.runs.experiment import run_experiment
from tautscope.twin.colonoscope import ColonoscopeTwin

DELAY, UNTOLD = 0.05, 0.1
"""Delay of the tracker, which it tells, and one that it does not tell [s]."""
Job = tuple[str, int]
"""What is measured, "motion" or "delay", and the seed of instrument and motion."""


KEPT = ("kinematics.base_rotation", "kinematics.sensor_rotation", "kinematics.skew")
"""What is known of the twin: its tracker's axes are those of the kinematics."""


def simulate(job: Job) -> list[float]:
    """Reductions of the RMS tracking error, or the delay found [s].

    Reductions are of each degree of freedom, calibrated as `tautscope calibrate robot --write`
    does, and of the insertion with the preset.
    """
    what, seed = job
    config = load_config("colonoscope")
    if what == "delay":
        rig = ColonoscopeTwin(seed, delay=UNTOLD, told_delay=0.0)
        record = move(rig, motion_of(config, seed, 60.0), config)
        rig.close()
        return [fit(record, config, ["kinematics"]).values["measurement.delays[0]"]]
    found = fit(
        move(ColonoscopeTwin(seed, delay=DELAY), sweep_motion(config), config), config, KEPT
    )
    calibrated = config.replace(**result("robot", found, config).rounded_values())
    motion = motion_of(config, seed, 120.0)
    free, *runs = (
        run_experiment(ColonoscopeTwin(seed, delay=DELAY), motion, own, compensate)
        for own, compensate in ((config, False), (calibrated, True), (config, True))
    )
    own, preset = ([*evaluate_operator_motion(free, run).values()] for run in runs)
    return [each.reduction for each in (*own, preset[-1])]
