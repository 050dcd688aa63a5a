"""Bags of ROS: refused with the way round, which leads to a table."""

import numpy as np
import pytest
from lab_logs import text

WAY = "ros2 topic echo --csv"


def test_ros2_mcap(tmp_path, refused):
    """The error names the topics that are no JSON, and what to do."""
    writer_of = pytest.importorskip("mcap.writer", reason="mcap is not installed").Writer
    path = tmp_path / "bag.mcap"
    with open(path, "wb") as file:
        writer = writer_of(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("geometry_msgs/msg/PoseStamped", "ros2msg", b"")
        channel = writer.register_channel("/tip_pose", "cdr", schema)
        writer.add_message(channel, 0, bytes(60), 0)
        writer.finish()
    error = refused(path)
    assert "/tip_pose (cdr)" in error and WAY in error


@pytest.mark.parametrize("start", [b"SQLite format 3\0", b"#ROSBAG V2.0\n"])
def test_other_bags(log, refused, start):
    """Bags of ROS 1, and of ROS 2 in SQLite, told by their content."""
    assert WAY in refused(log(start + bytes(100), "bag.db3"))


def test_topics_as_text(truth, log, imported, same):
    """The texts that `ros2 topic echo --csv` writes have no header: the columns of docs/formats.md name them."""
    second, rest = np.divmod(np.round(1e9 * (1.7e9 + truth.t)).astype(np.int64), 10**9)
    frame, empty, joints = ["base"] * 24, [""] * 24, [[name] * 24 for name in ("in_t", "out_t", "in_r", "out_r")]
    poses = log(text([], [second, rest, frame, truth.position, truth.rotation.as_quat()]), "pose.csv")
    motors = log(text([], [second, rest, empty, *joints, truth.beta, truth.alpha]), "joints.csv")
    table, _ = imported(motors, "--columns", "t,nsec,-,-,-,-,-,beta1..beta2,alpha1..alpha2")
    np.testing.assert_allclose(table.alpha, truth.alpha)
    named = log("t,nsec,,,,,,beta1,beta2,alpha1,alpha2\n" + motors.read_text(), "named.csv")
    table, _ = imported(poses, "--columns", "t,nsec,-,x,y,z,qx,qy,qz,qw", "--joints", named)
    same(table)
