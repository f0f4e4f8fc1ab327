"""Writing a scene as .gltf with a .bin and PNG files beside it."""

import json
from pathlib import Path

import numpy as np

from texture import encode_png

#: Lumens a watt. glTF lights are photometric; Buzz, as Blender does, divides by this to get watts.
LUMENS_PER_WATT = 683.0

FLOAT, USHORT, UINT = 5126, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


class Scene:
    """A glTF document being put together; `write` saves it."""

    def __init__(self, name):
        self.name = name
        self.binary = bytearray()
        self.images = {}
        self.stored = {}
        self.lights = []
        self.shapes = []
        self.frames = 0
        self.document = {
            "asset": {"version": "2.0", "generator": f"Buzz scenes/build/{name.replace('-', '_')}.py"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": []}],
        }

    def _add(self, kind, item):
        items = self.document.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def _require(self, extension):
        used = self.document.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)
            used.sort()

    # ---- images and materials

    def picture(self, name, image, step=4):
        """Adds the file textures/<name>.png; returns its URI."""
        uri = f"textures/{name}.png"
        self.images[uri] = encode_png(image, step)
        return uri

    def texture(self, name, image, step=4):
        """Adds a picture as a repeating, mip-mapped texture; returns its index."""
        uri = self.picture(name, image, step)
        if "samplers" not in self.document:
            linear_mipmap, linear, repeat = 9987, 9729, 10497
            self._add(
                "samplers",
                {"magFilter": linear, "minFilter": linear_mipmap, "wrapS": repeat, "wrapT": repeat},
            )
        source = self._add("images", {"name": name, "uri": uri})
        return self._add("textures", {"sampler": 0, "source": source})

    def material(self, name, colour=(1, 1, 1), metallic=0.0, roughness=0.5, **options):
        """Adds a material; returns its index.

        Options: `texture`, `normal`, `metallic_roughness` (texture indices), `normal_scale`, `emissive` and
        `strength`, `alpha_cutoff`, `double_sided`, `ior`, `transmission`, `attenuation` (colour, distance), `unlit`.
        """
        pbr = {
            "baseColorFactor": [*map(float, colour), 1.0],
            "metallicFactor": float(metallic),
            "roughnessFactor": float(roughness),
        }
        material = {"name": name, "pbrMetallicRoughness": pbr}
        if "texture" in options:
            pbr["baseColorTexture"] = {"index": options["texture"]}
        if "metallic_roughness" in options:
            pbr["metallicRoughnessTexture"] = {"index": options["metallic_roughness"]}
        if "normal" in options:
            material["normalTexture"] = {"index": options["normal"], "scale": options.get("normal_scale", 1.0)}
        if "emissive" in options:
            material["emissiveFactor"] = [float(c) for c in options["emissive"]]
        if "alpha_cutoff" in options:
            material |= {"alphaMode": "MASK", "alphaCutoff": options["alpha_cutoff"]}
        if options.get("double_sided"):
            material["doubleSided"] = True
        extensions = self._material_extensions(options)
        if extensions:
            material["extensions"] = extensions
        return self._add("materials", material)

    def _material_extensions(self, options):
        extensions = {}
        if "strength" in options:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": float(options["strength"])}
        if "ior" in options:
            extensions["KHR_materials_ior"] = {"ior": float(options["ior"])}
        if "transmission" in options:
            extensions["KHR_materials_transmission"] = {"transmissionFactor": float(options["transmission"])}
        if "attenuation" in options:
            colour, distance = options["attenuation"]
            extensions["KHR_materials_volume"] = {
                "thicknessFactor": 1.0,
                "attenuationColor": [float(c) for c in colour],
                "attenuationDistance": float(distance),
            }
        if options.get("unlit"):
            extensions["KHR_materials_unlit"] = {}
        for extension in extensions:
            self._require(extension)
        return extensions

    # ---- geometry

    def mesh(self, name, *primitives):
        """Adds a mesh of (surface, material) pairs; returns its index."""
        return self._add("meshes", {"name": name, "primitives": [self._primitive(*p) for p in primitives]})

    def _primitive(self, surface, material):
        described = self.document["materials"][material]
        textured = "normalTexture" in described or any("Texture" in k for k in described["pbrMetallicRoughness"])
        layout = (textured, "normalTexture" in described)
        # A surface that wears several materials is stored once; it is kept here so that its id stays its own.
        key = (id(surface), layout)
        if key not in self.stored:
            self.stored[key] = (surface, self._geometry(surface, *layout))
        return {**self.stored[key][1], "material": material}

    def _geometry(self, surface, textured, bumpy):
        attributes = {
            "POSITION": self._accessor(surface.positions, "VEC3", FLOAT, ARRAY_BUFFER, bounds=True),
            "NORMAL": self._accessor(surface.normals, "VEC3", FLOAT, ARRAY_BUFFER),
        }
        if textured:
            attributes["TEXCOORD_0"] = self._accessor(surface.uvs, "VEC2", FLOAT, ARRAY_BUFFER)
        if bumpy:
            attributes["TANGENT"] = self._accessor(surface.tangents(), "VEC4", FLOAT, ARRAY_BUFFER)
        index_type = USHORT if len(surface.positions) < 65535 else UINT
        indices = self._accessor(surface.triangles.reshape(-1), "SCALAR", index_type, ELEMENT_ARRAY_BUFFER)
        return {"attributes": attributes, "indices": indices}

    def _accessor(self, values, kind, component, target=None, bounds=False):
        dtype = {FLOAT: "<f4", USHORT: "<u2", UINT: "<u4"}[component]
        # Processors differ in the last bit of a sine; rounding keeps that out of the files.
        values = np.ascontiguousarray(np.round(values, 7), dtype)
        self.binary.extend(b"\0" * (-len(self.binary) % 4))
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes}
        if target:
            view["target"] = target
        self.binary.extend(values.tobytes())
        accessor = {
            "bufferView": self._add("bufferViews", view),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            table = values.reshape(len(values), -1)
            accessor |= {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        return self._add("accessors", accessor)

    def shape(self, described):
        """Adds an analytic shape, as KHR_implicit_shapes describes it; returns its index."""
        self.shapes.append(described)
        return len(self.shapes) - 1

    def shape_binding(self, shape, material):
        """What binds a shape to a node, beside the mesh that stands for it elsewhere: the node's `extensions`."""
        self._require("KHR_implicit_shapes")
        self._require("BUZZ_analytic_shape")
        return {"BUZZ_analytic_shape": {"shape": shape, "material": material}}

    def skin(self, mesh, joints, inverse_binds, indices, weights):
        """Binds the only primitive of `mesh` to nodes, four joints and weights a vertex; returns the index."""
        (primitive,) = self.document["meshes"][mesh]["primitives"]
        primitive["attributes"] = {
            **primitive["attributes"],
            "JOINTS_0": self._accessor(indices, "VEC4", USHORT, ARRAY_BUFFER),
            "WEIGHTS_0": self._accessor(weights, "VEC4", FLOAT, ARRAY_BUFFER),
        }
        # Matrices are stored by columns.
        columns = np.transpose(inverse_binds, (0, 2, 1)).reshape(len(joints), 16)
        binds = self._accessor(columns, "MAT4", FLOAT)
        return self._add("skins", {"joints": list(joints), "inverseBindMatrices": binds})

    def morph(self, mesh, *targets):
        """Gives the only primitive of `mesh` morph targets: surfaces of the same triangles."""
        (primitive,) = self.document["meshes"][mesh]["primitives"]
        position, normal = (primitive["attributes"][name] for name in ("POSITION", "NORMAL"))
        primitive["targets"] = [
            {
                "POSITION": self._accessor(target.positions - self._values(position), "VEC3", FLOAT, bounds=True),
                "NORMAL": self._accessor(target.normals - self._values(normal), "VEC3", FLOAT),
            }
            for target in targets
        ]
        self.document["meshes"][mesh]["weights"] = [0.0] * len(targets)

    def _values(self, accessor):
        """What has been stored of a VEC3 of floats."""
        described = self.document["accessors"][accessor]
        start = self.document["bufferViews"][described["bufferView"]]["byteOffset"]
        return np.frombuffer(bytes(self.binary), "<f4", described["count"] * 3, start).reshape(-1, 3)

    # ---- nodes

    def node(self, name, translation=(0, 0, 0), turn=0.0, rotation=None, scale=(1, 1, 1), parent=None, **links):
        """Adds a node, turned about Y by degrees or by a quaternion; `links` are mesh=, camera= ..."""
        node = {"name": name, **links}
        if any(translation):
            node["translation"] = _tidy(translation)
        if turn:
            half = np.radians(turn) / 2
            rotation = (0, np.sin(half), 0, np.cos(half))
        if rotation is not None:
            node["rotation"] = _tidy(rotation)
        if any(s != 1 for s in scale):
            node["scale"] = _tidy(scale)
        index = self._add("nodes", node)
        siblings = self.document["scenes"][0]["nodes"]
        if parent is not None:
            siblings = self.document["nodes"][parent].setdefault("children", [])
        siblings.append(index)
        return index

    def sun(self, name, direction, watts_per_m2, colour=(1, 1, 1), angle=0.0):
        """Adds a directional light that shines along `direction` and fills `angle` radians of the sky."""
        light = {"type": "directional", "intensity": LUMENS_PER_WATT * watts_per_m2, **_size("angle", angle)}
        return self._light(name, light, colour, rotation=_turn_minus_z_to(direction))

    def lamp(self, name, position, watts, colour=(1, 1, 1), radius=0.0, parent=None):
        """Adds a point light of so many watts, as Blender counts them; with a radius, a sphere."""
        light = {"type": "point", "intensity": LUMENS_PER_WATT * watts / (4 * np.pi), **_size("radius", radius)}
        return self._light(name, light, colour, translation=position, parent=parent)

    def spot(self, name, position, direction, watts, cone, colour=(1, 1, 1), radius=0.0):
        """Adds a spot of so many watts, as Blender counts them, with inner and outer half-angles in degrees."""
        light = {
            "type": "spot",
            "intensity": LUMENS_PER_WATT * watts / (4 * np.pi),
            "spot": dict(zip(("innerConeAngle", "outerConeAngle"), _tidy(np.radians(cone)), strict=True)),
            **_size("radius", radius),
        }
        return self._light(name, light, colour, translation=position, rotation=_turn_minus_z_to(direction))

    def _light(self, name, light, colour, **placing):
        self._require("KHR_lights_punctual")
        light["intensity"] = round(light["intensity"], 3)
        self.lights.append({"name": name, "color": _tidy(colour), **light})
        link = {"KHR_lights_punctual": {"light": len(self.lights) - 1}}
        return self.node(name, extensions=link, **placing)

    # ---- camera and animation

    def shots(self, shots, yfov, fps, resolution, world):
        """Adds a camera for each shot, and `scene.extras.buzz` that cuts from one to the next.

        A shot is (camera name, positions, quaternions) with one LINEAR key a frame; the first begins at frame 0.
        """
        lens = {"yfov": round(float(yfov), 7), "znear": 0.05, "aspectRatio": resolution[0] / resolution[1]}
        samplers, channels, cuts = [], [], []
        for name, positions, rotations in shots:
            camera = self._add("cameras", {"type": "perspective", "name": name, "perspective": lens})
            node = self.node(name, translation=positions[0], rotation=rotations[0], camera=camera)
            cuts.append({"frame": self.frames, "camera": name, "node": node})
            times = (self.frames + np.arange(len(positions))) / fps
            keys = self._accessor(times, "SCALAR", FLOAT, bounds=True)
            for path, values in (("translation", positions), ("rotation", rotations)):
                output = self._accessor(values, f"VEC{len(values[0])}", FLOAT)
                channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
                samplers.append({"input": keys, "output": output, "interpolation": "LINEAR"})
            self.frames += len(positions)
        self._add("animations", {"name": "Camera moves", "samplers": samplers, "channels": channels})
        self.document["scenes"][0]["extras"] = {
            "buzz": {
                "version": 1,
                "generator": self.document["asset"]["generator"],
                "fps": [fps, 1],
                "frame_start": 0,
                "frame_end": self.frames - 1,
                "resolution": list(resolution),
                "cuts": cuts,
                "world": world,
            }
        }

    def animate(self, name, fps, tracks):
        """Adds an animation with one LINEAR key a frame.

        A track is (node, path, values), or for what is no node's (None, JSON pointer, values).
        """
        samplers, channels = [], []
        keys = self._accessor(np.arange(self.frames) / fps, "SCALAR", FLOAT, bounds=True)
        for node, path, values in tracks:
            values = np.asarray(values, float)
            # Weights are stored one by one, however many there are to a key.
            scalar = path == "weights" or values.ndim == 1
            kind = "SCALAR" if scalar else f"VEC{values.shape[1]}"
            output = self._accessor(values.reshape(-1) if scalar else values, kind, FLOAT)
            target = {"node": node, "path": path}
            if node is None:
                self._require("KHR_animation_pointer")
                target = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": path}}}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": keys, "output": output, "interpolation": "LINEAR"})
        self._add("animations", {"name": name, "samplers": samplers, "channels": channels})

    # ---- results

    def triangle_count(self):
        """Triangles drawn: those of each mesh times its nodes."""
        accessors, meshes = self.document["accessors"], self.document["meshes"]
        each = [sum(accessors[p["indices"]]["count"] // 3 for p in m["primitives"]) for m in meshes]
        return sum(each[node["mesh"]] for node in self.document["nodes"] if "mesh" in node)

    def files(self):
        """Every file of the scene: {path relative to its folder: bytes}."""
        document = dict(self.document)
        shared = {"KHR_implicit_shapes": ("shapes", self.shapes), "KHR_lights_punctual": ("lights", self.lights)}
        extensions = {name: {key: items} for name, (key, items) in shared.items() if items}
        if extensions:
            document["extensions"] = extensions
        document["buffers"] = [{"uri": f"{self.name}.bin", "byteLength": len(self.binary)}]
        text = json.dumps(document, indent=1) + "\n"
        return {f"{self.name}.gltf": text.encode(), f"{self.name}.bin": bytes(self.binary), **self.images}

    def write(self, folder):
        """Saves the scene in `folder`."""
        for path, data in self.files().items():
            target = Path(folder) / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)


def _tidy(numbers):
    """Plain numbers, rounded for the same reason as in `_accessor`."""
    return [round(float(n), 7) for n in numbers]


def _size(key, value):
    """A light's extras, where it has a size."""
    return {"extras": {key: value}} if value else {}


def _turn_minus_z_to(direction):
    """The quaternion of the shortest turn from -z to `direction`."""
    x, y, z = np.asarray(direction, float) / np.linalg.norm(direction)
    quaternion = np.array([y, -x, 0.0, 1.0 - z])
    return quaternion / np.linalg.norm(quaternion)
