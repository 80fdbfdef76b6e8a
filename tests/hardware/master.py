"""A process that moves the motors until it is ended; started by test_processes.py."""

import json
import sys
import time

import numpy as np
from tautscope.config import load_config
from tautscope.hardware.drives import open_drives
from tautscope.hardware.signals import exit_on_signals

STEP = np.array([1e-4, 0.01, 0.01])


class Panic(BaseException):
    """A panic in Rust reaches Python as a `BaseException` like this one."""


def main() -> None:
    file, ending = sys.argv[1:]
    config = load_config(file).drives
    assert config is not None
    with exit_on_signals(), open_drives(config) as drives:
        command = drives.start()
        for count in range(1_000_000):
            command = command + STEP if count < 20 else command
            drives.exchange(command)
            if count == 20:
                print(json.dumps({"running": list(command)}), flush=True)
                if ending == "return":
                    return
                if ending == "raise":
                    raise ZeroDivisionError
                if ending == "panic":
                    raise Panic
                if ending == "exit":
                    sys.exit(3)
            time.sleep(drives.cycle / 2)


if __name__ == "__main__":
    main()
