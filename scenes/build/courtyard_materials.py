"""The materials of courtyard."""

import numpy as np

from texture import courses, mix, noise, normal_map, ramp, smoothstep


def make_materials(scene):
    """Every material, by name."""
    return {**masonry(scene), **plaster(scene), **stone_and_clay(scene), **wood_and_metal(scene), **living(scene)}


def masonry(scene):
    """Paving and brick: stones with a tone each and joints that lie lower."""
    edge, tone = courses(512, 7, 5, seed=11, jitter=0.7)
    grain = noise(512, 8, seed=12, octaves=5)
    stone = smoothstep(0.001, 0.006, edge)
    colour = ramp(0.65 * tone + 0.35 * grain, (0.47, 0.42, 0.35), (0.63, 0.56, 0.46), (0.74, 0.66, 0.54))
    colour = mix(np.full_like(colour, 0.27) * [1.0, 0.98, 0.85], colour, stone) * (0.84 + 0.32 * grain[..., None])
    relief = 0.7 * smoothstep(0.0, 0.012, edge) + 0.35 * grain + 0.15 * tone
    # Worn stones are smoother than the joints between them.
    rough = np.stack([np.zeros_like(edge), 0.95 - 0.45 * stone * (0.5 + 0.5 * tone), np.zeros_like(edge)], axis=-1)
    paving = scene.material(
        "Paving",
        roughness=1.0,
        texture=scene.texture("paving", colour),
        normal=scene.texture("paving_normal", normal_map(relief, 6.0)),
        metallic_roughness=scene.texture("paving_roughness", rough[::2, ::2], step=8),
    )

    edge, tone = courses(512, 16, 6, seed=21, jitter=0.12)
    grain = noise(512, 16, seed=22, octaves=4)
    face = smoothstep(0.002, 0.009, edge)
    colour = ramp(0.75 * tone + 0.25 * grain, (0.50, 0.27, 0.20), (0.68, 0.40, 0.29), (0.80, 0.55, 0.40))
    colour = mix(np.ones_like(colour) * [0.66, 0.61, 0.53], colour, face) * (0.8 + 0.4 * grain[..., None])
    brick = scene.material(
        "Brick",
        roughness=0.9,
        texture=scene.texture("brick", colour),
        normal=scene.texture("brick_normal", normal_map(0.8 * smoothstep(0, 0.012, edge) + 0.3 * grain, 4.0)),
    )
    return {"paving": paving, "brick": brick}


def plaster(scene):
    """One rough plaster in three colours."""
    stains, grain = noise(256, 3, seed=31, octaves=5), noise(256, 32, seed=35, octaves=3)
    colour = ramp(stains, (0.78, 0.58, 0.33), (0.89, 0.72, 0.46), (0.94, 0.81, 0.58)) * (0.93 + 0.14 * grain[..., None])
    maps = {"texture": scene.texture("plaster", colour)}
    maps["normal"] = scene.texture("plaster_normal", normal_map(grain, 1.6))
    return {
        "plaster": scene.material("Ochre plaster", roughness=0.95, **maps),
        "pale": scene.material("Pale plaster", colour=(0.95, 1.0, 0.96), roughness=0.95, **maps),
        "rose": scene.material("Rose plaster", colour=(1.0, 0.72, 0.62), roughness=0.95, **maps),
    }


def stone_and_clay(scene):
    """Limestone, roof tiles and pots, soil, water."""
    veins = noise(256, 4, seed=41, octaves=6)
    pale = scene.texture("limestone", ramp(veins, (0.66, 0.62, 0.54), (0.84, 0.80, 0.72), (0.93, 0.90, 0.83)))
    spots = noise(256, 6, seed=51, octaves=5)
    clay = scene.texture("terracotta", ramp(spots, (0.47, 0.21, 0.13), (0.70, 0.36, 0.22), (0.83, 0.53, 0.35)))
    swell = sum(noise(256, cells, seed=60 + cells, octaves=3) / cells for cells in (4, 9))
    ripples = scene.texture("ripples_normal", normal_map(swell, 22.0))
    return {
        "limestone": scene.material("Limestone", texture=pale, roughness=0.7),
        "terracotta": scene.material("Terracotta", texture=clay, roughness=0.8),
        "tiles": scene.material("Roof tiles", colour=(1.0, 0.92, 0.9), texture=clay, roughness=0.75),
        "soil": scene.material("Soil", colour=(0.06, 0.04, 0.03), roughness=1.0),
        "water": scene.material(
            "Water", colour=(0.015, 0.05, 0.055), roughness=0.03, ior=1.33, normal=ripples, normal_scale=0.35
        ),
    }


def wood_and_metal(scene):
    """Doors, shutters, iron, brass, window glass and lamp bulbs."""
    # Four planks side by side, their fibres upright.
    fibre = np.repeat(noise(256, 24, seed=71, octaves=3)[::8], 8, axis=0)
    colour = ramp(fibre, (0.33, 0.20, 0.11), (0.51, 0.34, 0.20), (0.63, 0.45, 0.28))
    from_middle = np.abs(np.arange(256) / 64 % 1 - 0.5)
    wood = scene.texture("wood", colour * (0.35 + 0.65 * smoothstep(0.5, 0.46, from_middle))[None, :, None])
    return {
        "wood": scene.material("Wood", texture=wood, roughness=0.6),
        "green wood": scene.material("Green wood", colour=(0.35, 0.85, 0.75), texture=wood, roughness=0.45),
        "white wood": scene.material("White wood", colour=(0.85, 0.83, 0.78), roughness=0.5),
        "iron": scene.material("Iron", colour=(0.10, 0.10, 0.11), metallic=1.0, roughness=0.45),
        "brass": scene.material("Brass", colour=(0.91, 0.70, 0.36), metallic=1.0, roughness=0.15),
        "glass": scene.material("Window glass", colour=(0.03, 0.05, 0.07), roughness=0.02),
        "bulb": scene.material("Bulb", colour=(1, 0.8, 0.5), emissive=(1.0, 0.72, 0.38), strength=9.0),
    }


def living(scene):
    """Leaves cut out of a card by their alpha, in two greens, and flowers."""
    leaf = scene.texture("leaves", leaf_card(128))
    options = {"texture": leaf, "roughness": 0.6, "alpha_cutoff": 0.5, "double_sided": True}
    return {
        "leaves": scene.material("Leaves", **options),
        "dark leaves": scene.material("Dark leaves", colour=(0.5, 0.72, 0.55), **options),
        "flowers": scene.material("Flowers", colour=(0.85, 0.10, 0.16), roughness=0.6),
        "lemons": scene.material("Lemons", colour=(0.95, 0.72, 0.08), roughness=0.4),
    }


def leaf_card(size):
    """A spray of pointed leaves on a card with alpha; the green runs on under the edges so that mips stay green."""
    y, x = np.mgrid[0:size, 0:size] / size * 2 - 1
    cover, shade = np.zeros((size, size)), np.zeros((size, size))
    for i in range(9):
        angle = 2.399963 * i
        along = (x - 0.15 * np.cos(angle)) * np.cos(angle) + (y - 0.15 * np.sin(angle)) * np.sin(angle)
        across = -x * np.sin(angle) + y * np.cos(angle)
        width = 0.17 * np.sqrt(np.clip(along * (0.75 - along), 0, None)) / 0.375
        leaf = np.abs(across) < width
        cover = np.where(leaf, 1.0, cover)
        shade = np.where(leaf, 0.25 + 0.08 * i - 0.25 * (np.abs(across) < 0.015), shade)
    colour = ramp(np.where(cover > 0, shade, 0.4), (0.10, 0.22, 0.05), (0.25, 0.43, 0.11), (0.47, 0.61, 0.21))
    return np.dstack([colour, cover])
