"""A client of the services of a node under test, as rmw_zenoh is one: a session of its own."""

from __future__ import annotations

import json
import time
from typing import Any

import zenoh
from ros2.peers import TIMEOUT, Peers
from tautscope.ros2 import types, wire

SEQUENCE, SOURCE = 1, b"c" * 16
ATTACHMENT = wire.attachment(SEQUENCE, 2, SOURCE)


class Client:
    """Calls services of a node; a context manager."""

    def __init__(self, both: Peers) -> None:
        self._control = both.control
        settings = zenoh.Config()
        settings.insert_json5("connect/endpoints", json.dumps([both.endpoint]))
        settings.insert_json5("scouting/multicast/enabled", "false")
        self._session = zenoh.open(settings)
        token = both.node.identity.node_token()
        deadline = time.monotonic() + TIMEOUT
        while not list(self._session.liveliness().get(token)):
            assert time.monotonic() < deadline, "the node is not found"

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()  # type: ignore[no-untyped-call]

    def send(self, name: str, kind: str, payload: bytes, attachment: bytes = ATTACHMENT) -> Any:
        """Send a request; its replies."""
        key = wire.key(0, f"/tautscope/{name}", kind, types.type_hash(kind))
        return self._session.get(key, payload=payload, attachment=attachment)

    def call(self, name: str, kind: str, **fields: object) -> Any:
        """The response to a request, while the node serves."""
        payload = types.encode(types.make(f"{kind}_Request", **fields))
        replies = self.send(name, kind, payload)
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            self._control.serve()
            if (reply := replies.try_recv()) is not None:
                sequence, _, source = wire.read_attachment(reply.ok.attachment.to_bytes())
                assert (sequence, source) == (SEQUENCE, SOURCE)
                return types.decode(f"{kind}_Response", reply.ok.payload.to_bytes())
            time.sleep(0.005)
        raise AssertionError(f"{name}: no reply")

    def set_parameters(self, *values: tuple[str, float]) -> list[Any]:
        """The results of setting parameters to numbers."""
        kind = "rcl_interfaces/srv/SetParameters"
        asked = [self.parameter(*each) for each in values]
        return list(self.call("set_parameters", kind, parameters=asked).results)

    def parameter(self, name: str, value: float) -> Any:
        """A parameter of type double in a request."""
        number = self.get_parameter("compensation")
        number.type, number.double_value = 3, value
        return types.make("rcl_interfaces/msg/Parameter", name=name, value=number)

    def get_parameter(self, name: str) -> Any:
        """The value of a parameter."""
        kind = "rcl_interfaces/srv/GetParameters"
        (value,) = self.call("get_parameters", kind, names=[name]).values
        return value
