"""`buzz-convert plan` puts every camera where an independent reading of the file puts it.

The oracle files give each camera node's world matrix at every frame, parents' scale included. They are not part of this
repository; without them the test says so and skips.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT.parent / "shared" / "scenes"
ORACLES = sorted((SCENES / "oracle").rglob("*.cameras.json")) if SCENES.exists() else []
BUZZ = Path(os.environ.get("BUZZ_CONVERT", ROOT / "target" / "release" / "buzz-convert"))

if not ORACLES:
    print("skipped: no oracle files beside the repository")


def gram_schmidt(world: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, up and view direction of a camera matrix, without its scale."""
    forward = -world[:3, 2] / np.linalg.norm(world[:3, 2])
    right = world[:3, 0] - forward * (world[:3, 0] @ forward)
    right /= np.linalg.norm(right)
    up = world[:3, 1] - forward * (world[:3, 1] @ forward) - right * (world[:3, 1] @ right)
    return right, up / np.linalg.norm(up), forward


def check_camera(file: Path, index: int, camera: dict) -> None:
    """Compares every frame of one camera of a file."""
    command = [BUZZ, "plan", file, "--format", "json", "-q", "full", "--fps", "24", "-c", str(index)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if "draco" in file.name:
        assert run.returncode == 3 and "KHR_draco_mesh_compression" in run.stderr
        return
    assert run.returncode == 0, run.stderr
    planned = {frame["frame"]: frame for frame in json.loads(run.stdout)["frames"]}
    worlds = {frame["frame"]: np.array(frame["world"]) for frame in camera["frames"]}
    lenses = {frame["frame"]: frame.get("yfov") for frame in camera["frames"]}
    # The oracle counts from time 0, a file's range begins with its first key.
    assert planned.keys() == {number for number in worlds if number >= min(planned)}
    places = np.array([world[:3, 3] for world in worlds.values()])
    scale = max(np.ptp(places, axis=0).max(), np.linalg.norm(places[0]), 1e-9)
    for number, frame in planned.items():
        ours = np.array(frame["world_from_camera"]).reshape(4, 4).T
        right, up, forward = gram_schmidt(worlds[number])
        assert np.abs(ours[:3, 3] - worlds[number][:3, 3]).max() <= 1e-4 * scale, number
        assert np.abs(-ours[:3, 2] - forward).max() <= 1e-4, number
        assert np.abs(ours[:3, 0] - right).max() <= 1e-4, number
        assert np.abs(ours[:3, 1] - up).max() <= 1e-4, number
        if camera["camera"]["type"] == "perspective":
            yfov = lenses[number] or camera["camera"]["perspective"]["yfov"]
            assert abs(frame["yfov"] - yfov) <= 1e-5, number


@pytest.mark.parametrize("oracle", ORACLES, ids=lambda p: p.name.removesuffix(".cameras.json"))
def test_cameras_stand_where_the_oracle_says(oracle: Path) -> None:
    """Position, view direction, right and up, and the field of view, at every frame."""
    relative = oracle.relative_to(SCENES / "oracle").with_name(oracle.name.removesuffix(".cameras.json"))
    file = SCENES / relative
    if oracle.name.startswith("unknown_required_extension"):
        run = subprocess.run([BUZZ, "plan", file], capture_output=True, text=True, check=False)
        assert run.returncode == 3 and "ACME_unobtainium" in run.stderr
        return
    cameras = json.loads(oracle.read_text())["cameras"]
    assert cameras
    for index, camera in enumerate(cameras):
        check_camera(file, index, camera)
