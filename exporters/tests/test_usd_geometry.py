"""USD geometry, instancing, visibility and shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from exporters.usd.subdivide import Polygons, catmull_clark
from gltf_reader import primitive
from PIL import Image
from pxr import Gf, Usd, UsdGeom, Vt


def named(gltf, name):
    """All nodes with a name."""
    return [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == name]


def test_transforms_units_and_up_axis(usd_convert):
    made = u.stage("Z", 0.01)
    u.camera(made)
    prim = u.cube(made, "/World/Box")
    api = UsdGeom.XformCommonAPI(prim)
    for frame in range(1, 6):
        api.SetTranslate((100.0 * frame, 0, 50), frame)
    gltf = usd_convert(made)
    node = gltf.node("Box")
    np.testing.assert_allclose(gltf.world(node, 3) @ (1, 1, 1, 1), (3.01, 0.51, -0.01, 1), atol=1e-6)


def test_sheared_transforms(usd_convert):
    made = u.stage()
    u.camera(made)
    rig = UsdGeom.Xform.Define(made, "/World/Rig")
    UsdGeom.XformCommonAPI(rig).SetScale((3, 1, 0.5))
    prim = u.cube(made, "/World/Rig/Box")
    for frame in range(1, 6):
        UsdGeom.XformCommonAPI(prim).SetRotate((10, 20, 15 * frame), UsdGeom.XformCommonAPI.RotationOrderXYZ, frame)
    gltf = usd_convert(made)
    for frame in range(1, 6):
        np.testing.assert_allclose(gltf.world(gltf.node("Box"), frame), u.matrix(prim, frame), atol=1e-5)


def test_left_handed_holes_and_ngons(usd_convert):
    made = u.stage()
    u.camera(made)
    right, left = u.quad(made, "/World/Right"), u.quad(made, "/World/Left")
    left.CreateOrientationAttr("leftHanded")
    pentagon = UsdGeom.Mesh.Define(made, "/World/Penta")
    pentagon.CreatePointsAttr([(math.cos(a), math.sin(a), 0) for a in np.linspace(0, 5, 5)] + [(9, 9, 9)] * 3)
    pentagon.CreateFaceVertexCountsAttr([5, 3])
    pentagon.CreateFaceVertexIndicesAttr([0, 1, 2, 3, 4, 5, 6, 7])
    pentagon.CreateSubdivisionSchemeAttr("none")
    pentagon.CreateHoleIndicesAttr([1])
    gltf = usd_convert(made)

    def facing(name):
        a, b, c = gltf.triangles(gltf.node(name))[0]
        return np.cross(b - a, c - a)[2]

    assert facing("Right") > 0 > facing("Left")
    assert len(gltf.triangles(gltf.node("Penta"))) == 3
    assert right.GetPrim() != left.GetPrim()


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_concave_faces(usd_convert, orientation):
    """An L, a U and one that is a hole."""
    made = u.stage()
    u.camera(made)
    prim = UsdGeom.Mesh.Define(made, "/World/Letters")
    ell = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    you = [(5, 0), (8, 0), (8, 3), (7, 3), (7, 1), (6, 1), (6, 3), (5, 3)]
    prim.CreatePointsAttr([(x, y, 0) for x, y in ell + you])
    prim.CreateFaceVertexCountsAttr([6, 6, 8])
    prim.CreateFaceVertexIndicesAttr([5, 0, 1, 2, 3, 4, *range(6), *range(6, 14)])
    prim.CreateHoleIndicesAttr([1])
    prim.CreateSubdivisionSchemeAttr("none")
    prim.CreateOrientationAttr(orientation)
    triangles = usd_convert(made)
    triangles = triangles.triangles(triangles.node("Letters"))
    areas = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2] / 2 * (1 if orientation == "rightHanded" else -1)
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(5 + 7)


def test_primvars_of_every_interpolation(usd_convert, tmp_path):
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    made = u.stage()
    u.camera(made)
    values = {
        "constant": ([(0.5, 0.25)], None, {(0.5, 0.75)}),
        "vertex": ([(0, 0), (1, 0), (1, 1), (0, 1)], None, {(0, 1), (1, 1), (1, 0), (0, 0)}),
        "faceVarying": ([(0, 0), (1, 0)], [0, 1, 1, 0], {(0, 1), (1, 1)}),
        "uniform": ([(0.1, 0.2)], None, {(0.1, 0.8)}),
    }
    material = u.preview(made, "/World/Mat")
    u.texture(made, material, "diffuseColor", "t.png")
    for name, (data, indices, _) in values.items():
        prim = u.quad(made, f"/World/{name}")
        u.uv(prim, data, name, indices=indices)
        u.bind(prim, material)
    gltf = usd_convert(made)
    for name, (_, _, want) in values.items():
        _, arrays = primitive(gltf, name)
        assert {tuple(np.round(t, 5).tolist()) for t in arrays["TEXCOORD_0"]} == {tuple(np.float32(np.round(w, 5)).tolist()) for w in want}, name


def test_normals_and_display_colour(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Vertex")
    prim.CreateNormalsAttr([(0, 0, 1), (1, 0, 1), (0, 0, 1), (0, 1, 1)])
    prim.SetNormalsInterpolation("vertex")
    prim.CreateDisplayColorPrimvar("vertex").Set([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    plain = u.quad(made, "/World/Constant")
    plain.CreateDisplayColorAttr([(0.2, 0.4, 0.6)])
    plain.CreateDisplayOpacityAttr([0.5])
    gltf = usd_convert(made)
    _, arrays = primitive(gltf, "Vertex")
    assert np.allclose(np.linalg.norm(arrays["NORMAL"], axis=1), 1)
    assert len(np.unique(arrays["COLOR_0"], axis=0)) == 4
    data, arrays = primitive(gltf, "Constant")
    assert "NORMAL" not in arrays
    assert gltf.root["materials"][data["material"]]["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([0.2, 0.4, 0.6, 0.5])


def test_geom_subsets(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.cube(made, "/World/Box")
    u.bind(prim, u.preview(made, "/World/Rest", diffuseColor=(0.0, 0.0, 1.0)))
    subset = UsdGeom.Subset.CreateGeomSubset(prim, "Lid", "face", Vt.IntArray([4, 5]), "materialBind")
    u.bind(subset, u.preview(made, "/World/Red", diffuseColor=(1.0, 0.0, 0.0)))
    gltf = usd_convert(made)
    mesh = gltf.root["meshes"][gltf.root["nodes"][gltf.node("Box")]["mesh"]]
    found = {gltf.root["materials"][p["material"]]["name"]: len(gltf.accessor(p["indices"])) // 3 for p in mesh["primitives"]}
    assert found == {"Red": 4, "Rest": 8}


def limit_of_cube(levels, **creases):
    """Points of a subdivided cube of size 2."""
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    corners = np.array([0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
    mesh = Polygons(points, np.full(6, 4), corners, np.arange(6), **creases)
    for _ in range(levels):
        mesh = catmull_clark(mesh)
    return mesh


@pytest.mark.parametrize(
    ("kind", "moving", "lost"), [("face", False, []), ("point", False, ["GeomSubset of elementType point"]), ("face", True, ["animated indices"])]
)
def test_subsets_of_other_elements_or_that_change_are_named(usd_convert, kind, moving, lost):
    made = u.stage()
    u.camera(made)
    subset = UsdGeom.Subset.Define(made, f"{u.cube(made, '/World/Box').GetPath()}/Part")
    subset.CreateElementTypeAttr(kind)
    subset.CreateFamilyNameAttr("materialBind")
    subset.CreateIndicesAttr([0, 1])
    if moving:
        subset.GetIndicesAttr().Set([0, 1], 1)
        subset.GetIndicesAttr().Set([2, 3], 4)
    u.bind(subset, u.preview(made, "/World/M"))
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Box/Part") == lost
    assert len(gltf.root["meshes"][0]["primitives"]) == (2 if kind == "face" else 1)


def test_catmull_clark_of_a_cube():
    """One level of a cube, worked by hand: face points, edge points, and corners at 5/9."""
    mesh = limit_of_cube(1)
    assert len(mesh.points) == 26
    rows = {tuple(np.round(np.abs(p), 6)) for p in mesh.points}
    assert rows == {(0.555556, 0.555556, 0.555556), (0.0, 0.75, 0.75), (0.75, 0.0, 0.75), (0.75, 0.75, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)}


def test_creases():
    """All edges sharp for ever: the cube stays. Sharp for one level: the second level is smooth."""
    edges = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1])
    hard = limit_of_cube(2, edges=edges, sharpness=np.full(12, 10.0))
    assert np.abs(hard.points).max(axis=0) == pytest.approx([1, 1, 1])
    assert np.allclose(np.abs(hard.points).max(axis=1), 1)
    half = limit_of_cube(2, edges=edges, sharpness=np.full(12, 1.0))
    assert np.abs(half.points).max() == pytest.approx(1)
    assert np.linalg.norm(half.points, axis=1).max() < math.sqrt(3)


def test_subdivision_is_as_asked(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.cube(made, "/World/Round", "catmullClark")
    u.cube(made, "/World/Plain")
    gltf = usd_convert(made)
    assert len(gltf.triangles(gltf.node("Round"))) == 6 * 16 * 2
    assert len(gltf.triangles(gltf.node("Plain"))) == 12
    assert "NORMAL" in primitive(gltf, "Round")[1]
    caged = usd_convert(made, levels=0)
    assert len(caged.triangles(caged.node("Round"))) == 12
    assert prim.GetSubdivisionSchemeAttr().Get() == "catmullClark"


def test_moving_points_and_changing_topology(usd_convert):
    made = u.stage(frames=(1, 3))
    u.camera(made)
    wave, grow = u.quad(made, "/World/Wave"), u.quad(made, "/World/Grow")
    for frame in (1, 2, 3):
        wave.GetPointsAttr().Set([(-1, -1, 0), (1, -1, 0), (1, 1, frame**2), (-1, 1, 0)], frame)
        corners = [0, 1, 2, 3] if frame < 3 else [0, 1, 2]
        grow.GetFaceVertexIndicesAttr().Set(corners, frame)
        grow.GetFaceVertexCountsAttr().Set([len(corners)], frame)
    gltf = usd_convert(made)
    node = gltf.node("Wave")
    assert [gltf.posed_points(node, f)[:, 2].max() for f in (1, 2, 3)] == pytest.approx([1, 4, 9])
    seen = [[len(gltf.triangles(n)) for n in named(gltf, "Grow") if gltf.visible(n, f)] for f in (1, 2, 3)]
    assert seen == [[2], [2], [1]]


def test_changing_holes_and_counts(usd_convert):
    made = u.stage(frames=(1, 3))
    u.camera(made)
    prim = u.cube(made, "/World/Box")
    for frame, holes in ((1, [0]), (2, [0, 1]), (3, [])):
        prim.CreateHoleIndicesAttr().Set(holes, frame)
    counts = u.cube(made, "/World/Counts")
    corners = [0, 1, 3, 2, 4, 6]
    counts.GetFaceVertexIndicesAttr().Set(corners)
    counts.GetFaceVertexCountsAttr().Set([3, 3], 1)
    counts.GetFaceVertexCountsAttr().Set([6], 2)
    gltf = usd_convert(made)
    seen = [[len(gltf.triangles(n)) for n in named(gltf, "Box") if gltf.visible(n, f)] for f in (1, 2, 3)]
    assert seen == [[10], [8], [12]]
    seen = [[len(gltf.triangles(n)) for n in named(gltf, "Counts") if gltf.visible(n, f)] for f in (1, 2)]
    assert seen == [[2], [4]]


def test_changing_sharpness(usd_convert):
    made = u.stage(frames=(1, 2))
    u.camera(made)
    prim = u.cube(made, "/World/Box", "catmullClark")
    prim.CreateCornerIndicesAttr(list(range(8)))
    for frame in (1, 2):
        prim.CreateCornerSharpnessesAttr().Set([10.0 * (frame - 1)] * 8, frame)
    gltf = usd_convert(made)
    reach = [np.linalg.norm(gltf.posed_points(gltf.node("Box"), f), axis=1).max() for f in (1, 2)]
    assert reach[0] < 1.2
    assert reach[1] == pytest.approx(math.sqrt(3))


def test_movement_that_single_precision_swallows_is_named(usd_convert):
    made = u.stage()
    u.camera(made)
    for name, place, step in (("Far", 4e7, 0.25), ("Fast", 4e7, 100.0), ("Near", 10.0, 0.25), ("Still", 4e7, 0.0)):
        move = u.quad(made, f"/World/{name}").AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        for frame in range(1, 6):
            move.Set((place + step * frame, 0, 0), frame)
    gltf = usd_convert(made)
    assert [bool(gltf.lost_features(f"/World/{n}")) for n in ("Far", "Fast", "Near", "Still")] == [True, False, False, False]


@pytest.mark.parametrize(
    ("kind", "attributes", "shape"),
    [
        ("Sphere", {"radius": 1.5}, {"type": "sphere", "sphere": {"radius": 1.5}}),
        ("Cube", {"size": 3.0}, {"type": "box", "box": {"size": [3, 3, 3]}}),
        ("Cylinder", {"radius": 0.5, "height": 3.0, "axis": "X"}, {"type": "cylinder", "cylinder": {"height": 3, "radiusTop": 0.5, "radiusBottom": 0.5}}),
        ("Cone", {"radius": 0.5, "height": 3.0, "axis": "Z"}, {"type": "cylinder", "cylinder": {"height": 3, "radiusTop": 0, "radiusBottom": 0.5}}),
        ("Capsule", {"radius": 0.5, "height": 2.0, "axis": "Y"}, {"type": "capsule", "capsule": {"height": 2, "radiusTop": 0.5, "radiusBottom": 0.5}}),
        ("Plane", {"width": 2.0, "length": 5.0, "axis": "Z"}, {"type": "plane", "plane": {"sizeX": 2, "sizeZ": 5, "doubleSided": True}}),
        ("Plane", {"width": 2.0, "length": 5.0, "axis": "X"}, {"type": "plane", "plane": {"sizeX": 5, "sizeZ": 2, "doubleSided": True}}),
    ],
)
def test_gprims_are_analytic_with_a_mesh(usd_convert, kind, attributes, shape):
    made = u.stage()
    u.camera(made)
    prim = made.DefinePrim("/World/Shape", kind)
    for name, value in attributes.items():
        prim.GetAttribute(name).Set(value)
    gltf = usd_convert(made)
    node = gltf.root["nodes"][gltf.node("Shape")]
    binding = node["extensions"]["BUZZ_analytic_shape"]
    assert gltf.root["extensions"]["KHR_implicit_shapes"]["shapes"][binding["shape"]] == shape
    assert "extensionsRequired" not in gltf.root
    # The mesh beside it fills the extent that USD itself computes, and faces outwards.
    m = gltf.world(gltf.node("Shape"), 1)
    triangles = gltf.triangles(gltf.node("Shape")) @ m[:3, :3].T + m[:3, 3]
    extent = np.array(UsdGeom.Boundable(prim).ComputeExtent(1)) if hasattr(UsdGeom.Boundable, "ComputeExtent") else None
    if extent is None:
        extent = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), Usd.TimeCode(1)))
    np.testing.assert_allclose(triangles.reshape(-1, 3).min(axis=0), extent[0], atol=1e-2)
    np.testing.assert_allclose(triangles.reshape(-1, 3).max(axis=0), extent[1], atol=1e-2)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward = triangles.mean(axis=1) if kind != "Plane" else np.tile(m[:3, 1], (len(triangles), 1))
    assert ((normal * outward).sum(axis=1) > -1e-9).all()


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize(("top", "bottom", "height"), [(0.3, 0.9, 3.0), (0.9, 0.3, 3.0), (0.2, 1.0, 0.5)])
def test_capsules_of_two_radii(usd_convert, axis, top, bottom, height):
    """Mesh and analytic shape fill the extent that USD itself computes."""
    made = u.stage()
    u.camera(made)
    prim = UsdGeom.Capsule_1.Define(made, "/World/Shape")
    for name, value in (("axis", axis), ("radiusTop", top), ("radiusBottom", bottom), ("height", height)):
        prim.GetPrim().GetAttribute(name).Set(value)
    gltf = usd_convert(made)
    extent = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(prim, Usd.TimeCode(1)))
    m = gltf.world(gltf.node("Shape"), 1)
    points = gltf.triangles(gltf.node("Shape")).reshape(-1, 3) @ m[:3, :3].T + m[:3, 3]
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], extent, atol=0.01 * np.ptp(extent))
    shape = gltf.root["extensions"]["KHR_implicit_shapes"]["shapes"][0]["capsule"]
    centres = [m @ (0, sign * shape["height"] / 2, 0, 1) for sign in (1, -1)]
    balls = [(c[:3] - r, c[:3] + r) for c, r in zip(centres, (shape["radiusTop"], shape["radiusBottom"]), strict=True)]
    np.testing.assert_allclose([np.min(balls, axis=(0, 1)), np.max(balls, axis=(0, 1))], extent, atol=1e-5)


def test_broken_transforms_are_hidden_and_named(usd_convert):
    made = u.stage()
    camera = u.camera(made)
    UsdGeom.XformCommonAPI(camera).SetScale((0, 0, 0))
    prim = u.quad(made, "/World/Broken")
    UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d(float("nan")))
    flat = u.quad(made, "/World/Flat")
    UsdGeom.XformCommonAPI(flat).SetScale((1, 0, 1))
    gltf = usd_convert(made)
    assert all(n["name"] != "Broken" for n in gltf.root["nodes"])
    assert gltf.lost_features("/World/Broken") == ["transform that is no usable number"]
    assert np.isfinite(gltf.world(gltf.node("Flat"), 1)).all()
    assert np.isfinite(gltf.world(gltf.node("Camera"), 1)).all()
