"""Patches by closed forms, and files by other programs (external)."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.bsdf.files import read_bsdf, write_xml
from pipeline.bsdf.klems import BASES, KLEMS_FULL, Scattering
from pipeline.bsdf.of_fabric import fabric_bsdf
from pipeline.bsdf.tensor_tree import Square
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.colour import LUMINANCE
from weaves.errors import BadInput
from weaves.fabric import load_fabric

FACTS = ("cloth", 0.05, 0.9, 1e-3)
QUARTER = BASES["LBNL/Klems Quarter"]


def lambertian(reflectance=0.6):
    shares = np.array([reflectance, 0.3])[:, None, None, None]
    return Scattering(KLEMS_FULL, {"visible": np.broadcast_to(shares / np.pi, (2, 2, 145, 145)).copy()})


@pytest.mark.parametrize(("basis", "patches"), [*zip(BASES.values(), (145, 73, 41), strict=True)])
def test_patches_fill_the_hemisphere_and_turn_with_their_labels(basis, patches):
    random = np.random.default_rng(1)
    assert basis.patches == patches and basis.projected_solid_angle.sum() == pytest.approx(np.pi, abs=1e-12)
    patch, u, v = np.arange(patches), random.random(patches), random.random(patches)
    label = basis.directions(patch, u, v)
    assert np.linalg.norm(label, axis=1) == pytest.approx(1.0) and (label[:, 2] >= 0.0).all()
    assert basis.directions(basis.opposite[1:], u[1:], v[1:]) == pytest.approx(label[1:] * [-1, -1, 1], abs=1e-12)
    # Exchanged azimuths: the same patch with v mirrored.
    there = basis.directions(basis.mirror[1:], u[1:], 1.0 - v[1:])
    assert there == pytest.approx(label[1:] * [-1, 1, 1], abs=1e-12)


def test_a_lambertian_layer_has_its_shares_and_is_reciprocal():
    layer = lambertian().checked("here")
    assert layer.hemispherical("visible")[0] == pytest.approx(0.6) and layer.reciprocity("visible").max() == 0.0
    assert layer.direct("visible") == pytest.approx(
        np.broadcast_to(0.3 * KLEMS_FULL.projected_solid_angle / np.pi, (2, 145))
    )
    layer.bands["visible"][1, 0, 3, 70] *= 1.5
    assert layer.reciprocity("visible")[2] > 0.0
    with pytest.raises(BadInput, match=r"visible = 1\.1: .* at most 1\.005"):
        lambertian(0.8).checked("here")


@pytest.fixture(scope="module")
def voile(coarse_truth):
    return fabric_bsdf(load_fabric("voile"), basis=QUARTER, points=1)


@pytest.mark.slow
def test_a_fabric_scatters_what_random_directions_find(voile):
    """Transmittance and reflectance for light from straight above, against 4,000 random viewers."""
    random, fabric, count = np.random.default_rng(3), load_fabric("voile"), 4000
    sine, azimuth = np.sqrt(random.random(count)), 2.0 * np.pi * random.random(count)
    square, turn = np.sin(np.radians(9.0)) ** 2 * random.random(count), 2.0 * np.pi * random.random(count)
    shares = voile.scattering.hemispherical("visible")[:, 0, 0] - [0.0, voile.direct[0]]
    for kind, sign in enumerate((1.0, -1.0)):
        wo = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), sign * np.sqrt(1.0 - sine**2)], axis=1)
        wi = np.stack([np.sqrt(square) * np.cos(turn), np.sqrt(square) * np.sin(turn), np.sqrt(1.0 - square)], axis=1)
        keep = np.abs(wo[:, 2]) > 0.02  # the truth has no lower views; they are 4e-4 of all
        queries = Queries.round(*np.zeros((2, count)), np.full(count, 32.0), wi, wo).take(keep)
        values = np.pi * shade(fabric, estimate(fabric, queries, TruthOptions(), 0).mean, queries) @ LUMINANCE
        values /= queries.wi[:, 2]
        error = values.std() / np.sqrt(count)
        # Both ways differ: the file has their mean.
        assert abs(values.mean() - shares[kind]) < 4.0 * error + 0.5 * voile.asymmetry * values.mean()


def test_a_fabric_is_reciprocal_and_lets_light_through_its_gaps(voile):
    assert voile.scattering.reciprocity("visible").max() < 1e-12
    gap = np.prod([1.0 - yarn.width for yarn in (load_fabric("voile").warp, load_fabric("voile").weft)])
    assert voile.direct[0] > 0.7 * gap and (voile.direct >= 0.0).all()
    assert voile.scattering.direct("visible")[0, 0] >= voile.direct[0]


@pytest.mark.external
@pytest.mark.parametrize("basis", [KLEMS_FULL, Square.of(3)])
def test_radiance_and_pywincalc_read_the_same_numbers(basis, tmp_path, monkeypatch):
    """`checkBSDF`, and `rtrace` without its jitter: a sun on either side, seen from either side, in random patches."""
    radiance, pywincalc = pytest.importorskip("pyradiance"), pytest.importorskip("pywincalc")
    monkeypatch.chdir(tmp_path)
    bsdf = fabric_bsdf(load_fabric("voile"), basis=basis, points=1)
    layer = bsdf.scattering
    write_xml(Path("layer.xml"), layer, *FACTS, bsdf.direct)
    home = Path(radiance.__file__).parent
    environment = os.environ | {"RAYPATH": f".:{home / 'lib'}"}

    def program(name, *arguments, text=True, **options):
        command = [str(home / "bin" / name), *arguments]
        return subprocess.run(command, env=environment, check=True, capture_output=True, text=text, **options).stdout

    if basis == KLEMS_FULL:
        hemisphere = pywincalc.BSDFHemisphere.create(pywincalc.BSDFBasisType.FULL)
        about = {"environment": pywincalc.nfrc_shgc_environments(), "bsdf_hemisphere": hemisphere}
        layers = [pywincalc.parse_bsdf_xml_file("layer.xml")]
        system = pywincalc.GlazingSystem(solid_layers=layers, width_meters=1, height_meters=1, **about)
        front = system.optical_method_results("PHOTOPIC").system_results.front
        shares = front.reflectance.direct_hemispherical, front.transmittance.direct_hemispherical
        assert shares == pytest.approx(layer.hemispherical("visible")[:, 0, 0], rel=1e-4)
    else:  # Radiance makes Klems patches of it by random samples, too few of them for light that goes straight through
        Path("klems.xml").write_text(program("bsdf2klems", "layer.xml"))
        converted, read = (read_bsdf(Path(name)).bands["visible"][0] for name in ("klems.xml", "layer.xml"))
        assert np.abs(converted - read).mean() < 0.002 * read.mean()
    errors = [line.split()[-1] for line in program("checkBSDF", "layer.xml").splitlines()[-3:]]
    assert [float(error) for error in errors] == [0.0, 0.0, 0.0]
    # Radiance sees the room from +z, so the fabric is turned around y.
    random, turned = np.random.default_rng(4), np.array([-1.0, 1.0, -1.0])
    middle = np.array([0.5])
    for kind, side in np.ndindex(2, 2):
        out, into = random.integers(1, int(0.8 * basis.patches), 2)
        lit, seen = (basis.directions(np.array([patch]), middle, middle)[0] for patch in (into, out))
        sun = lit * [-1.0, -1.0, 1 - 2 * side] * turned
        eye = seen * [1.0, 1.0, 1 - 2 * (side ^ kind)] * turned
        x, y, z = sun
        Path("scene.rad").write_text(
            f"void light l 0 0 3 1e6 1e6 1e6\nl source s 0 0 4 {x} {y} {z} .05\nvoid BSDF m 6 0 layer.xml 0 1 0 . 0 0\n"
            "m polygon p 0 0 12 -1 -1 0 1 -1 0 1 1 0 -1 1 0\n"
        )
        Path("scene.oct").write_bytes(program("oconv", "scene.rad", text=False))
        ray = " ".join(f"{number:.9g}" for number in (*(5.0 * eye), *-eye))
        radiance_seen = float(program("rtrace", "-h", "-w", "-ab", "0", "-ss", "0", "scene.oct", input=ray).split()[1])
        irradiance = 1e6 * 2.0 * np.pi * (1.0 - np.cos(np.radians(0.025))) * abs(z)
        assert radiance_seen / irradiance == pytest.approx(layer.bands["visible"][kind, side, out, into], rel=1e-3)
