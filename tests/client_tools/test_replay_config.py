import math

import pytest
from gridwright.v1.session_service_pb2 import MapperConfig
from gridwright_client.replay.config import ConfigError, read_config


def read(tmp_path, text):
    path = tmp_path / "made.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_config(path)


def test_names_are_those_of_the_message(tmp_path):
    config = read(
        tmp_path,
        """
        particles = 10
        [motion]
        update_distance_meters = 0.3
        [matching]
        window_meters = 1
        """,
    )
    assert config.particles == 10
    assert config.motion.update_distance_meters == 0.3
    assert config.matching.window_meters == 1.0
    assert not config.HasField("grid")


def test_every_field_can_be_set(tmp_path):
    lines = []
    for field in MapperConfig.DESCRIPTOR.fields:
        if field.message_type is None:
            lines.insert(0, f"{field.name} = 7")
        else:
            lines.append(f"[{field.name}]")
            lines += [f"{inner.name} = 7" for inner in field.message_type.fields]
    config = read(tmp_path, "\n".join(lines))
    for field in MapperConfig.DESCRIPTOR.fields:
        value = getattr(config, field.name)
        inner = [value] if field.message_type is None else [number for _, number in value.ListFields()]
        assert inner
        assert set(inner) == {7}


def test_infinity_is_left_to_the_server_to_refuse(tmp_path):
    assert math.isinf(read(tmp_path, "[sensor]\nusable_range_meters = inf").sensor.usable_range_meters)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("particels = 3", "no setting particels; did you mean particles"),
        ("[matching]\nwindow_metres = 1", r"matching.window_metres; did you mean matching.window_meters"),
        ("window_meters = 1", "did you mean matching.window_meters"),
        ("[grid]\nparticles = 1", "did you mean particles, above all tables"),
        ("[grid]\nxyz = 1", "there are resolution_meters, coarse_factor"),
        ("particles = 1.5", "particles is 1.5, must be a whole number"),
        ("particles = -1", "particles is -1, must be a whole number"),
        ("particles = 4294967296", "must be a whole number"),
        ("particles = true", "particles is True"),
        ('[grid]\nresolution_meters = "fine"', "grid.resolution_meters is 'fine', must be a number"),
        ("grid = 3", r"grid is a table of settings, written \[grid\], not 3"),
        ("particles =", "not a TOML file"),
        (b"\xff\xfe", "not a TOML file"),
    ],
)
def test_mistakes_are_named(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as error:
        read(tmp_path, text)
    assert "made.toml" in str(error.value)
