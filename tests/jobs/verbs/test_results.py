"""`twillight results` on a made-up page."""

import pytest

from jobs.cli import main
from reports.record import Machine, Provenance, Record, write_records
from reports.tables.documents import markers

MACHINE = Machine(cpu="Test CPU", cores=2, threads=2, system="", python="", packages={}, date="2026-01-01")


@pytest.fixture
def out(tmp_path):
    subject = Record(method="point_sampled", setting="k = 2", provenance=Provenance(recipe="smoke"))
    records = [subject.of("time", 500.0, 25, low=490.0, high=510.0)]
    for fabric, role in (("denim", "seen"), ("twill_4_4", "unseen")):
        queries = subject.model_copy(update={"fabric": fabric, "role": role, "scene": "queries"})
        records += [queries.of("mse", 1e-3, 400, standard_error=1e-5), queries.of("mse_measured", 1e-3, 400)]
        records += [queries.of("truth_noise", 1e-6, 400), queries.of("colour_rrmse", 0.3, 400)]
        records.append(queries.model_copy(update={"scene": "plane"}).of("flicker", 0.5, 3))
        records.append(queries.model_copy(update={"scene": "plane"}).of("excess_energy", 0.5, 3))
    records.append(subject.of("bytes_stored", 2000.0, 2))
    records += [r.model_copy(update={"metric": "zero_answers", "value": 0.0}) for r in records if r.metric == "mse"]
    records += [
        r.model_copy(update={"metric": f"rrmse_{name}"})
        for r in records
        if r.metric == "mse"
        for name in ("specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft")
    ]
    write_records(tmp_path / "report" / "smoke" / "records.json", records, MACHINE)
    return tmp_path


def test_the_tables_are_written_beside_the_page_or_where_it_is_said(out, capsys):
    assert main(["results", "smoke", "--out", str(out)]) == 0, capsys.readouterr().err
    assert main(["results", "smoke", "--out", str(out), "--file", str(out / "R.md")]) == 0
    beside = (out / "report" / "smoke" / "results.md").read_text(encoding="utf-8")
    assert beside == (out / "R.md").read_text(encoding="utf-8")
    assert beside.startswith("# Results of the recipe `smoke`")


def test_only_the_block_of_a_readme_is_written(out, capsys):
    first, last = markers("quick")
    file = out / "README.md"
    file.write_text(f"title\n{first}\n{last}\nend\n", encoding="utf-8")
    assert main(["results", "smoke", "--out", str(out), "--readme", str(file)]) == 0, capsys.readouterr().err
    text = file.read_text(encoding="utf-8")
    assert text.startswith(f"title\n{first}\n| method | MSE") and text.endswith(f"{last}\nend\n")
    assert not (out / "report" / "smoke" / "results.md").exists()
    capsys.readouterr()
    assert main(["results", "smoke", "--out", str(out), "--readme", str(file)]) == 0
    assert "unchanged" in capsys.readouterr().out and file.read_text(encoding="utf-8") == text
