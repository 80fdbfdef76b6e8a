"""Parameters of the node: the share of the compensation, and settings that can only be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tautscope.ros2 import types
from tautscope.ros2.clock import Clock
from tautscope.ros2.session import Node

_NOT_SET, _BOOL, _INTEGER, _DOUBLE, _STRING = range(5)
_TYPES = {bool: _BOOL, int: _INTEGER, float: _DOUBLE, str: _STRING}
"""Types of rcl_interfaces/msg/ParameterType."""
_FIELDS = {
    _BOOL: "bool_value",
    _INTEGER: "integer_value",
    _DOUBLE: "double_value",
    _STRING: "string_value",
}
Value = bool | int | float | str


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
        parameters: Name -> parameter.
    """

    def __init__(self, node: Node, clock: Clock, parameters: Mapping[str, Parameter]) -> None:
        self._parameters = dict(parameters)
        self._clock, self._path = clock, node.identity.path
        self._events = node.publisher("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
        handlers = {
            "get_parameters": ("GetParameters", self._get),
            "get_parameter_types": ("GetParameterTypes", self._get_types),
            "list_parameters": ("ListParameters", self._list),
            "describe_parameters": ("DescribeParameters", self._describe),
            "set_parameters": ("SetParameters", self._set),
            "set_parameters_atomically": ("SetParametersAtomically", self._set_atomically),
        }
        self._services = [
            node.service(f"~/{name}", f"rcl_interfaces/srv/{kind}", handler)
            for name, (kind, handler) in handlers.items()
        ]

    def __getitem__(self, name: str) -> Value:
        return self._parameters[name].value

    def serve(self) -> None:
        """Answer requests."""
        for service in self._services:
            service.serve()

    def _get(self, request: Any) -> Any:
        values = [_value(self._value(name)) for name in request.names]
        return types.make("rcl_interfaces/srv/GetParameters_Response", values=values)

    def _get_types(self, request: Any) -> Any:
        kinds = [_type(self._value(name)) for name in request.names]
        return types.make(
            "rcl_interfaces/srv/GetParameterTypes_Response", types=np.array(kinds, np.uint8)
        )

    def _list(self, request: Any) -> Any:
        names = [
            name
            for name in self._parameters
            if not request.prefixes
            or any(name == prefix or name.startswith(f"{prefix}.") for prefix in request.prefixes)
        ]
        prefixes = sorted({name.rpartition(".")[0] for name in names if "." in name})
        result = types.make(
            "rcl_interfaces/msg/ListParametersResult", names=names, prefixes=prefixes
        )
        return types.make("rcl_interfaces/srv/ListParameters_Response", result=result)

    def _describe(self, request: Any) -> Any:
        descriptors = [self._descriptor(name) for name in request.names]
        return types.make("rcl_interfaces/srv/DescribeParameters_Response", descriptors=descriptors)

    def _set(self, request: Any) -> Any:
        results = []
        for asked in request.parameters:
            reason = self._refusal(asked)
            if not reason:
                self._apply([asked])
            results.append(_result(reason))
        return types.make("rcl_interfaces/srv/SetParameters_Response", results=results)

    def _set_atomically(self, request: Any) -> Any:
        reasons = [reason for each in request.parameters if (reason := self._refusal(each))]
        if not reasons:
            self._apply(request.parameters)
        return types.make(
            "rcl_interfaces/srv/SetParametersAtomically_Response",
            result=_result("; ".join(reasons)),
        )

    def _refusal(self, asked: Any) -> str:
        """Why a value cannot be set; empty if it can."""
        parameter = self._parameters.get(asked.name)
        if parameter is None:
            return f"{asked.name[:64]}: no such parameter"
        if parameter.set is None or parameter.range is None:
            return f"{asked.name}: can only be read"
        value = getattr(asked.value, _FIELDS[_DOUBLE])
        if asked.value.type != _DOUBLE:
            return f"{asked.name}: got type {asked.value.type}, expected {_DOUBLE}, a double"
        least, largest = parameter.range
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
        event = types.make(
            "rcl_interfaces/msg/ParameterEvent",
            stamp=types.stamp(self._clock.wall()),
            node=self._path,
            new_parameters=[],
            changed_parameters=list(asked),
            deleted_parameters=[],
        )
        self._events.publish(event)

    def _value(self, name: str) -> Value | None:
        parameter = self._parameters.get(name)
        return None if parameter is None else parameter.value

    def _descriptor(self, name: str) -> Any:
        parameter = self._parameters.get(name)
        ranges = []
        if parameter is not None and parameter.range is not None:
            least, largest = parameter.range
            kind = "rcl_interfaces/msg/FloatingPointRange"
            ranges = [types.make(kind, from_value=least, to_value=largest, step=0.0)]
        return types.make(
            "rcl_interfaces/msg/ParameterDescriptor",
            name=name,
            type=_type(self._value(name)),
            description="" if parameter is None else parameter.description,
            additional_constraints="",
            read_only=parameter is not None and parameter.set is None,
            dynamic_typing=False,
            floating_point_range=ranges,
            integer_range=[],
        )


def _type(value: Value | None) -> int:
    return _NOT_SET if value is None else _TYPES[type(value)]


def _value(value: Value | None) -> Any:
    fields: dict[str, Any] = {
        "bool_value": False,
        "integer_value": 0,
        "double_value": 0.0,
        "string_value": "",
        "byte_array_value": np.empty(0, np.uint8),
        "bool_array_value": np.empty(0, np.bool_),
        "integer_array_value": np.empty(0, np.int64),
        "double_array_value": np.empty(0),
        "string_array_value": [],
    }
    kind = _type(value)
    if value is not None:
        fields[_FIELDS[kind]] = value
    return types.make("rcl_interfaces/msg/ParameterValue", type=kind, **fields)


def _result(reason: str) -> Any:
    return types.make(
        "rcl_interfaces/msg/SetParametersResult", successful=not reason, reason=reason
    )
