"""The mapper's configuration, field by field under equal names on both sides."""

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from google.protobuf.message import Message
from gridwright.v1 import session_service_pb2 as pb

from gridwright_server.config import MapperConfig

_Stage = TypeVar("_Stage")


def config_from_message(message: pb.MapperConfig) -> MapperConfig:
    """What is unset takes its default; raises InvalidArgumentError for values out of bounds."""
    config = _stage_from_message(message, MapperConfig())
    config.check()
    return config


def config_message(config: MapperConfig) -> pb.MapperConfig:
    """Every field set."""
    message = pb.MapperConfig()
    _fill(message, config)
    return message


def _stage_from_message(message: Message, defaults: _Stage) -> _Stage:
    values: dict[str, Any] = {}
    for entry in fields(defaults):  # type: ignore[arg-type]
        if not message.HasField(entry.name):
            continue
        value, default = getattr(message, entry.name), getattr(defaults, entry.name)
        values[entry.name] = _stage_from_message(value, default) if is_dataclass(default) else value
    return type(defaults)(**values)


def _fill(message: Message, stage: Any) -> None:
    for entry in fields(stage):
        value = getattr(stage, entry.name)
        if is_dataclass(value):
            _fill(getattr(message, entry.name), value)
        else:
            setattr(message, entry.name, value)
