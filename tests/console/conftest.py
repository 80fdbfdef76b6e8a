"""Consoles of the twin that tests share."""

from collections.abc import Iterator

import pytest
from running import RunningConsole, running_console


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    with running_console(tmp_path_factory.mktemp("console")) as found:
        yield found
