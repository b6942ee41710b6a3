"""Guards the claims table: one row a claim, its figures from the reports, and no verdict where nothing was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lpvhinf.storage import read_json, write_json
from studies.claims import main, markdown
from studies.claims_of_the_paper import CLAIMS

OUTPUT_DESIGNS = {
    "conventional-rigid": {"gamma_worst": 3.0, "mode_peak_dB": 38.5, "crossover_mean_Hz": [32.0] * 6},
    "conventional": {"gamma_worst": 2.5, "mode_peak_dB": 36.0, "crossover_mean_Hz": [35.0] * 6},
    "observer": {"gamma_worst": 2.5, "mode_peak_dB": 12.0, "crossover_mean_Hz": [34.0] * 5 + [35.0]},
}


@pytest.fixture
def results(tiny_error_results: Path, tmp_path: Path) -> Path:
    """The tiny study of the error-based observer, and figures as the other study reports them."""
    plant = {"n_plant_modes": 4, "magnetics": "first-harmonic"}
    write_json(tmp_path / "output_observer" / "report.json", {"designs": OUTPUT_DESIGNS, "settings": plant})
    write_json(tmp_path / "error_observer" / "report.json", read_json(tiny_error_results / "report.json"))
    return tmp_path


def table(results: Path) -> dict[str, Any]:
    assert main(["--from", str(results)]) == 0
    return {row["claim"]: row for row in read_json(results / "claims" / "claims.json")}


def test_every_part_of_the_paper_has_rows() -> None:
    places = {place for claim in CLAIMS for place in claim.where.split(", ")}
    assert {"abstract", "V-A", "V-B", "conclusions"} <= places
    assert len({claim.claim for claim in CLAIMS}) == len(CLAIMS) >= 15


def test_rows_quote_the_reports(results: Path) -> None:
    rows = table(results)
    assert list(rows) == [claim.claim for claim in CLAIMS]
    designs = read_json(results / "error_observer" / "report.json")["designs"]
    damps = rows["the error-based observer damps the mode actively"]
    assert damps["holds"] is True
    assert damps["conventional"] == f"{designs['inactive']['mode_peak_dB']:.1f} dB"
    assert damps["output"] == f"{designs['output-epsilon-0.1']['mode_peak_dB']:.1f} dB"
    assert damps["error"] == f"{designs['error-epsilon-0.1']['mode_peak_dB']:.1f} dB"
    cheaper = rows["the error-based observer is attractive computationally"]
    assert cheaper["holds"] is True
    assert cheaper["margin"].startswith("12 states")
    unmeasured = [row for row in rows.values() if row["holds"] is None]
    assert [row["margin"].split(":")[0] for row in unmeasured] == [
        "run the study feedforward", "no gain-scheduled design in these studies",
    ]  # fmt: skip
    text = (results / "claims" / "report.md").read_text("utf-8")
    assert text.count("| not measured |") == 2
    assert "Without results of: feedforward." in text
    assert all(row["margin"] in text for row in rows.values())


def test_rows_of_the_output_based_observer(results: Path) -> None:
    rows = table(results)
    similar = rows["both approaches achieve similar rigid-body bandwidth"]
    assert (similar["holds"], similar["margin"]) == (True, "at most 2.9 % apart on any axis")
    assert rows["the output-based observer damps the flexible mode"]["margin"] == "24.0 dB lower"
    path = results / "output_observer" / "report.json"
    report = read_json(path)
    report["designs"]["observer"] |= {"mode_peak_dB": 30.0, "crossover_mean_Hz": [20.0] + [35.0] * 5}
    report["designs"]["conventional-rigid"] |= {"gamma_worst": 2.5, "crossover_mean_Hz": [35.0] * 6}
    write_json(path, report)
    rows = table(results)
    limits = "position-dependent flexible dynamics severely limit what rigid-body control attains"
    assert rows[limits]["holds"] is False
    assert rows["both approaches achieve similar rigid-body bandwidth"]["holds"] is False
    assert rows["the output-based observer damps the flexible mode"]["holds"] is False


def test_a_claim_that_fails_says_so(results: Path) -> None:
    path = results / "error_observer" / "report.json"
    report = read_json(path)
    report["designs"]["error-epsilon-0.1"] |= {"mode_peak_dB": 35.0, "controller_states": 34}
    report["designs"]["output-epsilon-0.1"]["largest_real_part"] = 0.5
    write_json(path, report)
    rows = table(results)
    assert rows["the error-based observer damps the mode actively"]["holds"] is False
    assert rows["the error-based observer is attractive computationally"]["holds"] is False
    validated = rows["effective in simulation on a high-fidelity model of a moving-magnet planar actuator"]
    assert validated["holds"] is False
    assert validated["margin"].startswith("1 of 5 designs unstable")


def test_unbounded_figures_are_no_reason_to_stop(results: Path) -> None:
    path = results / "error_observer" / "report.json"
    report = read_json(path)
    for design in report["designs"].values():
        design |= {"mode_peak_dB": None, "gamma_over_P": None}
        design["columns"]["two-by-two"] = dict.fromkeys(design["columns"]["two-by-two"])
    report["designs"]["error-epsilon-0.1"]["coupling"] = None
    write_json(path, report)
    rows = table(results)
    assert rows["co-design shapes the full closed loop by structured H-infinity synthesis"]["holds"] is False
    assert rows["the error-based observer damps the mode actively"]["error"] == "unbounded"
    assert rows["the error-based observer damps the mode actively"]["holds"] is False


def test_feedforward_is_taken_from_its_study(results: Path) -> None:
    claim = {"claim": "c", "quantity": "force", "value": "1e-15 against 0.3", "holds": True}
    write_json(
        results / "feedforward" / "report.json",
        {"claims": [claim], "settings": {"n_plant_modes": 15, "magnetics": "exact"}},
    )
    row = table(results)["decoupled flexible modes are not excited by the feedforward"]
    assert (row["quantity"], row["margin"], row["holds"]) == ("force", "1e-15 against 0.3", True)
    assert "Without results of" not in (results / "claims" / "report.md").read_text("utf-8")


def test_one_study_alone_leaves_the_rest_unmeasured(tiny_results: Path) -> None:
    """With a report that its study wrote."""
    known = {"output_observer": read_json(tiny_results / "report.json")}
    rows = [{"where": c.where, "claim": c.claim, **vars(c.measured(known))} for c in CLAIMS]
    measured = [row for row in rows if row["holds"] is not None]
    assert len(measured) == 4
    assert "Without results of: error_observer, feedforward." in markdown(rows, known)


def test_no_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--from", str(tmp_path)]) == 1
    assert "holds none of output_observer, error_observer" in capsys.readouterr().err
    (tmp_path / "error_observer").mkdir()
    assert main(["--from", str(tmp_path)]) == 1
    assert "report.json cannot be read" in capsys.readouterr().err
    assert not (tmp_path / "claims").exists()
