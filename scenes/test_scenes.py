"""Our own scenes: the committed files are what the scripts make, and hold what other tests and the docs say of them."""

import json
import struct
import zlib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import buzz_city
import make
import motion

SCENES = Path(__file__).resolve().parent
MIB = 1 << 20
LARGEST = {"courtyard": 4 * MIB, "gallery": 4 * MIB, "buzz-city": 1 * MIB, "stage": 1 * MIB}


@pytest.fixture(scope="module")
def cities():
    """The committed buzz-city, and its model: (document, binary, solids, quadrics)."""
    return (*committed("buzz-city"), *buzz_city.model())


def committed(name):
    """The document and the binary of a committed scene."""
    folder = SCENES / name
    return json.loads((folder / f"{name}.gltf").read_text()), (folder / f"{name}.bin").read_bytes()


def read(document, binary, index):
    """The values of an accessor."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    dtype = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    values = np.frombuffer(binary, dtype, accessor["count"] * width, view["byteOffset"])
    return values if width == 1 else values.reshape(-1, width)


def unpacked(data):
    """A PNG's chunks with the pixels unpacked, other data as it is: another zlib may pack the same pixels otherwise."""
    if not data.startswith(b"\x89PNG"):
        return data
    chunks, at = [], 8
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        chunks.append((kind, zlib.decompress(body) if kind == b"IDAT" else body))
        at += length + 12
    return chunks


@pytest.mark.parametrize("name", make.SCENES)
def test_script_makes_the_committed_files(name):
    made = make.build(name).files()
    folder = SCENES / name
    assert sorted(made) == sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    for path, data in made.items():
        assert unpacked(data) == unpacked((folder / path).read_bytes()), path


@pytest.mark.parametrize("name", make.SCENES)
def test_size(name):
    assert sum(p.stat().st_size for p in (SCENES / name).rglob("*") if p.is_file()) < LARGEST[name]


@pytest.mark.parametrize("name", make.SCENES)
def test_extras_follow_the_schema(name):
    schema = json.loads((SCENES.parent / "docs" / "extras.schema.json").read_text())
    extras = committed(name)[0]["scenes"][0]["extras"]["buzz"]
    jsonschema.validate(extras, {"$ref": "#/$defs/scene", "$defs": schema["$defs"]})


def seen_positions(document, binary):
    """Where the camera is at each frame, and the frames at which it is cut to."""
    buzz = document["scenes"][0]["extras"]["buzz"]
    fps = buzz["fps"][0] / buzz["fps"][1]
    animation = document["animations"][0]
    path = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        assert sampler["interpolation"] == "LINEAR"
        if channel["target"]["path"] == "translation":
            frames = np.round(read(document, binary, sampler["input"]) * fps).astype(int)
            keys = dict(zip(frames, read(document, binary, sampler["output"]), strict=True))
            path[channel["target"]["node"]] = keys
    cuts = [(cut["frame"], cut["node"]) for cut in buzz["cuts"]]
    frames = range(buzz["frame_start"], buzz["frame_end"] + 1)
    positions = [path[[node for start, node in cuts if start <= frame][-1]][frame] for frame in frames]
    return np.array(positions), [frame for frame, _ in cuts[1:]]


@pytest.mark.parametrize("name", make.SCENES)
def test_cuts_are_the_jumps_of_the_camera(name):
    positions, cuts = seen_positions(*committed(name))
    moved = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert (np.flatnonzero(moved > 10 * np.median(moved)) + 1).tolist() == cuts


def test_courtyard_is_one_cut_and_96_frames():
    positions, cuts = seen_positions(*committed("courtyard"))
    assert len(positions) == 96
    assert cuts == [60]


def test_stage_moves_all_that_inference_follows():
    document, binary = committed("stage")
    channels = [(a, c) for a in document["animations"] for c in a["channels"]]
    moving = {path: 0 for path in ("translation", "rotation", "weights", "color", "intensity", "outerConeAngle")}
    for animation, channel in channels:
        pointer = channel["target"].get("extensions", {}).get("KHR_animation_pointer", {}).get("pointer", "")
        path = channel["target"]["path"]
        values = read(document, binary, animation["samplers"][channel["sampler"]]["output"])
        moving[pointer.rsplit("/")[-1] or path] += len(np.unique(values, axis=0)) > 1
    assert all(moving.values()), moving
    (skin,) = document["skins"]
    moved = {c["target"].get("node") for _, c in channels}
    assert moved.issuperset(skin["joints"])
    # A light hangs from what swings, and two stand still.
    lit = [i for i, node in enumerate(document["nodes"]) if "KHR_lights_punctual" in node.get("extensions", {})]
    carried = [i for node in moved - {None} for i in document["nodes"][node].get("children", []) if i in lit]
    assert (len(lit), len(carried)) == (4, 1)
    positions, cuts = seen_positions(document, binary)
    assert (len(positions), cuts) == (96, [])


# ---- buzz-city


def test_city_has_the_counts_of_the_paper(cities):
    document, binary, _, _ = cities
    polygons = {True: 0, False: 0}
    quadrics = refractive = 0
    for node in document["nodes"]:
        if "mesh" not in node:
            continue
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        extensions = document["materials"][primitive["material"]].get("extensions", {})
        if node["extras"].get("quadric"):
            quadrics += 1
            refractive += "KHR_materials_transmission" in extensions
            # A true quadric: a sphere that the node stretches, in the mesh's material.
            binding = node["extensions"]["BUZZ_analytic_shape"]
            shape = document["extensions"]["KHR_implicit_shapes"]["shapes"][binding["shape"]]
            assert shape == {"type": "sphere", "sphere": {"radius": 1.0}}
            assert binding["material"] == primitive["material"]
            continue
        # Faces share no vertices, and every face is a fan about its first.
        fans = len(np.unique(read(document, binary, primitive["indices"])[::3]))
        assert fans == node["extras"]["polygons"]
        polygons[node["extras"]["reflective"]] += fans
    assert sum(polygons.values()) == 755
    assert polygons[True] == 578
    assert (quadrics, refractive) == (41, 4)
    assert len(document["extensions"]["KHR_lights_punctual"]["lights"]) == 1


def test_city_has_600_frames_that_turn_about_all_axes(cities):
    document, binary, _, _ = cities
    assert len(seen_positions(document, binary)[0]) == 600
    _, rotations = buzz_city.camera_path()
    right, back = rotations[:, :, 0], rotations[:, :, 2]
    heading = np.degrees(np.arctan2(-back[:, 0], back[:, 2]))
    pitch = np.degrees(np.arcsin(-back[:, 1]))
    roll = np.degrees(np.arcsin(right[:, 1] / np.cos(np.radians(pitch))))
    assert min(np.ptp(heading), np.ptp(pitch), np.ptp(roll)) > 8


def test_city_begins_with_ground_and_sky_only(cities):
    _, _, solids, quadrics = cities
    eyes, rotations = buzz_city.camera_path()
    slope = np.tan(buzz_city.YFOV / 2) * np.array([buzz_city.RESOLUTION[0] / buzz_city.RESOLUTION[1], 1.0])
    things = [np.concatenate(s.faces) for s in solids if s.material not in ("ground", "sky")]
    corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    things += [corners * q.axes @ q.rotation.T + q.centre for q in quadrics]
    for frame in range(25):
        for thing in things:
            x, y, z = ((thing - eyes[frame]) @ rotations[frame]).T
            beside = [x > -z * slope[0], x < z * slope[0], y > -z * slope[1], y < z * slope[1], z > 0]
            assert any(side.all() for side in beside), frame


def test_city_moves_by_a_pixel_or_two_a_frame(cities):
    _, _, solids, quadrics = cities
    surface = motion.surface_of(solids)
    path = buzz_city.camera_path()
    moved = motion.image_motion(*path, buzz_city.YFOV, buzz_city.RESOLUTION, surface, quadrics)
    assert 1.2 < moved.mean() < 2.1
    assert moved.min() > 0.8
    # Smooth: no jerk between the frames looked at.
    assert np.abs(np.diff(moved)).max() < 0.5


def test_city_sun_shines_in_under_the_sky():
    # The sky leans at 45 degrees towards the camera's back; a ray to a lower sun never meets it.
    assert buzz_city.SUN[1] < buzz_city.SUN[2]
