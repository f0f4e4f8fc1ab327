"""Cryptomatte as other programs read it: OpenImageIO the ids, Blender's compositor the mattes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from sequences import ROOT, convert, read_exr

COURTYARD = ROOT / "scenes/courtyard/courtyard.gltf"


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frame 70 of courtyard with all layers."""
    out = tmp_path_factory.mktemp("crypto")
    convert(COURTYARD, out, "-r", "160x90", "-f", "70", "--aov", "all")
    return out / "courtyard.0070.exr"


def manifest(spec: oiio.ImageSpec, layer: str) -> dict[str, float]:
    """The names of a layer and their ids, from the header."""
    key = next(a.name.rsplit("/", 1)[0] for a in spec.extra_attribs if a.name.startswith("cryptomatte/") and a.value == layer)
    assert spec.getattribute(f"{key}/hash") == "MurmurHash3_32"
    assert spec.getattribute(f"{key}/conversion") == "uint32_to_float32"
    names = json.loads(spec.getattribute(f"{key}/manifest"))
    return {name: float(np.array(int(bits, 16), np.uint32).view(np.float32)) for name, bits in names.items()}


def test_ids_and_names_agree(frame: Path) -> None:
    """Every id in the picture is one of the header's, objects are where `objectId` says, and their coverage is whole."""
    image = oiio.ImageBuf(str(frame))
    spec = image.spec()
    channels = dict(zip(spec.channelnames, np.moveaxis(image.get_pixels(oiio.FLOAT), 2, 0), strict=True))
    gltf = json.loads(COURTYARD.read_text())
    named = {"CryptoObject": {n["name"] for n in gltf["nodes"] if "mesh" in n}, "CryptoMaterial": {m["name"] for m in gltf["materials"]}}
    surface = channels["objectId.id"] > 0
    for layer, names in named.items():
        known = manifest(spec, layer)
        assert names == set(known)
        ids, coverage = channels[f"{layer}00.R"], channels[f"{layer}00.G"]
        assert set(np.unique(ids[surface])) <= set(map(np.float32, known.values()))
        assert (coverage == surface).all() and (ids[~surface] == 0).all()
        assert not channels[f"{layer}00.B"].any() and not channels[f"{layer}00.A"].any()
    tags = {}
    for tag, number in zip(channels["objectId.id"][surface], channels["CryptoObject00.R"][surface], strict=True):
        assert tags.setdefault(tag, number) == number
    assert len(tags) > 5


def test_super_sampled_mattes_cover_what_the_picture_shows(tmp_path: Path) -> None:
    """Ids are covered by the samples that colours are the mean of: exact shares of a pixel, most first, no more than all of it."""
    layers = ["CryptoObject", "CryptoMaterial"]
    convert(COURTYARD, tmp_path, "-r", "160x90", "-f", "70", "--aov", "object,crypto", "--aa", "3", "--transparent")
    path = tmp_path / "courtyard.0070.exr"
    channels = read_exr(path)
    spec = oiio.ImageBuf(str(path)).spec()
    for layer in layers:
        known = {np.float32(number) for number in manifest(spec, layer).values()}
        ids = np.stack([channels[f"{layer}{k:02}.{c}"] for k in range(3) for c in "RB"])
        shares = np.stack([channels[f"{layer}{k:02}.{c}"] for k in range(3) for c in "GA"])
        assert (np.diff(shares, axis=0) <= 0).all() and (shares.sum(axis=0) <= 1).all()
        assert ((ids == 0) == (shares == 0)).all() and set(np.unique(ids[ids != 0])) <= known
        # Corners of the finest cells weigh a 64th of the pixel.
        assert (shares * 64 == np.round(shares * 64)).all()
        for one, other in [(a, b) for a in range(6) for b in range(a)]:
            assert (ids[one] != ids[other])[shares[one] > 0].all()
        partly = ((shares[0] > 0) & (shares[0] < 1)).mean()
        assert 0.05 < partly < 0.5, partly
        assert ((shares[1] > 0) & (channels["objectId.id"] > 0)).any()
        # Nothing in courtyard is seen through, so what covers a pixel makes it opaque; few show more than six things.
        covered, fits = shares.sum(axis=0), shares[5] == 0
        assert (covered <= channels["A"]).all() and (covered == channels["A"])[fits].all() and fits.mean() > 0.99


BLENDER = """
import json, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
path, out, names = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
scene = bpy.context.scene
tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
scene.compositing_node_group = tree
image = bpy.data.images.load(path)
node = tree.nodes.new("CompositorNodeImage")
node.image = image
print("LAYERS", json.dumps([s.name for s in node.outputs if s.enabled]))
crypto = tree.nodes.new("CompositorNodeCryptomatteV2")
crypto.source = "IMAGE"
crypto.image = image
output = tree.nodes.new("NodeGroupOutput")
matte = next(s for s in crypto.outputs if s.name == "Matte")
tree.links.new(matte, output.inputs[0])
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
scene.collection.objects.link(camera)
scene.camera = camera
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.render.resolution_x, scene.render.resolution_y = 160, 90
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
for layer, wanted in names.items():
    crypto.layer_name = layer
    for i, name in enumerate(wanted):
        crypto.matte_id = name
        scene.render.filepath = f"{out}/{layer}.{i}.exr"
        bpy.ops.render.render(write_still=True)
"""


def test_blender_picks_every_object_and_material(frame: Path, tmp_path: Path) -> None:
    """Each name's matte is 1 where it is shown and 0 elsewhere; all together they cover what is no background."""
    image = oiio.ImageBuf(str(frame))
    channels = read_exr(frame)
    ids = {layer: manifest(image.spec(), layer) for layer in ("CryptoObject", "CryptoMaterial")}
    visible = {
        layer: [name for name, number in known.items() if (channels[f"{layer}00.R"] == np.float32(number)).any()] for layer, known in ids.items()
    }
    command = [sys.executable, "-c", BLENDER, str(frame), str(tmp_path), json.dumps(visible)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    sockets = json.loads(next(li for li in run.stdout.splitlines() if li.startswith("LAYERS")).removeprefix("LAYERS "))
    layers = {name.split(".")[0] for name in channels if "." in name}
    assert layers <= set(sockets), layers - set(sockets)
    surface = channels["objectId.id"] > 0
    for layer, names in visible.items():
        assert len(names) > 3
        total = np.zeros(surface.shape)
        for i, name in enumerate(names):
            matte = read_exr(tmp_path / f"{layer}.{i}.exr")["R"]
            expected = channels[f"{layer}00.R"] == np.float32(ids[layer][name])
            assert np.abs(matte - expected).max() < 0.01, name
            total += matte
        assert np.abs(total[surface] - 1).max() < 0.01 and np.abs(total[~surface]).max(initial=0) < 0.01
