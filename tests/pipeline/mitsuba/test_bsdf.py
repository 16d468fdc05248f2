import numpy as np
import pytest

from pipeline.mitsuba.bsdf import STRAIGHT_THROUGH
from pipeline.scenes.shade import shade
from pipeline.truth.query import Queries
from tests.directions import unit
from tests.pipeline.mitsuba.conftest import CONFIGURATIONS, NEEDS_LLVM, UV, hits_of, worn_of
from tests.presets import slow
from weaves.errors import BadInput
from weaves.fabric import load_fabric

LEVEL = 0.01


def interaction(mi, viewer, count=1):
    """Return places in local coordinates, as Mitsuba's own tests make them."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi, si.uv = viewer, UV
    si.sh_frame = mi.Frame3f([0, 0, 1])
    return si


def number(value):
    return np.asarray(value, np.float64).reshape(-1)


@pytest.mark.parametrize("name", [slow("front"), "gauze", "behind"])
def test_values_and_densities_are_those_of_the_cloth(mi, name):
    fabric, sigma, theta, phi = CONFIGURATIONS[name]
    bsdf = mi.load_dict({"type": "twillight", "fabric": fabric, "sigma": sigma})
    worn = worn_of(fabric, sigma)
    si, context = interaction(mi, unit(theta, phi).tolist()), mi.BSDFContext()
    hits = hits_of(unit(theta, phi))
    through = worn.transparency(hits)
    np.testing.assert_allclose(number(bsdf.eval_null_transmission(si)), np.repeat(through, 3), rtol=1e-5)
    assert name != "gauze" or 0.01 < through[0] < 0.9
    for light in (unit(40.0, 200.0).tolist(), unit(120.0, 30.0).tolist()):
        value, pdf = bsdf.eval_pdf(context, si, light)
        np.testing.assert_allclose(number(value), worn.eval(hits, np.array([light]))[0], rtol=1e-5)
        np.testing.assert_allclose(number(pdf), worn.pdf(hits, np.array([light])), rtol=1e-5)
        np.testing.assert_array_equal(number(bsdf.eval(context, si, light)), number(value))
        np.testing.assert_array_equal(number(bsdf.pdf(context, si, light)), number(pdf))


def test_all_bounces_are_added_to_the_values_and_leave_the_density(mi):
    """Light of the table, in front; the cosines of the mixture draw where it shines already."""
    fabric, sigma, theta, phi = CONFIGURATIONS["front"]
    properties = {"type": "twillight", "fabric": fabric, "sigma": sigma}
    one, every = mi.load_dict({**properties, "bounces": 1}), mi.load_dict(properties)
    viewer, light = unit(theta, phi), unit(40.0, 200.0)
    si, context = interaction(mi, viewer.tolist()), mi.BSDFContext()
    (before, pdf), (after, same) = (bsdf.eval_pdf(context, si, light.tolist()) for bsdf in (one, every))
    query = Queries.round([0.62], [0.57], [sigma], [light], [viewer])
    later = shade(load_fabric(fabric), np.zeros((1, 4)), query)[0]
    assert later.min() > 0.0 and later.max() > 1e-3
    np.testing.assert_allclose(number(after) - number(before), later, rtol=1e-3, atol=1e-6)
    np.testing.assert_array_equal(number(same), number(pdf))
    sample, weight = every.sample(context, si, 0.7, [0.3, 0.6])
    value, density = every.eval_pdf(context, si, number(sample.wo).tolist())
    np.testing.assert_allclose(number(weight), number(value) / number(density), rtol=1e-3)


def test_colours_are_edited_without_a_restart(mi, tmp_path):
    fabric, sigma, theta, phi = CONFIGURATIONS["front"]
    bsdf = mi.load_dict({"type": "twillight", "fabric": fabric, "sigma": sigma})
    parameters, cloth = mi.traverse(bsdf), load_fabric(fabric)
    assert {"warp_specular", "weft_diffuse", "weft_diffuse_transmission"} < set(parameters.keys())
    parameters["warp_diffuse"] = mi.Color3f(0.1, 0.3, 0.05)
    parameters.update()
    own = cloth.model_copy(update={"name": "own", "warp": cloth.warp.model_copy(update={"diffuse": (0.1, 0.3, 0.05)})})
    (tmp_path / "own.toml").write_text(own.to_toml(), encoding="utf-8")
    other = mi.load_dict({"type": "twillight", "fabric": str(tmp_path / "own.toml"), "sigma": sigma})
    si, context, light = interaction(mi, unit(theta, phi).tolist()), mi.BSDFContext(), unit(40.0, 200.0).tolist()
    edited, expected = (number(each.eval(context, si, light)) for each in (bsdf, other))
    np.testing.assert_allclose(edited, expected, rtol=1e-5)
    assert edited[1] > 1.5 * edited[2]
    parameters["warp_diffuse"] = mi.Color3f(1.0, 1.0, 1.0)
    with pytest.raises(BadInput, match="no yarn makes light"):
        parameters.update()


@pytest.mark.slow
def test_samples_name_their_lobe(mi):
    """Voile at numbers that reach each lobe; the gap's light goes straight on, and has its probability as density."""
    bsdf = mi.load_dict({"type": "twillight", "fabric": "voile", "sigma": 0.5})
    viewer = unit(25.0, 70.0).tolist()
    si, context = interaction(mi, viewer), mi.BSDFContext()
    worn, hits = worn_of("voile", 0.5), hits_of(viewer)
    flags, kinds = mi.BSDFFlags, set()
    for random in np.random.default_rng(0).random((60, 3)):
        sample, weight = bsdf.sample(context, si, random[0].item(), random[1:].tolist())
        wo, pdf = number(sample.wo), number(sample.pdf)[0]
        component, kind = int(number(sample.sampled_component)[0]), int(number(sample.sampled_type)[0])
        kinds.add((component, kind))
        if component == 2:
            np.testing.assert_allclose(wo, -np.array(viewer), atol=1e-7)
            np.testing.assert_allclose(number(weight), worn.transparency(hits)[0] / pdf, rtol=1e-5)
            continue
        assert (wo[2] > 0.0) == (component == 0)
        np.testing.assert_allclose(number(bsdf.pdf(context, si, wo.tolist())), pdf, rtol=1e-3)
        np.testing.assert_allclose(number(weight), number(bsdf.eval(context, si, wo.tolist())) / pdf, rtol=1e-3)
    assert kinds == {(0, int(flags.GlossyReflection)), (1, int(flags.GlossyTransmission)), (2, int(flags.Null))}
    assert [int(bsdf.flags(index)) & int(flags.All) for index in range(3)] == [2 + 8, 4 + 16, 1]


@pytest.mark.slow
def test_a_context_chooses_lobes(mi):
    bsdf = mi.load_dict({"type": "twillight", "fabric": "voile", "sigma": 0.5})
    si = interaction(mi, unit(25.0, 70.0).tolist())
    front, behind = unit(40.0, 200.0).tolist(), unit(140.0, 30.0).tolist()
    context = mi.BSDFContext()
    context.component = 0
    assert number(bsdf.eval(context, si, front)).any() and not number(bsdf.eval(context, si, behind)).any()
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.GlossyTransmission)
    assert number(bsdf.pdf(context, si, behind)).any() and not number(bsdf.pdf(context, si, front)).any()


@pytest.mark.parametrize(
    ("plugin", "properties", "words"),
    [
        ("twillight", {"fabric": "denin"}, "did you mean 'denim'"),
        ("twillight", {}, "fabric"),
        ("twillight", {"fabric": "denim", "method": "soft_node"}, "did you mean 'soft_nodes'"),
        ("twillight", {"fabric": "denim", "bounces": 2}, "bounces = 2: "),
        ("twillight", {"fabric": "denim", "yarn": 1.0}, "did you mean 'yarns'"),
        ("twillight_path", {"max_dept": 3}, "did you mean 'max_depth'"),
    ],
)
def test_bad_properties_end_in_one_sentence(scalar, plugin, properties, words):
    with pytest.raises(RuntimeError) as caught:
        scalar.load_dict({"type": plugin, **properties})
    last = str(caught.value).strip().splitlines()[-1]
    assert last.startswith("BadInput: ") and words in last


@NEEDS_LLVM
@pytest.mark.parametrize(
    ("names", "cells", "nodes", "samples"),
    [(("front", "gauze", "behind"), 11, 24, 20_000), slow(tuple(CONFIGURATIONS), 21, 32, 500_000)],
)
def test_mitsubas_chi_square_test(llvm, names, cells, nodes, samples):
    """LEVEL for all configurations together, by Sidak; few cells make the quadrature of densities exact enough. Light
    straight through is a delta lobe and left out. Mitsuba's adapter drops samples without weight. Here they count: the
    density does not know which light is in shadow."""
    import drjit as dr

    context = llvm.BSDFContext()
    context.type_mask = int(llvm.BSDFFlags.All) & ~int(llvm.BSDFFlags.Null)
    for name in names:
        fabric, sigma, theta, phi = CONFIGURATIONS[name]
        viewer = unit(theta, phi).tolist()
        properties = {"type": "twillight", "fabric": fabric, "sigma": sigma, "bounces": "all"}
        _, density = llvm.chi2.BSDFAdapter("twillight", properties, wi=viewer, uv=list(UV), ctx=context)
        bsdf = llvm.load_dict(properties)

        def draw(random, bsdf=bsdf, viewer=viewer):
            si = interaction(llvm, viewer, dr.width(random))
            sample, _ = bsdf.sample(context, si, random[0], [random[1], random[2]])
            scattered = sample.sampled_component != STRAIGHT_THROUGH
            return sample.wo, dr.select(scattered, llvm.Float(1.0), llvm.Float(0.0))

        settings = {"sample_dim": 3, "sample_count": samples, "res": cells, "ires": nodes}
        test = llvm.chi2.ChiSquareTest(llvm.chi2.SphericalDomain(), draw, density, **settings)
        assert test.run(significance_level=LEVEL, test_count=len(names), quiet=True), test.messages
