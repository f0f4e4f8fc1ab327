"""`endurance.py` with few frames."""

import json
import random
import subprocess
from pathlib import Path

import endurance
import pytest


def test_a_render_that_is_killed_again_and_again_ends_with_the_same_frames(tmp_path: Path) -> None:
    scene = endurance.to_and_fro(700, tmp_path)
    calm, killed = tmp_path / "calm", tmp_path / "killed"
    endurance.finish(endurance.start(scene, calm, "32x24"))
    kills = endurance.torment(scene, killed, "32x24", (0.3, 3.0), random.Random(1))
    assert kills > 0
    assert endurance.differences(killed, calm) == []
    report = json.loads((killed / "report.json").read_text())
    assert report["totals"]["frames"] == 700
    # After frame 599 the camera goes back the way it came.
    command = [endurance.BUZZ, "plan", scene, "-r", "32x24", "--format", "json"]
    plan = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    cameras = [frame["world_from_camera"] for frame in plan["frames"]]
    assert cameras[650] == pytest.approx(cameras[548]) and cameras[650] != pytest.approx(cameras[549])
