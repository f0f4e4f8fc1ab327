"""Primvars of meshes: which are taken, what subdivision makes of them, and what instances inherit."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from gltf_reader import primitive
from PIL import Image
from pxr import Sdf, Usd, UsdGeom

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
# Unevenly spaced, so that smoothing moves the points within their plane.
GRID = [(x, y) for y in (0, 1, 2, 6) for x in (0, 1, 2, 6)]


@pytest.fixture
def material(tmp_path):
    """A function that binds a textured material to a mesh: material(stage, mesh, st)."""
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")

    def bind(made, prim, st="st"):
        made_of = u.preview(made, "/World/Mat")
        u.texture(made, made_of, "diffuseColor", "t.png", st=st)
        u.bind(prim, made_of)

    return bind


def grid(made):
    """Three by three faces to be subdivided."""
    prim = UsdGeom.Mesh.Define(made, "/World/Grid")
    prim.CreatePointsAttr([(x, y, 0) for x, y in GRID])
    prim.CreateFaceVertexCountsAttr([4] * 9)
    prim.CreateFaceVertexIndicesAttr([i for r in range(3) for c in range(3) for i in (4 * r + c, 4 * r + c + 1, 4 * r + c + 5, 4 * r + c + 4)])
    return prim


def test_values_at_points_are_subdivided_as_the_points_are(usd_convert, material):
    """So coordinates that are the points' own stay that, which straight interpolation does not give (varying)."""
    off = {}
    for interpolation in ("vertex", "varying"):
        made = u.stage(frames=None)
        u.camera(made)
        prim = grid(made)
        u.uv(prim, GRID, interpolation)
        material(made, prim)
        _, arrays = primitive(usd_convert(made), "Grid")
        off[interpolation] = np.abs(arrays["TEXCOORD_0"] * (1, -1) + (0, 1) - arrays["POSITION"][:, :2]).max()
    assert off["vertex"] < 1e-6
    assert off["varying"] > 0.1


@pytest.mark.parametrize(("rule", "straight"), [(None, False), ("cornersOnly", False), ("boundaries", True), ("all", True)])
def test_values_at_corners_are_subdivided_as_the_mesh_says(usd_convert, material, rule, straight):
    """By default they are smoothed with the points, but for seams; here, where every point has one value, as the points are."""
    made = u.stage(frames=None)
    u.camera(made)
    prim = grid(made)
    if rule:
        prim.CreateFaceVaryingLinearInterpolationAttr(rule)
    u.uv(prim, GRID, "faceVarying", indices=prim.GetFaceVertexIndicesAttr().Get())
    material(made, prim)
    _, arrays = primitive(usd_convert(made), "Grid")
    off = np.abs(arrays["TEXCOORD_0"] * (1, -1) + (0, 1) - arrays["POSITION"][:, :2]).max()
    assert off > 0.1 if straight else off < 1e-6


def test_colours_at_points_are_subdivided_as_the_points_are(usd_convert):
    made = u.stage(frames=None)
    u.camera(made)
    prim = grid(made)
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex")
    primvar.Set([(x / 6, y / 6, 0) for x, y in GRID])
    _, arrays = primitive(usd_convert(made), "Grid")
    np.testing.assert_allclose(arrays["COLOR_0"][:, :2] * 6, arrays["POSITION"][:, :2], atol=1e-5)


def test_the_coordinates_that_a_material_reads_are_taken(usd_convert, material):
    """However many others a mesh has."""
    made = u.stage(frames=None)
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    for name in "abcdefg":
        u.uv(prim, [(0, 0)] * 4, name=name)
    u.uv(prim, SQUARE, name="st")
    material(made, prim)
    gltf = usd_convert(made)
    data, arrays = primitive(gltf, "Card")
    assert not gltf.lost_features("/World/Card")
    assert {k for k in data["attributes"] if k.startswith("TEXCOORD")} == {"TEXCOORD_0"}
    assert {tuple(t) for t in arrays["TEXCOORD_0"].tolist()} == set(SQUARE)


def test_instances_inherit_what_is_said_where_they_stand(usd_convert, tmp_path):
    """Display colour, opacity and coordinates above an instance are its own."""
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    asset = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/Asset").GetPrim())
    u.quad(asset, "/Asset/Card")
    UsdGeom.Sphere.Define(asset, "/Asset/Ball")
    material = u.preview(asset, "/Asset/M")
    u.texture(asset, material, "diffuseColor", str(tmp_path / "t.png"))
    u.bind(u.quad(asset, "/Asset/Picture"), material)
    asset.Save()
    made = u.stage(frames=None)
    u.camera(made)
    colours = {"Red": (1, 0, 0), "Blue": (0, 0, 1), "AlsoBlue": (0, 0, 1)}
    for name, colour in colours.items():
        prim = made.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference(str(tmp_path / "asset.usda"))
        prim.SetInstanceable(True)
        api = UsdGeom.PrimvarsAPI(prim)
        api.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "constant").Set([colour])
        api.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "constant").Set([colour[:2]])
    gltf = usd_convert(made)
    for kind in ("Card", "Ball"):
        meshes = [n["mesh"] for n in gltf.root["nodes"] if n["name"] == kind]
        factors = [gltf.root["materials"][gltf.root["meshes"][m]["primitives"][0]["material"]]["pbrMetallicRoughness"]["baseColorFactor"] for m in meshes]
        assert factors == [[*c, 1] for c in colours.values()]
        assert meshes[1] == meshes[2] != meshes[0]
    pictures = [gltf.root["meshes"][n["mesh"]]["primitives"][0]["attributes"]["TEXCOORD_0"] for n in gltf.root["nodes"] if n["name"] == "Picture"]
    assert [gltf.accessor(p)[0].tolist() for p in pictures] == [[1, 1], [0, 1], [0, 1]]
