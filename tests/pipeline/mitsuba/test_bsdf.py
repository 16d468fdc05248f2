"""The BSDF `twillight` as Mitsuba sees it: values, lobes, and its own chi-square test."""

import numpy as np
import pytest

from pipeline.mitsuba.bsdf import STRAIGHT_THROUGH
from pipeline.mitsuba.worn import ClothOptions, RayHits, Worn
from tests.pipeline.mitsuba.conftest import NEEDS_LLVM, unit
from tests.presets import slow

LEVEL = 0.01
CONFIGURATIONS = {
    "front": ("polyester_lining", 0.3, 30.0, 20.0),
    "along the normal": ("denim", 0.3, 0.0, 0.0),
    "grazing": ("silk_charmeuse", 0.4, 80.0, 130.0),
    "very grazing": ("wool_gabardine", 0.4, 86.0, 250.0),
    "wide": ("silk_charmeuse", 30.0, 40.0, 65.0),
    "tiny": ("polyester_lining", 0.001, 50.0, 250.0),
    "one yarn": ("cotton_twill", 0.1, 60.0, 300.0),
    "voile": ("voile", 1.5, 20.0, 100.0),
    "gauze": ("gauze", 0.4, 70.0, 10.0),
    "behind": ("silk_charmeuse", 0.5, 130.0, 45.0),
    "behind a gauze": ("gauze", 1.0, 105.0, 200.0),
    "behind, along the normal": ("denim", 0.5, 180.0, 0.0),
}
"""Fabric, deviation of the footprint, and the viewer's angle to the normal and azimuth: more than 90 is behind."""
UV = (0.0062, 0.0057)


def interaction(mi, viewer, count=1):
    """Return places in local coordinates, as Mitsuba's own tests make them."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi, si.uv = viewer, UV
    si.sh_frame = mi.Frame3f([0, 0, 1])
    return si


def hits(viewer):
    zero = np.zeros((1, 3))
    return RayHits(np.array([UV]), np.array([viewer]), zero, np.ones(1), np.zeros((1, 2, 2)), np.zeros(1))


def number(value):
    return np.asarray(value, np.float64).reshape(-1)


@pytest.mark.parametrize("name", ["front", slow("gauze"), "behind"])
def test_values_and_densities_are_those_of_the_cloth(mi, name):
    fabric, sigma, theta, phi = CONFIGURATIONS[name]
    bsdf = mi.load_dict({"type": "twillight", "fabric": fabric, "sigma": sigma})
    worn = Worn(ClothOptions(fabric=fabric, sigma=sigma))
    si, context = interaction(mi, unit(theta, phi).tolist()), mi.BSDFContext()
    for light in (unit(40.0, 200.0).tolist(), unit(120.0, 30.0).tolist()):
        one = hits(unit(theta, phi).tolist())
        value, pdf = bsdf.eval_pdf(context, si, light)
        np.testing.assert_allclose(number(value), worn.eval(one, np.array([light]))[0], rtol=1e-5)
        np.testing.assert_allclose(number(pdf), worn.pdf(one, np.array([light])), rtol=1e-5)
        np.testing.assert_array_equal(number(bsdf.eval(context, si, light)), number(value))
        np.testing.assert_array_equal(number(bsdf.pdf(context, si, light)), number(pdf))


@pytest.mark.slow
def test_samples_name_their_lobe(mi):
    """Voile at numbers that reach each lobe; the gap's light goes straight on, and has its probability as density."""
    bsdf = mi.load_dict({"type": "twillight", "fabric": "voile", "sigma": 0.5})
    viewer = unit(25.0, 70.0).tolist()
    si, context = interaction(mi, viewer), mi.BSDFContext()
    worn, one = Worn(ClothOptions(fabric="voile", sigma=0.5)), hits(viewer)
    flags, kinds = mi.BSDFFlags, set()
    for random in np.random.default_rng(0).random((60, 3)):
        sample, weight = bsdf.sample(context, si, random[0].item(), random[1:].tolist())
        wo, pdf = number(sample.wo), number(sample.pdf)[0]
        component, kind = int(number(sample.sampled_component)[0]), int(number(sample.sampled_type)[0])
        kinds.add((component, kind))
        if component == 2:
            np.testing.assert_allclose(wo, -np.array(viewer), atol=1e-7)
            np.testing.assert_allclose(number(weight), worn.transparency(one)[0] / pdf, rtol=1e-5)
            continue
        assert (wo[2] > 0.0) == (component == 0)
        np.testing.assert_allclose(number(bsdf.pdf(context, si, wo.tolist())), pdf, rtol=1e-3)
        np.testing.assert_allclose(number(weight), number(bsdf.eval(context, si, wo.tolist())) / pdf, rtol=1e-3)
    assert kinds == {(0, int(flags.GlossyReflection)), (1, int(flags.GlossyTransmission)), (2, int(flags.Null))}
    assert [int(bsdf.flags(index)) & int(flags.All) for index in range(3)] == [2 + 8, 4 + 16, 1]


@pytest.mark.slow
def test_a_context_chooses_lobes(mi):
    bsdf = mi.load_dict({"type": "twillight", "fabric": "voile", "sigma": 0.5})
    si, front, behind = (
        interaction(mi, unit(25.0, 70.0).tolist()),
        unit(40.0, 200.0).tolist(),
        unit(140.0, 30.0).tolist(),
    )
    context = mi.BSDFContext()
    context.component = 0
    assert number(bsdf.eval(context, si, front)).any() and not number(bsdf.eval(context, si, behind)).any()
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.GlossyTransmission)
    assert number(bsdf.pdf(context, si, behind)).any() and not number(bsdf.pdf(context, si, front)).any()


def test_light_straight_through_is_known_without_sampling(mi):
    bsdf = mi.load_dict({"type": "twillight", "fabric": "gauze", "sigma": 0.5})
    viewer = unit(25.0, 70.0).tolist()
    share = number(bsdf.eval_null_transmission(interaction(mi, viewer)))
    wanted = Worn(ClothOptions(fabric="gauze", sigma=0.5)).transparency(hits(viewer))
    np.testing.assert_allclose(share, wanted[0], rtol=1e-5)
    assert 0.1 < share[0] < 0.9


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ({"fabric": "denin"}, "did you mean 'denim'"),
        ({}, "fabric"),
        ({"fabric": "denim", "method": "soft_node"}, "did you mean 'soft_nodes'"),
        ({"fabric": "denim", "yarns": -1.0}, "yarns"),
        ({"fabric": "denim", "yarn": 1.0}, "did you mean 'yarns'"),
    ],
)
def test_bad_properties_end_in_one_sentence(scalar, properties, words):
    with pytest.raises(RuntimeError) as caught:
        scalar.load_dict({"type": "twillight", **properties})
    last = str(caught.value).strip().splitlines()[-1]
    assert last.startswith("BadInput: ") and words in last


def chi_square(mi, name, cells, nodes, samples):
    """Return Mitsuba's chi-square test of a configuration; light straight through is a delta lobe and left out.

    Mitsuba's adapter drops samples without weight. Here they count: the density does not know which light is in shadow.
    """
    import drjit as dr

    fabric, sigma, theta, phi = CONFIGURATIONS[name]
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.All) & ~int(mi.BSDFFlags.Null)
    properties = {"type": "twillight", "fabric": fabric, "sigma": sigma}
    _, density = mi.chi2.BSDFAdapter("twillight", properties, wi=unit(theta, phi).tolist(), uv=list(UV), ctx=context)
    bsdf = mi.load_dict(properties)

    def draw(random):
        si = interaction(mi, unit(theta, phi).tolist(), dr.width(random))
        sample, _ = bsdf.sample(context, si, random[0], [random[1], random[2]])
        return sample.wo, dr.select(sample.sampled_component == STRAIGHT_THROUGH, mi.Float(0.0), mi.Float(1.0))

    return mi.chi2.ChiSquareTest(
        domain=mi.chi2.SphericalDomain(),
        sample_func=draw,
        pdf_func=density,
        sample_dim=3,
        sample_count=samples,
        res=cells,
        ires=nodes,
    )


@NEEDS_LLVM
@pytest.mark.parametrize("name", ["front", "gauze", "behind"])
def test_mitsubas_chi_square_test_in_short(llvm, name):
    """Sidak over the three; few cells, so that the quadrature of densities is exact enough."""
    test = chi_square(llvm, name, 11, 24, 20_000)
    assert test.run(significance_level=LEVEL, test_count=3, quiet=True), test.messages


@pytest.mark.slow
@NEEDS_LLVM
@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_mitsubas_chi_square_test(llvm, name):
    """Twelve configurations at a level of LEVEL for all of them together."""
    test = chi_square(llvm, name, 21, 32, 500_000)
    assert test.run(significance_level=LEVEL, test_count=len(CONFIGURATIONS), quiet=True), test.messages
