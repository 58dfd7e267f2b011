"""The mapper's configuration from a TOML file: the names are those of gridwright.v1.MapperConfig."""

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from gridwright.v1.session_service_pb2 import MapperConfig


class ConfigError(ValueError):
    """A configuration file that cannot be used; says where and why."""


def read_config(path: Path) -> MapperConfig:
    """Raises OSError where the file cannot be read, ConfigError where it is not a configuration."""
    try:
        document = tomllib.loads(path.read_bytes().decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not a TOML file: {error}") from None
    config = MapperConfig()
    try:
        _fill(config, document, "")
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    return config


def _fill(message: Message, table: Mapping[str, Any], prefix: str) -> None:
    fields = message.DESCRIPTOR.fields_by_name
    for key, value in table.items():
        if key not in fields:
            raise ConfigError(f"there is no setting {prefix}{key}{_advice(key, prefix, list(fields))}")
        name = f"{prefix}{key}"
        if fields[key].message_type is None:
            is_whole = fields[key].type == FieldDescriptor.TYPE_UINT32
            setattr(message, key, _whole_number(value, name) if is_whole else _number(value, name))
        elif not isinstance(value, Mapping):
            raise ConfigError(f"{name} is a table of settings, written [{name}], not {value!r}")
        else:
            getattr(message, key).SetInParent()
            _fill(getattr(message, key), value, f"{name}.")


def _advice(key: str, prefix: str, known: list[str]) -> str:
    """The nearest name on this level, or the place where a name of another level belongs."""
    for table, field in MapperConfig.DESCRIPTOR.fields_by_name.items():
        if field.message_type is not None and key in field.message_type.fields_by_name:
            return f"; did you mean {table}.{key}?"
    if prefix and key in MapperConfig.DESCRIPTOR.fields_by_name:
        return f"; did you mean {key}, above all tables?"
    nearest = get_close_matches(key, known, n=1, cutoff=0.4)
    if nearest:
        return f"; did you mean {prefix}{nearest[0]}?"
    return f"; there are {', '.join(known)}"


def _whole_number(value: Any, name: str) -> int:
    if not _is_int(value) or not 0 <= value < 1 << 32:
        raise ConfigError(f"{name} is {value!r}, must be a whole number that is not negative")
    return int(value)


def _number(value: Any, name: str) -> float:
    if not _is_int(value) and not isinstance(value, float):
        raise ConfigError(f"{name} is {value!r}, must be a number")
    return float(value)


def _is_int(value: Any) -> bool:
    """A TOML true is a Python bool, which is an int too."""
    return isinstance(value, int) and not isinstance(value, bool)
