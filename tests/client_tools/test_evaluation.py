import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from gridwright_client.carmen import read_log
from gridwright_client.cli.evaluate import evaluate as evaluate_command
from gridwright_client.evaluation import Relations, evaluate, nearest_index, read_relations
from gridwright_client.trajectory_file import FileFormatError, TimedPoses, read_trajectory, write_tum
from hypothesis import given
from hypothesis import strategies as st
from naive import relations_metric

SECOND_NS = 1_000_000_000


def timed(*rows):
    return TimedPoses(
        np.array([row[0] for row in rows]), np.array([row[1] for row in rows], dtype=np.float64)
    )


def relations(*rows):
    first, second, poses = zip(*rows, strict=True)
    return Relations(np.array(first), np.array(second), np.array(poses, dtype=np.float64))


def test_a_hand_computed_case():
    """Drives 1 m forward, turns left by 90 degrees, drives 2 m; each relation errs in one way."""
    trajectory = timed((0, (0, 0, 0)), (10, (1, 0, math.pi / 2)), (20, (1, 2, math.pi / 2)))
    known = relations(
        (0, 10, (1.0, 0.3, math.pi / 2)),  # 0.3 m off
        (10, 20, (2.4, 0.0, math.radians(10.0))),  # 0.4 m and 10 degrees off
        (20, 0, (-2.0, 1.0, -math.pi / 2)),  # right
    )
    result = evaluate(trajectory, known, max_dt_s=0.0)
    assert result.matched == 3
    assert result.translation_m.mean == pytest.approx(0.7 / 3)
    assert result.translation_m.deviation == pytest.approx(math.sqrt((0.09 + 0.16 - 0.49 / 3) / 2))
    assert result.translation_m.squared_mean == pytest.approx(0.25 / 3)
    assert result.translation_m.largest == pytest.approx(0.4)
    assert result.rotation_deg.mean == pytest.approx(10.0 / 3)
    assert result.rotation_deg.squared_mean == pytest.approx(100.0 / 3)
    assert result.rotation_deg.largest == pytest.approx(10.0)


def test_headings_compare_across_the_turn():
    trajectory = timed((0, (0, 0, math.pi - 0.01)), (10, (0, 0, -math.pi + 0.01)))
    result = evaluate(trajectory, relations((0, 10, (0, 0, 0.02))), max_dt_s=0.0)
    assert result.rotation_deg.largest == pytest.approx(0.0, abs=1e-9)


def test_times_without_a_pose_are_missed():
    trajectory = timed((0, (0, 0, 0)), (SECOND_NS, (1, 0, 0)))
    known = relations((0, SECOND_NS, (1, 0, 0)), (0, SECOND_NS + 600_000, (1, 0, 0)))
    result = evaluate(trajectory, known, max_dt_s=0.0005)
    assert (result.matched, result.missed, result.bridged) == (1, 1, 0)


def test_odometry_bridges_to_times_without_a_pose():
    trajectory = timed((0, (5, 5, math.pi / 2)), (10 * SECOND_NS, (5, 6, math.pi / 2)))
    odometry = timed((0, (0, 0, 0)), (4 * SECOND_NS, (0.5, 0, 0)), (10 * SECOND_NS, (1.2, 0, 0)))
    result = evaluate(
        trajectory, relations((0, 4 * SECOND_NS, (0.5, 0, 0))), max_dt_s=0.001, odometry=odometry
    )
    assert (result.matched, result.missed, result.bridged) == (1, 0, 1)
    assert result.translation_m.largest == pytest.approx(0.0, abs=1e-12)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=30), st.integers(-5, 55))
def test_nearest_stamp_of_an_unsorted_list(stamps, time):
    found = nearest_index(np.array(stamps), np.array([time]))[0]
    assert found == relations_metric.nearest([(stamp, None) for stamp in stamps], time)


coordinates = st.floats(-20.0, 20.0)
pose_tuples = st.tuples(coordinates, coordinates, st.floats(-3.1, 3.1))
stamped_poses = st.lists(st.tuples(st.integers(0, 200), pose_tuples), min_size=1, max_size=12)


@given(
    stamped_poses,
    st.lists(st.tuples(st.integers(0, 200), st.integers(0, 200), pose_tuples), min_size=2, max_size=8),
    st.one_of(st.none(), stamped_poses),
    st.integers(0, 60),
)
def test_agrees_with_its_naive_twin(trajectory, known, odometry, max_dt_ns):
    result = evaluate(
        timed(*trajectory),
        relations(*known),
        max_dt_s=max_dt_ns * 1e-9,
        odometry=None if odometry is None else timed(*odometry),
    )
    errors = relations_metric.errors(trajectory, known, odometry, max_dt_ns)
    assert result.matched == len(errors)
    assert result.matched + result.missed == len(known)
    if len(errors) > 1:
        for statistics, values in zip(
            (result.translation_m, result.rotation_deg), zip(*errors, strict=True), strict=True
        ):
            mean, deviation = relations_metric.mean_and_deviation(values)
            squared = relations_metric.mean_and_deviation([value**2 for value in values])
            assert statistics.mean == pytest.approx(mean, abs=1e-6)
            assert statistics.deviation == pytest.approx(deviation, abs=1e-5)
            assert statistics.squared_mean == pytest.approx(squared[0], abs=1e-4)
            assert statistics.squared_deviation == pytest.approx(squared[1], abs=1e-3)
            assert statistics.largest == pytest.approx(max(values), abs=1e-6)


@given(stamped_poses)
def test_tum_files_keep_times_exactly_and_poses_to_micrometres(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "made.tum"
    written = TimedPoses(1_700_000_000_123_456_789 + timed(*rows).stamps_ns, timed(*rows).poses)
    write_tum(path, written)
    read = read_trajectory(path)
    assert read.stamps_ns.tolist() == written.stamps_ns.tolist()
    np.testing.assert_allclose(read.poses, written.poses, atol=1e-6)


def test_stamps_have_six_decimals_unless_that_would_round(tmp_path):
    write_tum(tmp_path / "made.tum", timed((1_000_500_000, (0, 0, 0)), (1_000_500_001, (0, 0, 0))))
    stamps = [line.split()[0] for line in (tmp_path / "made.tum").read_text().splitlines()]
    assert stamps == ["1.000500", "1.000500001"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3\n", "line 1: has 3 numbers"),
        ("# only a comment\n", "holds no lines"),
        ("", "holds no lines"),
        ("1 2 3 four\n", "line 1"),
        ("1 2 3 nan\n", "line 1: has a number that is not finite"),
        ("soon 1 2 3\n", "'soon' is not a time"),
        ("1e99 1 2 3\n", "out of range"),
    ],
)
def test_files_of_another_kind_are_refused_by_line(tmp_path, text, message):
    path = tmp_path / "made.tum"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_trajectory(path)


def run(*arguments):
    return CliRunner().invoke(evaluate_command, [str(argument) for argument in arguments])


@pytest.fixture
def files(tmp_path):
    write_tum(tmp_path / "t.tum", timed((0, (0, 0, 0)), (SECOND_NS, (1, 0, 0))))
    (tmp_path / "r.relations").write_text(
        "0.0 1.0 1.5 0 0 0 0 0\n0.0 1.0 1.0 0 0 0 0 0\n0.0 7.0 0 0 0 0 0 0\n"
    )
    (tmp_path / "short.relations").write_text("0.0 1.0 1.5\n")
    return tmp_path / "t.tum", tmp_path / "r.relations"


def test_command_prints_a_table(files):
    result = run(*files)
    assert result.exit_code == 0
    assert "0.2500 m" in result.output
    assert "2 relations matched, 1 missed" in result.output


def test_command_prints_json(files):
    score = json.loads(run(*files, "--json").output)
    assert score["translation_m"]["mean"] == pytest.approx(0.25)
    assert (score["matched"], score["missed"]) == (2, 1)


@pytest.mark.parametrize(
    ("trajectory", "relations_file"), [("gone.tum", "r.relations"), ("t.tum", "short.relations")]
)
def test_what_the_user_can_put_right_is_one_line(files, trajectory, relations_file):
    folder = files[0].parent
    result = run(folder / trajectory, folder / relations_file)
    assert result.exit_code == 2
    assert result.output.startswith("Error: ")
    assert len(result.output.splitlines()) == 1


def test_no_match_at_all_gives_advice(tmp_path, files):
    (tmp_path / "far.relations").write_text("50.0 60.0 1.5 0 0 0 0 0\n")
    result = run(files[0], tmp_path / "far.relations")
    assert result.exit_code == 2
    assert "--max-dt" in result.output


@pytest.mark.real_log
@pytest.mark.parametrize(
    ("name", "matched", "mean_m", "deviation_m"),
    [("intel", 2984, 7.371, 14.356), ("mit-killian", 4677, 1.176, 3.156)],
)
def test_raw_odometry_scores_what_it_is_known_to(recorded_logs, tmp_path, name, matched, mean_m, deviation_m):
    folder = recorded_logs / name
    scans = read_log(folder / f"{name}.clf").scans
    odometry = timed(*((scan.stamp_ns, scan.odom_from_base) for scan in scans))
    write_tum(tmp_path / "odometry.tum", odometry)
    score = evaluate(
        read_trajectory(tmp_path / "odometry.tum"),
        read_relations(folder / f"{name}.relations"),
        max_dt_s=0.0005,
        odometry=read_trajectory(folder / f"{name}.odometry.txt"),
    )
    assert (score.matched, score.missed) == (matched, 0)
    assert score.translation_m.mean == pytest.approx(mean_m, abs=0.001)
    assert score.translation_m.deviation == pytest.approx(deviation_m, abs=0.01)
