"""Lines of CARMEN logs, made up."""

import gzip

TRAILER = "1000.500000 robot 0.5"


def trailer(seconds="1000.5"):
    return f"{seconds} robot 0.5"


def odom(x=0.0, y=0.0, theta=0.0, seconds="1000.5"):
    return f"ODOM {x} {y} {theta} 0 0 0 {trailer(seconds)}"


def flaser(ranges, base=(0.0, 0.0, 0.0), laser=None, seconds="1000.5", name="FLASER"):
    poses = [*(base if laser is None else laser), *base]
    numbers = " ".join(str(value) for value in [*ranges, *poses])
    return f"{name} {len(ranges)} {numbers} {trailer(seconds)}"


def robotlaser(
    ranges,
    base=(0.0, 0.0, 0.0),
    laser=(0.0, 0.0, 0.0),
    start=-1.5,
    view=3.0,
    resolution=0.01,
    maximum=20.0,
    remissions=(),
    seconds="1000.5",
    name="ROBOTLASER1",
):
    head = rawlaser_head(name, ranges, remissions, start, view, resolution, maximum)
    tail = " ".join(str(value) for value in [*laser, *base, 0.1, 0.2, 0.5, 0.5, 0.0])
    return f"{head} {tail} {trailer(seconds)}"


def rawlaser(ranges, start=-1.5, view=3.0, resolution=0.01, maximum=20.0, remissions=(), seconds="1000.5"):
    head = rawlaser_head("RAWLASER1", ranges, remissions, start, view, resolution, maximum)
    return f"{head} {trailer(seconds)}"


def rawlaser_head(name, ranges, remissions, start, view, resolution, maximum):
    counted = " ".join(
        " ".join(str(value) for value in [len(values), *values]) for values in (ranges, remissions)
    )
    return f"{name} 0 {start} {view} {resolution} {maximum} 0.01 0 {counted}"


def write(path, lines):
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def write_gzip(path, lines):
    path.write_bytes(gzip.compress("".join(f"{line}\n" for line in lines).encode()))
    return path
