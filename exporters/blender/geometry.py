"""Meshes as rendered, and how they change shape; written by Blender's own glTF exporter.

Every distinct evaluated mesh becomes one temporary object in a temporary scene, which `io_scene_gltf2` exports with its
materials. A mesh that changes shape keeps its key poses (see common/morph.py) as shape keys, exported as morph targets.
A mesh whose vertices or faces change in number becomes several meshes, each visible while it lasts.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..common.morph import choose_targets
from ..common.report import Lost
from .materials import DEFORMED, default_surface, own_copy
from .nodes import has_generated
from .prepare import is_animated, still

# Modifiers that may change what of a mesh is not its vertices' positions.
_CHANGES_ATTRIBUTES = {"NODES", "UV_WARP", "UV_PROJECT", "DATA_TRANSFER"}
# Modifiers that bend a mesh, and leave its generated coordinates alone.
_DEFORMS = {
    "ARMATURE", "CAST", "CLOTH", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LAPLACIANSMOOTH", "LATTICE", "MESH_CACHE",
    "MESH_DEFORM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY", "SURFACE_DEFORM", "WARP", "WAVE",
}  # fmt: skip
_DEFORMING_PARENTS = ("ARMATURE", "LATTICE", "CURVE")
# What names of attributes begin with that geometry nodes have made by themselves.
_ANONYMOUS = ".a_"
# Other objects that a curve's or a text's own data is shaped by.
_SHAPED_BY = ("bevel_object", "taper_object", "follow_curve")


@dataclass
class Shape:
    """One mesh topology with a copy of it in its first pose."""

    name: str
    mesh: bpy.types.Mesh
    topology: bytes
    source: bpy.types.Object
    # sample number -> vertex positions; empty for meshes that never change.
    poses: dict[int, np.ndarray] = field(default_factory=dict)
    # What its object is called in the export scene, and its mesh's place in the file.
    node: str = ""
    mesh_index: int | None = None
    weights: np.ndarray | None = None
    _distinct: dict[bytes, np.ndarray] = field(default_factory=dict)

    def take_pose(self, sample: int, positions: np.ndarray) -> None:
        """Record vertex positions; equal ones are held once."""
        key = hashlib.blake2b(positions, digest_size=16).digest()
        self.poses[sample] = self._distinct.setdefault(key, positions)

    def changes(self, samples: np.ndarray) -> list[int]:
        """Numbers of the samples at which the mesh is not as before or after, in order of time."""
        order = sorted(self.poses, key=lambda n: samples[n])
        inner = zip(order, order[1:], order[2:], strict=False)
        return [order[0], *(n for a, n, b in inner if not self.poses[a] is self.poses[n] is self.poses[b]), order[-1]]


class GeometryStore:
    """Hands out shape numbers; two objects with equal meshes and materials share one."""

    def __init__(self, lost: Lost) -> None:
        self.shapes: list[Shape] = []
        self.lost = lost
        self._by_content: dict[bytes, int] = {}
        self._by_source: dict[tuple, list[int]] = {}
        self._this_sample: dict[int, int] = {}
        # What each source has given in this sample: geometry nodes make several meshes of one name.
        self._meshes_of: dict[tuple, list[int]] = {}
        self._attributes: dict[int, bytes] = {}

    def begin_sample(self) -> None:
        """Forget what was seen in the sample before."""
        self._this_sample = {}
        self._meshes_of = {}

    def shape_of(self, ob: bpy.types.Object, sample: int) -> int:
        """The shape of an evaluated object at a sample; its pose is recorded where it may change."""
        pointer = ob.data.as_pointer()
        own_slots = _slots_of_object(ob)
        if pointer in self._this_sample and not own_slots:
            return self._this_sample[pointer]
        source = (ob.original.name_full, ob.data.name)
        meshes = self._meshes_of.setdefault(source, [])
        if pointer not in meshes:
            meshes.append(pointer)
        source = (*source, meshes.index(pointer))
        known = self._by_source.get(source)
        changing = may_deform(ob)
        if known and not changing:
            return known[0]
        if not known and not changing:
            content = _content(ob)
            if content not in self._by_content:
                self._by_content[content] = self._new(ob, b"")
            number = self._by_content[content]
            self._by_source[source] = [number]
        else:
            topology = _topology(ob.data)
            number = next((n for n in known or [] if self.shapes[n].topology == topology), -1)
            if number < 0:
                number = self._new(ob, topology)
                self._by_source.setdefault(source, []).append(number)
            self.shapes[number].take_pose(sample, _positions(ob.data))
            self._name_what_changes(ob, number)
        if not own_slots:
            self._this_sample[pointer] = number
        return number

    def _name_what_changes(self, ob: bpy.types.Object, number: int) -> None:
        """Only positions are sampled: name a mesh of which a modifier changes anything else."""
        if all(modifier.type not in _CHANGES_ATTRIBUTES for modifier in ob.original.modifiers):
            return
        attributes = _attributes(ob.data)
        if self._attributes.setdefault(number, attributes) != attributes:
            what = "texture coordinates, colours or material slots that change"
            self.lost.add(ob.name, what, "those of the first frame are used; animate the material or the shape instead")

    def _new(self, ob: bpy.types.Object, topology: bytes) -> int:
        # new_from_object() gives the mesh of the instancer for geometry-nodes instances; a copy of the evaluated data does not.
        mesh = ob.data.copy()
        # What geometry nodes pass on among themselves has no name that a material could ask for, and is lost in edit mode.
        for attribute in [a for a in mesh.attributes if a.name.startswith(_ANONYMOUS)]:
            mesh.attributes.remove(attribute)
        # Generated coordinates are measured by the box of the mesh before its modifiers, which the evaluated one still has.
        mesh.use_auto_texspace = False
        if _is_deformed(ob.original):
            mesh[DEFORMED] = True
        for i, slot in enumerate(ob.material_slots):
            if slot.link == "OBJECT" and i < max(len(mesh.materials), 1):
                material = slot.material.original if slot.material else None
                if i < len(mesh.materials):
                    mesh.materials[i] = material
                else:
                    mesh.materials.append(material)
        self.shapes.append(Shape(ob.original.data.name if ob.original.data else ob.name, mesh, topology, ob.original))
        return len(self.shapes) - 1

    def undeform(self, scene: bpy.types.Scene, samples: np.ndarray) -> None:
        """Take the generated coordinates of shapes from what they are without what deforms them; not called before all is sampled."""
        found = [shape for shape in self.shapes if DEFORMED in shape.mesh and _has_generated(shape.mesh)]
        for shape in found:
            _rest(shape.source)
        for shape in sorted(found, key=lambda shape: min(shape.poses)):
            frame = samples[min(shape.poses)]
            scene.frame_set(math.floor(frame), subframe=frame % 1)
            mesh = shape.source.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            # Geometry nodes show other meshes than that of their object.
            if isinstance(mesh, bpy.types.Mesh) and _topology(mesh) == shape.topology:
                shape.mesh.texco_mesh = mesh.copy()
                shape.mesh.texco_mesh.use_auto_texspace = False
                del shape.mesh[DEFORMED]

    def build(self, scene: bpy.types.Scene, samples: np.ndarray, override: bpy.types.Material | None) -> None:
        """Link one object for each shape into `scene`, with shape keys for its key poses.

        `samples` are the frames of the samples in the order in which they were taken; `override` is the material of all.
        """
        made: dict[bpy.types.Material | None, bpy.types.Material] = {}
        for number, shape in enumerate(self.shapes):
            ob = bpy.data.objects.new(f"shape-{number}", shape.mesh)
            shape.mesh.name = shape.name
            shape.node = ob.name
            _fill_slots(shape.mesh, override, made)
            scene.collection.objects.link(ob)
            if len(shape.poses) > 1:
                self._key_poses(ob, shape, samples)

    def _key_poses(self, ob: bpy.types.Object, shape: Shape, samples: np.ndarray) -> None:
        """Shape keys of the key poses, and the weights that bring each sample back."""
        order = shape.changes(samples)
        poses = np.stack([shape.poses[n] for n in order])
        times = samples[order]
        chosen = choose_targets(poses, times, np.sort(samples))
        if chosen is None:
            return
        numbers, shape.weights = chosen
        shape.mesh.vertices.foreach_set("co", poses[0].reshape(-1))
        ob.shape_key_add(name="Basis", from_mix=False)
        for i, number in enumerate(numbers):
            key = ob.shape_key_add(name=f"pose-{i}", from_mix=False)
            key.data.foreach_set("co", poses[number].reshape(-1))
            key.value = 0.0


def may_deform(ob: bpy.types.Object) -> bool:
    """Whether an evaluated object's mesh can differ from frame to frame."""
    source = ob.original
    data = source.data
    # A parent of these kinds is a modifier that is in no list.
    if source.modifiers or source.parent_type in _DEFORMING_PARENTS:
        return True
    if source.type == "META" or is_animated(data) or getattr(data, "shape_keys", None) is not None:
        return True
    handlers = bpy.app.handlers
    # The words of a text cannot be animated: counters are written by Python.
    if source.type == "FONT" and (handlers.frame_change_pre or handlers.frame_change_post):
        return True
    return any(getattr(data, other, None) is not None for other in _SHAPED_BY)


def _is_deformed(ob: bpy.types.Object) -> bool:
    """Whether an object's mesh is bent out of the form that its generated coordinates are those of."""
    bent = any(modifier.type in _DEFORMS and modifier.show_render for modifier in ob.modifiers)
    return bent or ob.parent_type in _DEFORMING_PARENTS or getattr(ob.data, "shape_keys", None) is not None


def _rest(ob: bpy.types.Object) -> None:
    """Switch off what deforms an object's mesh."""
    for modifier in ob.modifiers:
        if modifier.type in _DEFORMS:
            still(ob, f"{modifier.path_from_id()}.show_viewport")
            modifier.show_viewport = False
    if ob.parent_type in _DEFORMING_PARENTS:
        ob.parent_type = "OBJECT"
    if getattr(ob.data, "shape_keys", None) is not None:
        ob.show_only_shape_key, ob.active_shape_key_index = True, 0


def _has_generated(mesh: bpy.types.Mesh) -> bool:
    return any(material is not None and material.node_tree is not None and has_generated(material.node_tree) for material in mesh.materials)


def _fill_slots(mesh: bpy.types.Mesh, override: bpy.types.Material | None, made: dict[bpy.types.Material | None, bpy.types.Material]) -> None:
    """Give every slot a material that can be changed, and a mesh without slots one; `made` holds those that are made for it."""
    if not mesh.materials:
        mesh.materials.append(None)
    for i, material in enumerate(mesh.materials):
        material = override or material
        if material is None or material.library:
            if material not in made:
                made[material] = default_surface() if material is None else own_copy(material)
            material = made[material]
        mesh.materials[i] = material


def _slots_of_object(ob: bpy.types.Object) -> bool:
    return any(slot.link == "OBJECT" for slot in ob.material_slots)


def _positions(mesh: bpy.types.Mesh) -> np.ndarray:
    return _values(mesh, "position", "vector", len(mesh.vertices) * 3, np.float32)


def _values(mesh: bpy.types.Mesh, attribute: str, key: str, number: int, kind: type) -> np.ndarray:
    """Values of an attribute that Blender itself keeps: twenty times as fast as by way of vertices and loops."""
    values = np.empty(number, dtype=kind)
    if number:
        mesh.attributes[attribute].data.foreach_get(key, values)
    return values


def _attributes(mesh: bpy.types.Mesh) -> bytes:
    """A digest of texture coordinates, colours and material slots."""
    digest = hashlib.blake2b(digest_size=16)
    layers = [(layer.uv, "vector", 2) for layer in mesh.uv_layers]
    layers += [(layer.data, "color", 4) for layer in mesh.color_attributes]
    for data, name, width in layers:
        values = np.empty(len(data) * width, dtype=np.float32)
        data.foreach_get(name, values)
        digest.update(values.tobytes())
    slots = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", slots)
    digest.update(slots.tobytes() + repr([m.name_full if m else "" for m in mesh.materials]).encode())
    return digest.digest()


def _topology(mesh: bpy.types.Mesh) -> bytes:
    """A digest of which vertices make which faces."""
    corners = _values(mesh, ".corner_vert", "value", len(mesh.loops), np.int32)
    starts = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    digest = hashlib.blake2b(corners.tobytes() + starts.tobytes(), digest_size=16)
    digest.update(str(len(mesh.vertices)).encode())
    return digest.digest()


def _content(ob: bpy.types.Object) -> bytes:
    """A digest of a mesh and its materials: equal ones are stored once."""
    mesh = ob.data
    digest = hashlib.blake2b(_topology(mesh) + _positions(mesh).tobytes(), digest_size=16)
    names = [slot.material.name_full if slot.material else "" for slot in ob.material_slots]
    names += [m.name_full if m else "" for m in mesh.materials]
    digest.update(repr(names).encode())
    # Shared data is the same in what is not looked at here (UV maps, colours, creases); different data may differ.
    digest.update(ob.original.data.name_full.encode() if ob.original.data else b"")
    return digest.digest()
