"""Parameters of the node: the share of the compensation, and settings that can only be read."""

from collections.abc import Callable
from typing import Any

from tautscope.config import Config
from tautscope.log.fields import stamp_of
from tautscope.ros2.session import Clock, Node

_DOUBLE = 3
_TYPES = {float: (_DOUBLE, "double_value"), str: (4, "string_value")}
"""Type -> number of rcl_interfaces/msg/ParameterType, field of ParameterValue."""
_SHARE = "compensation"
"""The parameter that can be set, from 0 to 1."""
_DESCRIPTIONS = {
    _SHARE: "share of the compensation, 0 to 1",
    "control.period": "control period [s]",
    "profile": "how slack is compensated",
    "safety.reference_age": "age of a reference that stops motion [s]",
}


class Parameters:
    """The services of rcl_interfaces for a node's parameters, and ``/parameter_events``."""

    def __init__(
        self, node: Node, clock: Clock, config: Config, set_compensation: Callable[[float], None]
    ) -> None:
        self._values: dict[str, float | str] = {
            _SHARE: 1.0,
            "control.period": config.control.period,
            "profile": config.profile,
            "safety.reference_age": config.safety.reference_age,
        }
        self._set_compensation = set_compensation
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

    def __getitem__(self, name: str) -> float | str:
        return self._values[name]

    def _get(self, request: Any) -> dict[str, Any]:
        return {"values": [self._value(name) for name in request.names]}

    def _get_types(self, request: Any) -> dict[str, Any]:
        return {"types": [self._value(name).get("type", 0) for name in request.names]}

    def _list(self, request: Any) -> dict[str, Any]:
        begins = tuple(f"{prefix}." for prefix in request.prefixes)
        names = [name for name in self._values if not begins or f"{name}.".startswith(begins)]
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
        name, kind, value = asked.name, asked.value.type, asked.value.double_value
        if name not in self._values:
            return f"{name[:64]}: no such parameter"
        if name != _SHARE:
            return f"{name}: can only be read"
        if kind != _DOUBLE:
            return f"{name}: got type {kind}, expected {_DOUBLE}, a double"
        return "" if 0 <= value <= 1 else f"{name}: got {value:g}, expected 0 to 1"

    def _apply(self, asked: Any) -> None:
        for each in asked:
            value = float(each.value.double_value)
            self._set_compensation(value)
            self._values[each.name] = value
        stamp = stamp_of(self._clock.wall())
        event = {"stamp": stamp, "node": self._path, "changed_parameters": asked}
        self._events.publish(event)

    def _value(self, name: str) -> dict[str, Any]:
        """Type and value of a parameter; empty (type 0: not set) if there is none."""
        if name not in self._values:
            return {}
        kind, field = _TYPES[type(self._values[name])]
        return {"type": kind, field: self._values[name]}

    def _descriptor(self, name: str) -> dict[str, Any]:
        if name not in self._values:
            return {"name": name}
        return {
            "name": name,
            "type": self._value(name)["type"],
            "description": _DESCRIPTIONS[name],
            "read_only": name != _SHARE,
            "floating_point_range": [{"to_value": 1.0}] if name == _SHARE else [],
        }
