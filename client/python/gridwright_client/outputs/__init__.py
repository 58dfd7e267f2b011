"""What a finished map leaves behind: for robots (Nav2), for people (a picture), for comparison."""

from gridwright_client.outputs.cropping import cropped, map_sha256
from gridwright_client.outputs.nav2 import write_nav2_map
from gridwright_client.outputs.picture import draw_map

__all__ = ["cropped", "draw_map", "map_sha256", "write_nav2_map"]
