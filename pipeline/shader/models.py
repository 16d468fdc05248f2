"""Models that can be exported as shaders, by name or folder."""

from __future__ import annotations

from collections.abc import Collection

from pipeline.models.neumip.model import Neumip
from pipeline.models.registry import covering_model
from pipeline.models.selvage.model import Selvage
from pipeline.shader import neumip, selvage, soft_nodes
from pipeline.shader.neumip import neumip_shader
from pipeline.shader.selvage import selvage_shader
from pipeline.shader.shader import Shader
from pipeline.shader.soft_nodes import soft_nodes_shader
from weaves.errors import BadInput
from weaves.fabric import Fabric


def shader_of(model: str | None, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return a model of a fabric, ready to be written.

    Parameters
    ----------
    model : str, optional
        `soft_nodes`, which is meant if it is left out, a model that comes with the package, or the folder of a trained
        `selvage` or `neumip`.
    fabric : Fabric
        The cloth.
    level : int, optional
        Level of detail of the soft nodes.
    kinds : collection of str
        Of KINDS.

    Raises
    ------
    BadInput
        If there is no such model, its files are damaged or of another version, it was not trained on the fabric, it has
        no shader, or has no such level or kinds.
    """
    if model is None or model == soft_nodes.NAME:
        return soft_nodes_shader(fabric, level, kinds)
    method = covering_model(model, fabric, "export", "--model")
    if isinstance(method, Selvage):
        return selvage_shader(method, fabric, level, kinds)
    if isinstance(method, Neumip):
        return neumip_shader(method, fabric, level, kinds)
    allowed = f"has no shader; {soft_nodes.NAME}, {selvage.NAME} and the folder of a trained {neumip.NAME} have one"
    raise BadInput("export", "--model", model, allowed)
