"""The article's experiment on a physical rig: ``tautscope run``."""

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tautscope.config import Config
from tautscope.errors import STOPPED, OutputError, TautscopeError
from tautscope.hardware.plausibility import PlausibilityMonitor, check_experiment
from tautscope.hardware.realtime import OTHERS, VISION, realtime_executor, realtime_process
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.run_results import HardwareRun, ProtocolRun
from tautscope.hardware.signals import exit_on_signals
from tautscope.log.writer import run_log
from tautscope.loop.references import Reference, SineSequence
from tautscope.loop.rig import apply_reaction
from tautscope.runs.experiment import run_experiment
from tautscope.runs.output_folder import check_free

_LOG = logging.getLogger(__name__)


def run_on_hardware(
    config: Config,
    folder: Path,
    progress: Callable[[float], None],
    reference: Reference | None = None,
    *,
    compare: bool = False,
    make_rig: Callable[[Config], HardwareRig] = HardwareRig,
) -> HardwareRun:
    """Run a reference on the configured drives and camera, and log every run.

    The motors are quick-stopped and the log is closed on every exit, also after SIGTERM and SIGHUP.
    A run that is refused before the loop begins leaves no log and no folder.

    Args:
        config: With a section ``drives``.
        folder: New or empty; the log is written there from the start.
        progress: Called with the fraction of the work done, 0 to 1.
        reference: By default the article's protocol.
        compare: Run without compensation first, to compute the reduction.
        make_rig: Makes the rig.

    Raises:
        ConfigError: The rig differs from its configuration; see `PlausibilityMonitor`. The drives
            cannot make the commands; see `check_experiment`.
        TautscopeError: Drives, camera or loop failed.
    """
    kinds = (False, True) if compare else (True,)
    if reference is None:
        check_experiment(config)
    rig = make_rig(config)  # an invalid configuration must leave no folder behind
    try:
        check_free(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError("out", str(folder), f"a place that can be written ({error})") from None
    runs = []
    with exit_on_signals(), realtime_process(OTHERS):
        for index, compensate in enumerate(kinds):
            runs.append(
                _run(
                    rig,
                    config,
                    reference or SineSequence(config.experiment),
                    folder / ("compensated.mcap" if compensate else "uncompensated.mcap"),
                    compensate=compensate,
                    progress=lambda fraction, done=index: progress((done + fraction) / len(kinds)),  # type: ignore[misc]
                )
            )
    return HardwareRun(config, runs[-1], runs[0] if compare else None)


def _run(
    rig: HardwareRig,
    config: Config,
    reference: Reference,
    path: Path,
    *,
    compensate: bool,
    progress: Callable[[float], None],
) -> ProtocolRun:
    with run_log(path, config, compensate=compensate, segments=reference.segments) as log:

        def warn(text: str) -> None:
            _LOG.warning("%s", text)
            log.warn(text)

        rig.warn = warn
        executor = realtime_executor("vision", VISION)
        try:
            recording = run_experiment(
                rig,
                reference,
                config,
                compensate,
                lambda elapsed, duration: progress(min(elapsed / duration, 1.0)),
                log=log,
                executor=executor,
                watch=partial(apply_reaction, rig),
                monitor=partial(PlausibilityMonitor, config),
            )
        except BaseException as error:
            if log.has_begun and isinstance(error, TautscopeError):
                error.exit_status = STOPPED
            raise
        finally:
            rig.close()
            executor.shutdown()
    progress(1.0)
    return ProtocolRun(recording, rig.timing, log.close())
