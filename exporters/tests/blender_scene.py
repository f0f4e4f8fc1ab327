"""Building blocks for Blender test scenes."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix

YUP = np.array(Matrix.Rotation(-math.pi / 2, 4, "X"))


def link(ob):
    """Link an object into the scene."""
    bpy.context.scene.collection.objects.link(ob)
    return ob


def camera(name: str = "Camera", location=(0, -8, 2), rotation=(1.35, 0, 0), **lens):
    """A camera, the scene's if it is the first."""
    data = bpy.data.cameras.new(name)
    for key, value in lens.items():
        setattr(data, key, value)
    ob = link(bpy.data.objects.new(name, data))
    ob.location, ob.rotation_euler = location, rotation
    if bpy.context.scene.camera is None:
        bpy.context.scene.camera = ob
    return ob


def light(kind: str, name: str = "Light", location=(0, 0, 5), **settings):
    """A light."""
    data = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(data, key, value)
    ob = link(bpy.data.objects.new(name, data))
    ob.location = location
    return ob


def cube(name: str = "Cube", location=(0, 0, 0), size: float = 2.0):
    """A cube mesh object."""
    h = size / 2
    points = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(name, points, faces, location)


def plane(name: str = "Plane", size: float = 10.0, location=(0, 0, 0)):
    """A square in the XY plane."""
    h = size / 2
    return mesh(name, [(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)], [(0, 1, 2, 3)], location)


def mesh(name: str, points, faces, location=(0, 0, 0)):
    """An object from points and faces."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(points, [], faces)
    ob = link(bpy.data.objects.new(name, data))
    ob.location = location
    return ob


def material(name: str = "Grey", colour=(0.8, 0.8, 0.8), specular: float = 0.0):
    """A Principled material without highlights, and its shader node."""
    made = bpy.data.materials.new(name)
    if made.node_tree is None:
        made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Specular IOR Level"].default_value = specular
    shader.inputs["Roughness"].default_value = 1
    return made, shader


def key(owner, path: str, values: dict, index: int = -1, interpolation: str = "LINEAR"):
    """Key a property: {frame: value}."""
    for frame, value in values.items():
        if index >= 0:
            getattr(owner, path)[index] = value
        else:
            setattr(owner, path, value)
        owner.keyframe_insert(path, index=index, frame=frame)
    from exporters.blender.prepare import action_curves

    for curve in action_curves(owner.id_data):
        if curve.data_path.endswith(path):
            for point in curve.keyframe_points:
                point.interpolation = interpolation


def set_frame(frame: int):
    """Go to a frame; the evaluated dependency graph."""
    bpy.context.scene.frame_set(frame)
    return bpy.context.evaluated_depsgraph_get()


def expected_view(ob, depsgraph) -> np.ndarray:
    """camera_from_world in glTF axes as Blender's renderer has it: position and direction, no scale."""
    world = YUP @ np.array(ob.evaluated_get(depsgraph).matrix_world.normalized())
    return np.linalg.inv(world)


def expected_projection(ob, depsgraph) -> np.ndarray:
    """Blender's own projection matrix."""
    render = bpy.context.scene.render
    percent = render.resolution_percentage
    x, y = render.resolution_x * percent // 100, render.resolution_y * percent // 100
    evaluated = ob.evaluated_get(depsgraph)
    return np.array(evaluated.calc_matrix_camera(depsgraph, x=x, y=y, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y))


def world_points(gltf, node, frame):
    """Sorted world vertices of a node."""
    points = gltf.triangles(node).reshape(-1, 3)
    m = gltf.world(node, frame)
    return np.unique(np.round(points @ m[:3, :3].T + m[:3, 3], 4), axis=0)


def blender_points(ob, depsgraph):
    """Sorted evaluated world vertices in glTF axes."""
    evaluated = ob.evaluated_get(depsgraph)
    m = YUP @ np.array(evaluated.matrix_world)
    points = np.array([v.co for v in evaluated.data.vertices])
    return np.unique(np.round(points @ m[:3, :3].T + m[:3, 3], 4) + 0.0, axis=0)
