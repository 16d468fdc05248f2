"""Plugins in every variant; LLVM that is missing; variants without RGB."""

import pytest

from pipeline.mitsuba import register as module
from weaves.errors import BadInput


def test_without_llvm_the_scalar_variant_is_used_and_said(monkeypatch):
    monkeypatch.setattr(module, "llvm_works", lambda: True)
    assert module.best_variant() == "llvm_ad_rgb"
    monkeypatch.setattr(module, "llvm_works", lambda: False)
    with pytest.warns(UserWarning, match=r"apt install libllvm19.*DRJIT_LIBLLVM_PATH"):
        assert module.best_variant() == "scalar_rgb"


def test_the_plugins_are_there_again_after_a_change_of_variant(use):
    mi = use("scalar_rgb")
    other = next(name for name in mi.variants() if name not in ("scalar_rgb", "llvm_ad_rgb") and "scalar" in name)
    mi.set_variant(other)
    mi.set_variant("scalar_rgb")
    assert "twillight[" in str(mi.load_dict({"type": "twillight", "fabric": "denim"}))
    assert "twillight_path[" in str(mi.load_dict({"type": "twillight_path"}))


def test_a_variant_without_rgb_is_one_sentence(use):
    mi = use("scalar_rgb")
    mi.set_variant(next(name for name in mi.variants() if name.startswith("scalar_spectral")))
    with pytest.raises(BadInput, match="must have RGB colours"):
        module.register()
