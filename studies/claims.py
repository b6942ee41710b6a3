"""The paper's claims side by side: python -m studies.claims [--from results] [--out results/claims].

Every claim of the abstract, of the two observation paragraphs (Section V-A and V-B) and of the conclusions is one row:
the claim, the quantity that we measure for it, its value for the conventional, the output-based and the error-based
design, whether it holds, and by how much. The figures come from the results folders of the studies output_observer,
error_observer and feedforward; where one is missing, or nothing of ours measures a claim, the row says so.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lpvhinf.cli.exit_status import exit_status
from lpvhinf.errors import StorageError
from lpvhinf.storage import make_folder, read_json, write_json, write_text
from studies.claims_of_the_paper import CLAIMS
from studies.error_observer_tables import table

STUDIES = ("output_observer", "error_observer", "feedforward")
VERDICTS = {True: "yes", False: "**no**", None: "not measured"}


def reports(results: Path) -> dict[str, Any]:
    """The reports of the studies that are there."""
    return {name: read_json(results / name / "report.json") for name in STUDIES if (results / name).is_dir()}


def markdown(found: list[dict[str, Any]], known: dict[str, Any]) -> str:
    """The table as a page."""
    head = "where, claim, quantity, conventional, output-based, error-based, holds, by how much"
    texts = ("where", "claim", "quantity", "conventional", "output", "error")
    body = [[*(row[key] for key in texts), VERDICTS[row["holds"]], row["margin"]] for row in found]
    holds, fails = (sum(row["holds"] is verdict for row in found) for verdict in (True, False))
    missing = [name for name in STUDIES if name not in known]
    plants = {
        f"{settings['n_plant_modes']} flexible modes, {settings['magnetics']} field"
        for settings in (report["settings"] for report in known.values())
    }
    lines = [
        "# The paper's claims, measured",
        "",
        "## Claims",
        "",
        *table(head.split(", "), body),
        "",
        f"{holds} of {len(found)} hold, {fails} do not, {len(found) - holds - fails} are not measured. Plant: "
        f"{'; '.join(sorted(plants))}, not the paper's, whose data are not published. Peaks and norms are the largest "
        "found over P at frozen positions, by grids and searches. Conventional: in rows of the 2x2 problem the loop "
        "with the observer inactive.",
        "",
    ]
    if missing:
        lines += [f"Without results of: {', '.join(missing)}.", ""]
    return "\n".join(lines)


def write_claims(results: Path, out: Path) -> None:
    """Write claims.json and report.md from the studies' folders below `results`.

    Raises
    ------
    StorageError
        If there is no results folder of any of the studies, or a report cannot be read.
    """
    known = reports(results)
    if not known:
        raise StorageError(f"{results} holds none of {', '.join(STUDIES)}. Run the studies, or name their folder.")
    found = [{"where": one.where, "claim": one.claim, **dataclasses.asdict(one.measured(known))} for one in CLAIMS]
    make_folder(out)
    write_json(out / "claims.json", found)
    write_text(out / "report.md", markdown(found, known))


def main(argv: Sequence[str] | None = None) -> int:
    """Write the table; the exit status is 1 after an error of ours."""
    parser = argparse.ArgumentParser(prog="python -m studies.claims", description="The paper's claims side by side.")
    parser.add_argument("--from", dest="results", type=Path, default=Path("results"), help="folder of the results")
    parser.add_argument("--out", type=Path, help="folder of the table, default claims in the folder of the results")
    arguments = parser.parse_args(argv)
    out = arguments.out or arguments.results / "claims"
    return exit_status(lambda: write_claims(arguments.results, out))


if __name__ == "__main__":
    sys.exit(main())
