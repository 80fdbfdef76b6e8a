"""Errors of CiA 402 drives, with what to do about each."""

from tautscope.config.drives import waiver_hint
from tautscope.errors import DriveError, ModeRefusedError, SilentDriveError, StateError
from tautscope.hardware import cia402
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.drive_group import RESET, Feedback


def mode_refused(name: str, mode: Mode, shown: int) -> ModeRefusedError:
    """The error for a drive that shows another mode than it was asked for."""
    other = "End every other program that commands it" if shown else waiver_hint("6061")
    return ModeRefusedError(
        name,
        f"it did not enter mode {mode.value}: mode display (0x6061) is {shown}",
        f"Disable it, and look up in its manual what mode {mode.value} requires. {other}",
    )


def ignores_setpoints(name: str, feedback: Feedback) -> StateError:
    """The error for a drive that is enabled and says that it follows no set-points."""
    return StateError(
        name,
        f"it ignores set-points (statusword 0x{feedback.statusword:04X}, bit 12)",
        f"Check its limit switches and inputs; it may be halted. {waiver_hint('6041.12')}",
    )


def transition_error(name: str, feedback: Feedback, mode: Mode, timeout: float) -> DriveError:
    """The error for a drive that has not reached the next state for `timeout` [s]."""
    if feedback.silence > timeout / 2:
        return SilentDriveError(
            name,
            f"no answer to {feedback.age} set-points",
            "Check its supply, and whether it supports synchronous PDOs",
        )
    if cia402.state_of(feedback.statusword) is State.OPERATION_ENABLED:
        if feedback.mode != mode:
            return mode_refused(name, mode, feedback.mode)
        return ignores_setpoints(name, feedback)
    return state_error(name, feedback, "it stays in {}")


def state_error(
    name: str, feedback: Feedback, what: str = "it is in {}, not operation enabled"
) -> StateError:
    """The error for a drive that is in the wrong state."""
    state = cia402.state_of(feedback.statusword)
    shown = "a state unknown to CiA 402" if state is None else state.value
    remedy = "Check its supply, its enable input and its limit switches"
    if state in (State.FAULT, State.FAULT_REACTION):
        remedy = f"Look its error code up in the manual (tautscope doctor shows it), then {RESET}"
    elif not feedback.statusword & cia402.REMOTE:
        remedy = (
            "Its statusword says that it is not commanded from the bus (bit 9): end its maker's "
            "program, or choose the bus as the source of commands there; then check its supply, "
            "its enable input and its limit switches"
        )
    return StateError(
        name, f"{what.format(shown)} (statusword 0x{feedback.statusword:04X})", remedy
    )
