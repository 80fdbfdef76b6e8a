"""Parameters of the node: the share of the compensation, and settings that can only be read."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tautscope.config import Config
from tautscope.log.fields import stamp_of
from tautscope.ros2.clock import Clock
from tautscope.ros2.session import Node

_DOUBLE = 3
_TYPES = {float: (_DOUBLE, "double_value"), str: (4, "string_value")}
"""Type -> number of rcl_interfaces/msg/ParameterType, field of ParameterValue."""
Value = float | str


@dataclass(slots=True)
class Parameter:
    """A parameter.

    Attributes:
        value: Its value.
        description: What it is, with unit.
        range: Least and largest value, of a number that can be set.
        set: Sets it; None if it can only be read.
    """

    value: Value
    description: str
    range: tuple[float, float] | None = None
    set: Callable[[float], None] | None = None


class Parameters:
    """The services of rcl_interfaces for a node's parameters, and ``/parameter_events``.

    Args:
        node: Has the services.
        clock: For the stamps of events.
        config: Settings that can be read.
        set_compensation: Sets the share of the compensation.
    """

    def __init__(
        self, node: Node, clock: Clock, config: Config, set_compensation: Callable[[float], None]
    ) -> None:
        share = "share of the compensation, 0 to 1"
        age = "age of a reference that stops motion [s]"
        self._parameters = {
            "compensation": Parameter(1.0, share, (0.0, 1.0), set_compensation),
            "control.period": Parameter(config.control.period, "control period [s]"),
            "profile": Parameter(config.profile, "how slack is compensated"),
            "safety.reference_age": Parameter(config.safety.reference_age, age),
        }
        self._clock, self._path = clock, node.identity.path
        self._events = node.publisher("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
        for name, kind, handler in (
            ("get_parameters", "GetParameters", self._get),
            ("get_parameter_types", "GetParameterTypes", self._get_types),
            ("list_parameters", "ListParameters", self._list),
            ("describe_parameters", "DescribeParameters", self._describe),
            ("set_parameters", "SetParameters", self._set),
            ("set_parameters_atomically", "SetParametersAtomically", self._set_atomically),
        ):
            node.add_service(f"~/{name}", f"rcl_interfaces/srv/{kind}", handler)

    def __getitem__(self, name: str) -> Value:
        return self._parameters[name].value

    def _get(self, request: Any) -> dict[str, Any]:
        return {"values": [self._value(name) for name in request.names]}

    def _get_types(self, request: Any) -> dict[str, Any]:
        return {"types": [self._value(name).get("type", 0) for name in request.names]}

    def _list(self, request: Any) -> dict[str, Any]:
        names = [
            name
            for name in self._parameters
            if not request.prefixes
            or any(name == prefix or name.startswith(f"{prefix}.") for prefix in request.prefixes)
        ]
        prefixes = sorted({name.rpartition(".")[0] for name in names if "." in name})
        return {"result": {"names": names, "prefixes": prefixes}}

    def _describe(self, request: Any) -> dict[str, Any]:
        return {"descriptors": [self._descriptor(name) for name in request.names]}

    def _set(self, request: Any) -> dict[str, Any]:
        results = []
        for asked in request.parameters:
            reason = self._refusal(asked)
            if not reason:
                self._apply([asked])
            results.append({"successful": not reason, "reason": reason})
        return {"results": results}

    def _set_atomically(self, request: Any) -> dict[str, Any]:
        reasons = [reason for each in request.parameters if (reason := self._refusal(each))]
        if not reasons:
            self._apply(request.parameters)
        return {"result": {"successful": not reasons, "reason": "; ".join(reasons)}}

    def _refusal(self, asked: Any) -> str:
        """Why a value cannot be set; empty if it can."""
        parameter = self._parameters.get(asked.name)
        if parameter is None:
            return f"{asked.name[:64]}: no such parameter"
        if parameter.set is None or parameter.range is None:
            return f"{asked.name}: can only be read"
        if asked.value.type != _DOUBLE:
            return f"{asked.name}: got type {asked.value.type}, expected {_DOUBLE}, a double"
        value, (least, largest) = asked.value.double_value, parameter.range
        if not least <= value <= largest:
            return f"{asked.name}: got {value:g}, expected {least:g} to {largest:g}"
        return ""

    def _apply(self, asked: Any) -> None:
        for each in asked:
            parameter = self._parameters[each.name]
            value = float(each.value.double_value)
            assert parameter.set is not None
            parameter.set(value)
            parameter.value = value
        stamp = stamp_of(self._clock.wall())
        event = {"stamp": stamp, "node": self._path, "changed_parameters": asked}
        self._events.publish(event)

    def _value(self, name: str) -> dict[str, Any]:
        """Type and value of a parameter; empty (type 0: not set) if there is none."""
        parameter = self._parameters.get(name)
        if parameter is None:
            return {}
        kind, field = _TYPES[type(parameter.value)]
        return {"type": kind, field: parameter.value}

    def _descriptor(self, name: str) -> dict[str, Any]:
        parameter = self._parameters.get(name)
        if parameter is None:
            return {"name": name}
        ranges = []
        if parameter.range is not None:
            least, largest = parameter.range
            ranges = [{"from_value": least, "to_value": largest}]
        return {
            "name": name,
            "type": self._value(name)["type"],
            "description": parameter.description,
            "read_only": parameter.set is None,
            "floating_point_range": ranges,
        }
