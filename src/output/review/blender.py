"""Loads the sequence into Blender's compositor, with the class of each pixel laid over the beauty.

    blender --python blender.py

or open it in the Scripting workspace and run it. The scene's size, pixel aspect, rate and range become the
sequence's; one that begins below 0 is shown from frame 1 on. Tried with Blender 5.0.
"""

import os
from pathlib import Path

import bpy

SEQUENCE = {}


def compositor_tree(scene):
    """The scene's compositing nodes, made if there are none. They became a node group in Blender 5.0."""
    if not hasattr(scene, "compositing_node_group"):
        scene.use_nodes = True
        return scene.node_tree
    if scene.compositing_node_group is None:
        tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
    return scene.compositing_node_group


def new_node(tree, place, *kinds):
    """A node of the first kind that this Blender knows: many were renamed in 5.0."""
    known = next(kind for kind in kinds if hasattr(bpy.types, kind))
    node = tree.nodes.new(known)
    node.location = place
    return node


def socket(sockets, *names):
    """The socket of one of these names."""
    return next(s for name in names for s in sockets if s.name == name and s.enabled)


def linear(byte):
    """An sRGB byte as linear light."""
    v = byte / 255
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


def file_name(number):
    """The name of a frame's file."""
    prefix, digits, suffix = SEQUENCE["name"]
    return f"{prefix}{number:0{digits}}{suffix}"


def shown_range():
    """First and last frame in the scene: neither it nor a sequence can begin below 0 in Blender."""
    first, last = SEQUENCE["first"], SEQUENCE["last"]
    return (first, last) if first >= 0 else (1, last - first + 1)


def counted_from_1(folder):
    """A folder of links to the files, numbered by the scene's frames: Blender takes a minus sign for a part of the name."""
    links = Path(__file__).resolve().parent / "from_1"
    links.mkdir(exist_ok=True)
    for number in range(SEQUENCE["first"], SEQUENCE["last"] + 1):
        file, link = folder / file_name(number), links / f"{number - SEQUENCE['first'] + 1:06}.exr"
        link.unlink(missing_ok=True)
        if not file.exists():
            continue
        try:
            link.symlink_to(os.path.relpath(file, links))
        except (OSError, ValueError):
            # Windows keeps symbolic links for administrators.
            link.hardlink_to(file)
    print(f"Blender knows no files below 0: frame {SEQUENCE['first']} is shown as frame 1, by way of {links}")
    return links


def load_image(tree):
    """The sequence, with a socket for each layer."""
    folder = (Path(__file__).resolve().parent / SEQUENCE["folder"]).resolve()
    first, last = shown_range()
    file = folder / file_name(first) if first == SEQUENCE["first"] else counted_from_1(folder) / "000001.exr"
    node = new_node(tree, (-600, 0), "CompositorNodeImage")
    node.label = SEQUENCE["title"]
    node.image = bpy.data.images.load(str(file), check_existing=True)
    node.image.source = "SEQUENCE"
    node.image.reload()
    # Blender shows file number frame - frame_start + 1 + frame_offset.
    node.frame_start, node.frame_duration, node.frame_offset = first, last - first + 1, first - 1
    node.use_auto_refresh = True
    return node


def class_colors(tree, classes):
    """The class of each pixel in its colour."""
    colors = SEQUENCE["class_colors"]
    scale = new_node(tree, (-350, -250), "ShaderNodeMath", "CompositorNodeMath")
    scale.operation = "MULTIPLY_ADD"
    # Each class falls into the middle of its step of the ramp.
    scale.inputs[1].default_value, scale.inputs[2].default_value = 1 / len(colors), 0.5 / len(colors)
    ramp = new_node(tree, (-150, -250), "ShaderNodeValToRGB", "CompositorNodeValToRGB")
    ramp.label = "Pixel classes"
    ramp.color_ramp.interpolation = "CONSTANT"
    elements = ramp.color_ramp.elements
    while len(elements) < len(colors):
        elements.new(1.0)
    for i, color in enumerate(colors):
        elements[i].position = i / len(colors)
        elements[i].color = (*map(linear, color), 1.0)
    tree.links.new(classes, scale.inputs[0])
    tree.links.new(scale.outputs[0], ramp.inputs[0])
    return socket(ramp.outputs, "Color", "Image")


def in_place(tree, shown):
    """A crop at its place in the image. Blender puts it into the middle, on the whole pixel to the lower left."""
    (width, height), (x, y, columns, rows) = SEQUENCE["size"], SEQUENCE["window"]
    if (columns, rows) == (width, height):
        return shown
    node = new_node(tree, (350, 0), "CompositorNodeTranslate")
    node.label = "Place of the crop"
    node.inputs["X"].default_value = x - (width - columns) // 2
    node.inputs["Y"].default_value = height - y - rows - (height - rows) // 2
    tree.links.new(shown, node.inputs["Image"])
    return node.outputs["Image"]


def main():
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = shown_range()
    scene.render.resolution_x, scene.render.resolution_y = SEQUENCE["size"]
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = SEQUENCE["pixel_aspect"]
    numerator, denominator = SEQUENCE["fps"]
    scene.render.fps = round(numerator / denominator)
    scene.render.fps_base = scene.render.fps * denominator / numerator
    tree = compositor_tree(scene)
    tree.nodes.clear()
    image = load_image(tree)
    shown = socket(image.outputs, "Combined", "Image")
    classes = next((s for s in image.outputs if s.name == "pixelClass"), None)
    if classes is not None:
        mix = new_node(tree, (150, 0), "ShaderNodeMix", "CompositorNodeMixRGB")
        mix.label = "Class overlay"
        if hasattr(mix, "data_type"):
            mix.data_type = "RGBA"
        colors = [s for s in mix.inputs if s.type == "RGBA"]
        socket(mix.inputs, "Factor", "Fac").default_value = 0.5
        tree.links.new(shown, colors[0])
        tree.links.new(class_colors(tree, classes), colors[1])
        shown = next(s for s in mix.outputs if s.type == "RGBA")
    shown = in_place(tree, shown)
    for kinds in (("NodeGroupOutput", "CompositorNodeComposite"), ("CompositorNodeViewer",)):
        kinds = kinds if hasattr(scene, "compositing_node_group") else kinds[-1:]
        tree.links.new(shown, new_node(tree, (550, -150 if kinds[-1] == "CompositorNodeViewer" else 0), *kinds).inputs[0])


main()
