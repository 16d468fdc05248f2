"""Draw figures of published papers again with fabrics of this package, for docs/papers.md.

make list && .venv/bin/python docs/pictures/papers.py      # some minutes; needs LLVM for Mitsuba
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import pyplot as plt

from jobs.verbs.render import shown_at
from pipeline.cores import cores
from pipeline.models.named import named_method
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import TruthAnswers, picture
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shade import coloured, colours_of
from pipeline.scenes.shipped import camera, developed, sheet, sun
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.images.tiles import displayed
from weaves.fabric import Fabric, load_fabric

HERE: Final = Path(__file__).parent / "papers"
SIDE: Final = 96  # pixels of a disc of directions
SIZE: Final = (360, 270)  # pixels of a picture of a scene
TRUTH: Final = TruthAnswers(TruthOptions(relative_error=0.02))
METHODS: Final = {"truth": TRUTH, "soft nodes, k = 2": named_method("soft_nodes:2", "papers", "method")}
PATCH: Final = 205 / 512 * 2 / 12**0.5
"""Standard deviation of a patch of 205 by 205 texels of 512 that show a repeat of two yarns, in yarn spacings."""


def disc(side: float) -> tuple[Any, Any]:
    """Return the directions of a picture of the projected disc, (P, 3), and which of its pixels they are."""
    y, x = (0.999 - 1.998 * (np.mgrid[:SIDE, :SIDE] + 0.5) / SIDE) * np.array([1.0, -1.0])[:, None, None]
    inside = x**2 + y**2 < 0.99
    level = np.stack([x, y], axis=-1)[inside]
    return np.column_stack([level, side * np.sqrt(1.0 - (level**2).sum(axis=1))]).astype(np.float32), inside


def answers(method: Any, fabric: Fabric, place: Sequence[float], sigma: float, wi: Any, wo: Any) -> tuple[Queries, Any]:
    """Return queries about one footprint, and their components; a direction for all may stand for many."""
    wi, wo = np.broadcast_arrays(np.float32(wi), np.float32(wo))
    u, v, size = (np.full(len(wi), value, np.float32) for value in (*place, sigma))
    queries = Queries.round(u, v, size, np.ascontiguousarray(wi), np.ascontiguousarray(wo))
    return queries, method.rows(fabric, queries, 1)[:, :4]


def tiles(
    path: str, rows: Sequence[str], columns: Sequence[str], shown: Callable[[int, int], Any], height: float
) -> None:
    """Write a table of pictures with titles; `shown` returns that of a row and a column, in grey or sRGB."""
    figure, axes = plt.subplots(
        len(rows),
        len(columns),
        figsize=(2.2 * len(columns), height * len(rows) + 0.3),
        squeeze=False,
        layout="compressed",
    )
    for row, name in enumerate(rows):
        for column, title in enumerate(columns):
            axis = axes[row, column]
            axis.imshow(shown(row, column), cmap="gray", vmin=0.0, vmax=1.0)
            axis.set(xticks=[], yticks=[], frame_on=False, title="" if row else title)
            axis.title.set_fontsize(8)
            if not column:
                axis.set_ylabel(name, fontsize=8)
    HERE.mkdir(exist_ok=True)
    figure.savefig(HERE / path, dpi=110, pil_kwargs={"quality": 88})
    plt.close(figure)


def components_over_directions() -> None:
    """Components of a plain weave, in unit colour, over viewers, light at 30 degrees [Chen2024Woven]."""
    fabric, (wo, inside) = load_fabric("polyester_lining"), disc(1.0)
    wi = [np.sin(np.pi / 6), 0.0, np.cos(np.pi / 6)]
    found = [answers(method, fabric, (0.5, 0.5), PATCH, [wi] * len(wo), wo)[1] for method in METHODS.values()]

    def shown(row: int, column: int) -> Any:
        plane = np.full(inside.shape, np.nan)
        plane[inside] = found[row][:, column] / found[0][:, column].max()
        return plane

    tiles("components.jpg", list(METHODS), [name.replace("_", " ") for name in COMPONENTS], shown, 2.1)


def points_of_sheer_cloth() -> None:
    """Light from all around at three points of sheer cloth, in front of it and behind it [Chen2024Woven, Fig. 5]."""
    fabric, places = load_fabric("voile"), {"a warp": (0.5, 0.5), "a weft": (1.5, 0.5), "a gap": (1.0, 1.0)}
    columns = [(name, side) for name in METHODS for side in (1.0, -1.0)]
    wo = [np.sin(np.pi / 6), 0.0, np.cos(np.pi / 6)]

    def shown(row: int, column: int) -> Any:
        name, side = columns[column]
        wi, inside = disc(side)
        queries, found = answers(METHODS[name], fabric, list(places.values())[row], 0.15, wi, [wo] * len(wi))
        plane = np.ones((*inside.shape, 3))
        plane[inside] = displayed(coloured(found, colours_of(fabric, queries))[None] * np.pi, "srgb", 0.3)[0] / 255.0
        return plane

    titles = [f"{name}, {'front' if side > 0 else 'behind'}" for name, side in columns]
    tiles("sheer.jpg", list(places), titles, shown, 2.1)


def edge(mi: Any) -> dict[str, Any]:
    """Return cloth that hangs over the rounded edge of a table, seen along its top; a yarn is .01 wide."""
    turn, radius = np.linspace(0.0, np.pi / 2, 65), 0.08
    bend = radius * np.stack([1.0 - np.cos(turn), np.sin(turn) - 1.0], axis=-1)
    profile = np.concatenate([[[0.0, -0.5]], bend, [[radius + 1.0, 0.0]]])
    length, along = developed(profile)
    along[[0, 1, -2, -1]] = [[0, 1], [0, 1], [1, 0], [1, 0]]
    x = np.linspace(-1.0, 1.0, 3)[:, None]
    points, normal, uv = (
        np.stack(np.broadcast_arrays(*parts), axis=-1)
        for parts in ((x, profile[:, 0], profile[:, 1]), (0.0 * x, -along[:, 1], along[:, 0]), (x, length))
    )
    cloth = sheet(mi, "cloth", points, normal, uv)
    view = camera(mi, [0.0, -0.62, 0.035], [0.02, 1.0, -0.05], 9, SIZE)
    lights = {"sun": sun([-0.5, -0.5, 0.7], 3.0), "sky": {"type": "constant", "radiance": 0.3}}
    return {"type": "scene", "cloth": cloth, **lights, "camera": view}


def rendered(scene: Scene, **options: Any) -> Any:
    """Return a picture of a scene in sRGB."""
    loaded = load(scene, SceneOptions(environment_directions=16, **options))
    rgb = np.empty((*SIZE[::-1], 3), np.float32)
    with ThreadPoolExecutor(cores()) as pool:
        for part in picture(loaded, METHODS["soft nodes, k = 2"], pool, SIZE, side=3):
            rgb[shown_at(part)] = part.planes["rgb"]
    return displayed(rgb, "srgb", 0.0)


def curvature_along_the_ray() -> None:
    """Silhouettes by the curvature at a point, and by its minimum along the view ray [Kuznetsov2022Curved, Fig. 8]."""
    scene = Scene(name="edge", source=edge, cloths={"cloth": Cloth(fabric="cotton_twill", yarns=(100.0, 100.0))})
    kinds = {"none": "as flat cloth", "at_point": "curvature at the point", "minimum": "minimum along the ray"}
    pictures = [rendered(scene, curvature=kind) for kind in kinds]
    tiles("curvature.jpg", [""], list(kinds.values()), lambda row, column: pictures[column], 1.65)


def scaled_yarns() -> None:
    """Silhouettes of one surface whose yarns grow, so that it bends more a yarn [Kuznetsov2022Curved, Fig. 9]."""
    factors, roll, pictures = (1.0, 3.0, 9.0), load_scene("roll"), []
    ((key, cloth),) = roll.cloths.items()
    for factor in factors:
        wider = cloth.model_copy(update={"yarns": tuple(count / factor for count in cloth.yarns)})
        pictures.append(rendered(roll.model_copy(update={"cloths": {key: wider}})))
    tiles("scaled.jpg", [""], [f"yarns × {factor:g}" for factor in factors], lambda row, column: pictures[column], 1.65)


if __name__ == "__main__":
    components_over_directions()
    points_of_sheer_cloth()
    curvature_along_the_ray()
    scaled_yarns()
