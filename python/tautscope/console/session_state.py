"""The state that the control process publishes, and its summary in one line."""

from msgspec.structs import replace

from tautscope.console.control_run import ControlRun
from tautscope.console.messages import LONGEST_REASON
from tautscope.console.rig_control import RigControl
from tautscope.console.state import ImageState, LogState, State, blank_state, known, values
from tautscope.loop.safety import advice, by_urgency

_MAY_MOVE = "THE MOTORS MAY STILL MOVE"


def session_state(control: RigControl, log: LogState, now: float) -> State:
    """The state of the session, with that of its log, at a time [s, monotonic clock]."""
    operator, lease, run = control.operator, control.lease, control.run
    program = operator.program
    state = blank_state("hardware" if control.is_hardware else "twin", control.config)
    state.now = now
    state.reference, state.scale = values(operator.reference), values(operator.scale)
    state.clutch = tuple(operator.is_coupled.tolist())
    state.compensation = control.compensation
    state.rested_by, state.must_release = operator.rested_by, operator.must_release
    state.is_off_centre = operator.is_off_centre
    state.lease, state.holder = lease.number, lease.holder
    if program is not None:
        state.program, state.progress = program.name, program.elapsed / program.duration
    state.program_ended = operator.program_ended
    state.is_recording = control.is_recording
    state.refused = dict(operator.refused)
    state.stopped_at = control.stopped_at
    state.latched = tuple((name, advice(name)) for name in by_urgency(control.warnings))
    if run is not None:
        _add_run(state, run)
        if control.config.dof:
            state.show_truth(run.sample.true_state, control.kinematics)
    if (written := control.log) is not None:
        state.log = replace(log, dropped=written.dropped, failure=written.failure)
    if run is None:
        state.log.remaining = None  # it is that of a log that grows
    state.image.sequence = control.images.newest
    state.motion, message = _motion(control)
    state.message = message[:LONGEST_REASON]
    state.drives = _drives(control)
    return state


def _add_run(state: State, run: ControlRun) -> None:
    loop, sample, report = run.loop, run.sample, run.report
    state.time = sample.time
    state.command = values(run.command)
    state.applied = values(sample.applied)
    state.tip = known(run.tip)
    state.uncompensated = values(run.uncompensated)
    state.uncompensated_by, state.score = run.uncompensated_by, run.score.errors
    state.delta_minus, state.delta_plus = values(loop.delta_minus), values(loop.delta_plus)
    if (hysteresis := loop.hysteresis) is not None:
        state.width_std = known(2 * hysteresis.width_std)
    supervision = loop.supervision
    state.reaction, state.flags = str(supervision.reaction), supervision.flags
    state.lead = supervision.lead
    state.late = run.late, run.ticks
    if report is not None:
        age = sample.time - report.captured_at
        deviation = known(report.state_deviation)
        status, updates = str(report.status), loop.updates
        state.image = ImageState(0, status, age, run.unused, updates, deviation)


def _motion(control: RigControl) -> tuple[str, str]:
    """The kind of motion, and what is in force and why, in one line."""
    operator, run = control.operator, control.run
    if control.is_opening and control.is_interrupted:
        reason = operator.stopped_by or "The page was away"
        unended = "The rig's reset has not ended: use the emergency stop."
        return "stopped", f"{reason}. {unended}"
    if control.is_opening:
        return "opening", "The motors are being enabled and move to the start position."
    if control.unconfirmed:
        return "unconfirmed", f"{_MAY_MOVE}: {control.unconfirmed}"
    if operator.stopped_by:
        return "stopped", f"{operator.stopped_by}. Motion is stopped until it is enabled."
    if run is not None:
        return _reaction(control, run)
    why = f": {control.fault}" if control.fault else ". Enabling moves them to the start position."
    return "off", f"The motors are off{why}"


def _reaction(control: RigControl, run: ControlRun) -> tuple[str, str]:
    supervision, program = run.loop.supervision, control.operator.program
    motion = "moving" if control.operator.is_moving else "ready"
    if supervision.effect:
        return ("held" if run.is_held else motion), supervision.effect
    if control.compensation == 0:
        text = "Compensation is off; the command follows the reference"
    else:
        text = f"Compensating with {control.compensation * supervision.lead:.0%} of the gain"
    if run.log.failure:
        text += f"; the log has ended: {run.log.failure}"
    if program is not None:
        text += f"; running: {program.name}"
    flags = ", ".join(by_urgency(supervision.flags))
    return motion, f"{text}. In force: {flags}." if flags else f"{text}."


def _drives(control: RigControl) -> str:
    if not control.is_hardware:
        return "simulated"
    if control.is_opening:
        return "being enabled"
    if control.unconfirmed:
        return _MAY_MOVE
    return "enabled" if control.run is not None else "stopped, or off"
