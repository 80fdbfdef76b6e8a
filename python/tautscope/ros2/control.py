"""The control process of the node: requests, rig, loop, telemetry; one thread, no lock."""

import dataclasses
import logging
import time
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

from tautscope.config import Config
from tautscope.console.control_run import ControlRun, warm_up
from tautscope.errors import ConfigError, MessageError, TautscopeError, described
from tautscope.loop.operating_state import STATE_COMMANDS, OperatingState, StateMachine
from tautscope.loop.rig import Rig, disable, reset_unless
from tautscope.loop.safety import Reaction
from tautscope.report.achieved import Achieved, achieved_text
from tautscope.ros2.driver import DriverRig
from tautscope.ros2.inputs import JoyAxes
from tautscope.ros2.lifecycle import ACTIVATE, CONFIGURE, DEACTIVATE, Lifecycle, State, Transition
from tautscope.ros2.parameters import Parameters
from tautscope.ros2.references import JoyReference, ServoReference
from tautscope.ros2.sensors import Sensors
from tautscope.ros2.session import Clock, Node
from tautscope.ros2.telemetry import Telemetry
from tautscope.ros2.wire import Qos

_LOG = logging.getLogger(__name__)
_IDLE_PERIOD = 0.005
"""Time between two checks for requests while no loop runs [s]."""
MakeRig = Callable[[Config], Rig]
"""Makes the rig that the loop commands."""


class NodeControl:
    """Runs the loop by the requests to a node.

    `make_rig` is called in the transition ``configure``; it is None for a driver in ROS. `device`
    is the topic of the reference, ``servo_jp`` or ``joy``. `on_result` is called at the end of a
    run with a line about what the compensation achieved.

    Attributes:
        run: The present run; None if the node is not active.
        fault: Why the last run ended, if no request ended it.
        is_unconfirmed: Whether the rig did not confirm its last stop: until it is enabled again,
            the motors may move.

    Raises:
        ConfigError: Without a rig of its own nothing would measure the tip.
    """

    def __init__(
        self,
        config: Config,
        node: Node,
        folder: Path,
        executor: Executor,
        clock: Clock,
        *,
        make_rig: MakeRig | None,
        device: str,
        layout: JoyAxes,
        on_result: Callable[[str], None] = lambda _: None,
    ) -> None:
        if config.dof and make_rig is None and not config.measurement.topics:
            raise ConfigError("measurement.topics", None, "a topic that measures the tip")
        self._config, self._folder, self._executor = config, folder, executor
        self._on_result, self._achieved = on_result, Achieved(config)
        self._telemetry = Telemetry(config, node, clock, has_rig=make_rig is not None)
        refuse, self._states = self._telemetry.refuse, StateMachine()
        joints = [dof.label for dof in config.dofs]
        self._source = (
            JoyReference(config, node, layout, clock=clock, refuse=refuse, states=self._states)
            if device == "joy"
            else ServoReference(node, joints, clock, refuse, self._states)
        )
        self._sensors = Sensors(config, node, clock, refuse)
        if make_rig is None:
            driver = DriverRig(config, node, clock, refuse)
            make_rig = lambda _: driver  # noqa: E731
        self._make_rig = make_rig
        self._rig: Rig | None = None
        self.run: ControlRun | None = None
        self.fault = ""
        self.is_unconfirmed = self._is_disabling = False
        self._runs = 0
        self._node = node
        self._commands = node.subscription(
            "instrument/state_command", "crtk_msgs/msg/StringStamped", Qos(depth=10)
        )
        self.lifecycle = Lifecycle(node, self._change)
        self.parameters = Parameters(node, clock, config, self._set_compensation)

    def main(self) -> None:
        """Run until the node is finalized."""
        while self.lifecycle.state is not State.FINALIZED:
            self.serve()
            if self.run is None:
                time.sleep(_IDLE_PERIOD)
            else:
                self.tick(self.run)

    def serve(self) -> None:
        """Execute the requests that wait, and publish the state if it is due."""
        while (command := self._take_command()) is not None:
            self._execute(command)
        self._node.serve()
        self._publish_state()
        self._telemetry.diagnose(self.run, self.operating_state, self.fault)

    def tick(self, run: ControlRun) -> None:
        """A tick of the loop; a fault ends the run, with the drives stopped."""
        try:
            for source, report, _ in run.tick():
                self._achieved.add_update(run.sample.time, source, report)
                self._telemetry.update(run, source, report)
            self._telemetry.tick(run)
            supervision = run.loop.supervision
            share = supervision.lead * run.compensation
            self._achieved.add_tick(run.sample, run.reference, run.command, share)
            if supervision.reaction.rank >= Reaction.QUICK_STOP.rank:
                self._is_disabling = supervision.reaction is Reaction.DISABLE
                self._fail(f"{supervision.reaction}: {', '.join(supervision.flags)}")
                return
            run.step()
            sample = run.sample
            if found := self._sensors.take(sample.time):
                measured = (*sample.measurements, *found)
                run.sample = dataclasses.replace(sample, measurement=measured)
        except TautscopeError as error:
            self._fail(described(error))

    @property
    def operating_state(self) -> OperatingState:
        """The state in the words of CRTK."""
        return self._states.state(self._reaction)

    @property
    def _reaction(self) -> Reaction:
        return Reaction.NONE if self.run is None else self.run.loop.supervision.reaction

    def shut_down(self) -> None:
        """Stop the motors, close the log, release the rig."""
        try:
            self._end_run()
        finally:
            self._publish_state()
            self._telemetry.close()
            self._release_rig()

    def _set_compensation(self, share: float) -> None:
        if self.run is not None:
            self.run.set_compensation(share)

    def _take_command(self) -> str | None:
        try:
            message = self._commands.take()
        except MessageError as error:
            self._telemetry.refuse(error)
            return ""
        return None if message is None else str(message.string)

    def _execute(self, command: str) -> None:
        if command == "enable":
            self.lifecycle.trigger(CONFIGURE)
            self.lifecycle.trigger(ACTIVATE)
        elif command == "disable":
            if self.is_unconfirmed:
                self._telemetry.warn(self.fault)  # a rig that is left cannot be asked again
                return
            self.fault, self._is_disabling = "", True
            self._states.accept(command, self._reaction)
            self.lifecycle.trigger(DEACTIVATE)
        elif command in STATE_COMMANDS:
            self._states.accept(command, self._reaction)
            if command == "resume" and self.run is not None:
                # Also where nothing is paused: then another publisher may take over.
                self._source.engage()
                self.run.loop.engage()
        elif command:
            field = f"{self._commands.topic} string"
            self._telemetry.refuse(MessageError(field, command[:32], ", ".join(STATE_COMMANDS)))

    def _change(self, transition: Transition) -> bool:
        """Carry out a transition of the lifecycle."""
        try:
            if transition is CONFIGURE:
                self._rig = self._make_rig(self._config)
            elif transition is ACTIVATE:
                self._start_run()
            else:
                self._end_run()
                if transition.goal in (State.UNCONFIGURED, State.FINALIZED):
                    self._release_rig()
        except TautscopeError as error:
            is_start = transition in (CONFIGURE, ACTIVATE)
            faults = [described(error)]
            if not is_start and self.fault:
                faults.insert(0, self.fault)  # for which the rig was to stop
            if transition is ACTIVATE and self._rig is not None:
                try:
                    self._rig.close()
                except TautscopeError as unconfirmed:
                    self.is_unconfirmed = True
                    faults.append(described(unconfirmed))
            self._set_fault("; ".join(faults))
            # A rig that cannot be stopped orderly is left in any case.
            return not is_start
        return True

    def _release_rig(self) -> None:
        rig, self._rig = self._rig, None
        if rig is not None:
            rig.close()

    def _start_run(self) -> None:
        """Enable the rig and start the loop at rest, where the instrument is."""
        rig = self._rig
        assert rig is not None
        self.fault, self._is_disabling = "", False
        self._states.goal = OperatingState.DISABLED
        self._telemetry.state(self.operating_state, is_busy=True)
        warm_up(self._config)
        sample = reset_unless(rig, lambda: self._take_command() in ("disable", "pause"))
        self.is_unconfirmed = False
        self._source.reset(sample.applied)
        self._sensors.reset()
        self._runs += 1
        self._achieved = Achieved(self._config)
        path = self._folder / f"ros2-{self._runs}.mcap"
        run = ControlRun(
            self._config, rig, sample, self._source, path=path, executor=self._executor
        )
        run.set_compensation(float(self.parameters["compensation"]))
        self.run = run
        self._states.accept("enable", self._reaction)

    def _end_run(self) -> None:
        """Stop the drives, then close the log."""
        run, self.run = self.run, None
        if run is None:
            return
        self.is_unconfirmed = True
        try:
            if self._rig is not None and self._is_disabling:
                disable(self._rig)
            elif self._rig is not None:
                self._rig.close()
            self.is_unconfirmed = False
        finally:
            is_fault = self.fault or self.is_unconfirmed
            self._states.goal = OperatingState.FAULT if is_fault else OperatingState.DISABLED
            self._publish_state()
            try:
                self._tell_result(run)
            finally:
                run.log.close()

    def _tell_result(self, run: ControlRun) -> None:
        """Publish, log and print what the compensation achieved."""
        if results := self._achieved.results():
            text = achieved_text(results)
            run.note(text)
            self._telemetry.result(text)
            self._on_result(text)

    def _fail(self, fault: str) -> None:
        """End the run because of a fault."""
        if self.run is not None:
            self.run.note(f"rig off: {fault}")
        self._set_fault(fault)
        self.lifecycle.trigger(DEACTIVATE)

    def _set_fault(self, fault: str) -> None:
        _LOG.warning("%s", fault)
        self.fault, self._states.goal = fault, OperatingState.FAULT
        self._telemetry.warn(fault)

    def _publish_state(self) -> None:
        self._telemetry.state(self.operating_state, is_homed=self.run is not None)
