"""The configuration has the same names on the wire and in the server."""

from dataclasses import fields, is_dataclass

import pytest
from gridwright.v1 import session_service_pb2 as pb
from gridwright_server.api.convert.configuration import config_from_message, config_message
from gridwright_server.config import MapperConfig


def names(stage, path=""):
    for entry in fields(stage):
        value = getattr(stage, entry.name)
        yield f"{path}{entry.name}"
        if is_dataclass(value):
            yield from names(value, f"{path}{entry.name}.")


def wire_names(descriptor, path=""):
    for field in descriptor.fields:
        yield f"{path}{field.name}"
        if field.message_type is not None:
            yield from wire_names(field.message_type, f"{path}{field.name}.")


def test_names_agree():
    assert set(names(MapperConfig())) == set(wire_names(pb.MapperConfig.DESCRIPTOR))


@pytest.mark.parametrize("config", [MapperConfig(), MapperConfig(particles=3)])
def test_there_and_back(config):
    assert config_from_message(config_message(config)) == config


def test_what_is_unset_is_default():
    assert config_from_message(pb.MapperConfig()) == MapperConfig()
