"""The tables of the page on the simulation say what was measured."""

from benchmarks import kinetic_verification as verification
from benchmarks.kinetic_boxes import Effort
from benchmarks.kinetic_checks import Check
from triboflux.sampling import Estimate


def test_a_check_counts_standard_errors():
    check = Check("self-diffusion", 1.0, Estimate(1.03, 0.01))
    assert check.deviation == (1.03 - 1.0) / 0.01
    approximate = check._replace(exact=False)
    rows = list(verification.check_rows([check, approximate]))
    assert rows[0] == ["self-diffusion", "1", "1.030(10)", "+3.0"]
    assert rows[1][-1] == "not judged"


def test_tables_of_few_particles():
    effort = Effort(particles=200, ensembles=4, seed=5)
    rows = list(verification.step_rows(effort))
    assert [len(row) for row in rows] == [6] * 5
    assert rows[0][1] == "3"
    numbers = list(verification.scatter_rows(effort))
    assert [row[0] for row in numbers] == ["1,000", "4,000", "16,000"]


def test_the_script_returns_1_if_a_value_disagrees(monkeypatch, tmp_path, capsys):
    page = tmp_path / "kinetic.md"
    page.write_text("<!-- begin verification -->\n<!-- end verification -->\n", encoding="utf-8")
    monkeypatch.setattr(verification, "PAGE", page)
    for rows in ("step_rows", "energy_rows", "scatter_rows"):
        monkeypatch.setattr(verification, rows, lambda effort: [["x", "y", "z"]])
    for value, status in ((1.01, 0), (1.06, 1)):
        found = [Check("self-diffusion", 1.0, Estimate(value, 0.01))]
        monkeypatch.setattr(verification, "all_checks", lambda effort, found=found: found)
        options = ["--particles", "200", "--ensembles", "2"]
        assert verification.main(options) == status
        assert "| self-diffusion | 1 |" in capsys.readouterr().out
        assert verification.main([*options, "--write"]) == status
        assert f"Of 1 values {status} are further off" in page.read_text(encoding="utf-8")
