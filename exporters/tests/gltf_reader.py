"""A small, independent glTF reader for the tests: nodes, cameras and lights at a frame, as docs/extras.md says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from exporters.common.document import Document

_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TYPES = {5126: np.float32, 5121: np.uint8, 5123: np.uint16, 5125: np.uint32}


class Gltf:
    """A file and its animation."""

    def __init__(self, path: Path, lost=None) -> None:
        self.path = path
        document = Document.load(path)
        self.root, self._binary = document.root, bytes(document.binary)
        self.lost = lost
        self.buzz: dict[str, Any] = self.root["scenes"][0]["extras"]["buzz"]
        self._parents = {c: i for i, n in enumerate(self.root.get("nodes", [])) for c in n.get("children", [])}
        self._channels: dict[tuple, tuple] = {}
        for animation in self.root.get("animations", []):
            for channel in animation["channels"]:
                sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
                extension = target.get("extensions", {}).get("KHR_animation_pointer")
                key = extension["pointer"] if extension else (target["node"], target["path"])
                data = self.accessor(sampler["input"]), self.accessor(sampler["output"]), sampler.get("interpolation", "LINEAR")
                self._channels[key] = data

    def accessor(self, index: int) -> np.ndarray:
        """An accessor's values."""
        a = self.root["accessors"][index]
        view = self.root["bufferViews"][a["bufferView"]]
        width = _WIDTH[a["type"]]
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        dtype = np.dtype(_TYPES[a["componentType"]])
        stride = view.get("byteStride", dtype.itemsize * width)
        rows = np.ndarray((a["count"], width), dtype, self._binary, start, (stride, dtype.itemsize))
        return rows.reshape(-1) if width == 1 else rows.copy()

    def lost_features(self, name: str) -> list[str]:
        """What was said to be lost of an object."""
        return [i["feature"] for i in self.lost.items if i["object"] == name]

    def animated(self, key) -> bool:
        """Whether a node path (index, path) or a pointer has a channel."""
        return key in self._channels

    def keys(self, key) -> np.ndarray:
        """The key times of a channel."""
        return self._channels[key][0]

    def time(self, frame: float) -> float:
        """Seconds of a frame."""
        n, d = self.buzz["fps"]
        return (frame - self.buzz["frame_start"]) * d / n

    def value(self, key, frame: float, default):
        """An animated value at a frame, snapped to keys, or the default."""
        if key not in self._channels:
            return np.array(default, dtype=float)
        times, values, interpolation = self._channels[key]
        values = values.reshape(len(times), -1).astype(float)
        t = self.time(frame)
        snap = 1e-3 * self.buzz["fps"][1] / self.buzz["fps"][0]
        after = int(np.searchsorted(times, t + snap, side="right"))
        k = max(after - 1, 0)
        if abs(times[k] - t) <= snap or k == len(times) - 1 or interpolation == "STEP" or t < times[0]:
            out = values[k]
        else:
            s = (t - times[k]) / (times[k + 1] - times[k])
            out = values[k] * (1 - s) + values[k + 1] * s
        if key[1] == "rotation":
            out = out / np.linalg.norm(out)
        return out if np.ndim(default) else float(out[0])

    def node(self, name: str) -> int:
        """The number of the only node with a name."""
        found = [i for i, n in enumerate(self.root["nodes"]) if n.get("name") == name]
        assert len(found) == 1, f"{len(found)} nodes are called {name}"
        return found[0]

    def world(self, node: int, frame: float) -> np.ndarray:
        """World matrix of a node."""
        data = self.root["nodes"][node]
        m = np.eye(4)
        x, y, z, w = self.value((node, "rotation"), frame, data.get("rotation", [0, 0, 0, 1]))
        m[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        m[:3, :3] *= self.value((node, "scale"), frame, data.get("scale", [1, 1, 1]))
        m[:3, 3] = self.value((node, "translation"), frame, data.get("translation", [0, 0, 0]))
        return self.world(self._parents[node], frame) @ m if node in self._parents else m

    def visible(self, node: int, frame: float) -> bool:
        """KHR_node_visibility of a node."""
        static = self.root["nodes"][node].get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True)
        return bool(self.value(f"/nodes/{node}/extensions/KHR_node_visibility/visible", frame, float(static)))

    def light(self, name: str) -> tuple[int, dict]:
        """Index and data of the light on a node."""
        index = self.root["nodes"][self.node(name)]["extensions"]["KHR_lights_punctual"]["light"]
        return index, self.root["extensions"]["KHR_lights_punctual"]["lights"][index]

    def light_value(self, name: str, path: str, frame: float, default):
        """An animated property of a light."""
        return self.value(f"/extensions/KHR_lights_punctual/lights/{self.light(name)[0]}/{path}", frame, default)

    def camera_at(self, frame: int) -> int:
        """The node seen through at a frame."""
        cuts = [c for c in self.buzz["cuts"] if c["frame"] <= frame]
        return (cuts[-1] if cuts else self.buzz["cuts"][0])["node"]

    def clip_from_camera(self, node: int, frame: float) -> np.ndarray:
        """The OpenGL projection matrix of a node's camera."""
        index = self.root["nodes"][node]["camera"]
        camera = self.root["cameras"][index]
        kind = camera["type"]
        width, height = self.buzz["resolution"]
        aspect = width * self.buzz["pixel_aspect"] / height

        def get(key: str) -> float:
            return self.value(f"/cameras/{index}/{kind}/{key}", frame, float(camera[kind][key]))

        sx, sy = self.value(f"/cameras/{index}/extras/shift", frame, camera["extras"].get("shift", [0, 0]))
        near, far = get("znear"), get("zfar")
        p = np.zeros((4, 4))
        if kind == "perspective":
            p[1, 1] = 1 / math.tan(get("yfov") / 2)
            p[0, 0] = p[1, 1] / aspect
            p[0, 2], p[1, 2], p[3, 2] = sx, sy, -1
            p[2, 2], p[2, 3] = (far + near) / (near - far), 2 * far * near / (near - far)
        else:
            p[0, 0], p[1, 1] = 1 / get("xmag"), 1 / get("ymag")
            p[0, 3], p[1, 3], p[3, 3] = -sx, -sy, 1
            p[2, 2], p[2, 3] = 2 / (near - far), (far + near) / (near - far)
        return p

    def triangles(self, node: int) -> np.ndarray:
        """Local positions of a node's triangles, (n, 3, 3), all primitives together."""
        out = []
        for primitive in self.root["meshes"][self.root["nodes"][node]["mesh"]]["primitives"]:
            points = self.accessor(primitive["attributes"]["POSITION"])
            out.append(points[self.accessor(primitive["indices"])].reshape(-1, 3, 3))
        return np.concatenate(out)

    def posed_points(self, node: int, frame: float) -> np.ndarray:
        """Local vertices of a node's first primitive with its morph weights at a frame."""
        data = self.root["nodes"][node]
        mesh = self.root["meshes"][data["mesh"]]
        primitive = mesh["primitives"][0]
        points = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
        times, values, _ = self._channels[(node, "weights")]
        count = len(mesh["weights"])
        rows = values.reshape(len(times), count)
        t = self.time(frame)
        for k, target in enumerate(primitive["targets"]):
            points = points + np.interp(t, times, rows[:, k]) * self.accessor(target["POSITION"])
        return points


def primitive(gltf, name, number=0):
    """A primitive of the mesh on a node, and its arrays."""
    data = gltf.root["meshes"][gltf.root["nodes"][gltf.node(name)]["mesh"]]["primitives"][number]
    return data, {k: gltf.accessor(i) for k, i in data["attributes"].items()}
