"""Tables of the report on the plant, each from the figures of one part."""

from __future__ import annotations

from typing import Any

AIM = 1e-3  # of the error of every modal gain, relative to the largest of its kind
CLEAN = 1e-9  # gains below are round-off
MODES_HZ = (139.4, 206.5, 259.9, 362, 368, 645, 655, 671, 745, 817, 1118, 1131, 1240, 1290, 1406)


def table(head: str, rows: list[str]) -> list[str]:
    """A Markdown table; `head` and each row hold the cells between bars."""
    return [f"| {head} |", "|" + "---|" * (head.count("|") + 1), *(f"| {row} |" for row in rows)]


def pair(values: list[float], form: str = ".2f") -> str:
    """Two or more numbers with commas."""
    return ", ".join(format(value, form) for value in values)


def small(value: float) -> str:
    """A share; what is round-off counts as zero."""
    if value < CLEAN:
        return "0"
    return f"{value:.2f}" if value >= 0.1 else f"{value:.1e}"


def largest(load: dict[str, Any], limit: float) -> str:
    """Largest current of a load case, and where it is too much for the amplifiers."""
    beyond = f"; above {limit:g} A at {100 * load['share_above']:.0f} % of P" if load["share_above"] > 0.0 else ""
    return f"{load['largest_A']:.2f} A (mean over P {load['mean_largest_A']:.2f}{beyond})"


def summary_table(s: dict[str, Any]) -> list[str]:
    """The plant's own figures beside the benchmark's description."""
    loads = {load["name"]: load for load in s["loads"]}
    level, moving = loads["levitation"], [load for load in s["loads"] if load["name"] != "levitation"]
    acceleration = f"{s['acceleration']:g} m/s2"
    limit, losses = s["current_limit"], [load["loss_mean_W"] for load in moving]
    centre = [1e3 * c for c in s["centre_of_gravity"]]
    rows = [
        f"mass | {s['mass']:.3f} kg | 8.25 kg",
        f"inertia Ixx, Iyy, Izz | {pair([s['inertia'][k][k] for k in range(3)], '.4f')} kg m2 | 0.062, -, about 0.125",
        f"centre of gravity, mover frame | {pair(centre, '.2f')} mm | 7, 7, 0",
        f"damping of the flexible modes | {100 * min(s['damping']):.2f}-{100 * max(s['damping']):.2f} % | 0.8 %",
        f"largest vertical force constant, upper and lower layer | {s['k_z_upper']:.2f}, {s['k_z_lower']:.2f} N/A "
        "| up to 7.4, 3.7",
        f"coils that take part | {s['active_min']}-{s['active_max']} | 48-59",
        f"levitation, largest current | {largest(level, limit)} | 2.1-2.4 A",
        "levitation, root of the sum of squares over 40 | "
        f"{s['levitation_rms_min']:.2f}-{s['levitation_rms_max']:.2f} A | 0.64-0.76 A",
        f"levitation, copper loss | {level['loss_mean_W']:.1f} W (at most {level['loss_max_W']:.1f}) | -",
        *(
            f"{acceleration} along {load['name']}, largest current | {largest(load, limit)} "
            + ("| 2.9 A" if load["name"].endswith("x") else "| -")
            for load in moving
        ),
        f"copper loss of the horizontal accelerations | {min(losses):.0f}-{max(losses):.0f} W | -",
        f"condition number, six rigid-body rows | {s['condition_6_min']:.2f}-{s['condition_6_max']:.2f} | 2.1-2.6",
        f"condition number with five modal rows | {s['condition_11_min']:.2f}-{s['condition_11_max']:.2f} | at most 4",
        f"torsion amplitude times root mass, beam z1 | {pair(s['torsion_z1'])} | 0.77, 0.04",
        f"the same at the point of control | {pair(s['torsion_point_of_control'])} | 0.02, 0.66",
        f"umbrella force per newton of F_z, times root mass | {pair(s['umbrella_per_newton'])} | -0.53, -0.21",
        f"processor time of all gains at a position | {s['position_ms']:.1f} ms | under 20 ms",
    ]
    return [
        *table("quantity | found | description", rows),
        "",
        f"Ranges are over {s['n_points']} positions of P; pairs are at p = (0, 0) and (60, 60) mm. Mode shapes are "
        "positive at the mover's point (150, 75) mm. A coil has 1.2 ohm; it takes part if it has a weight and at least "
        "1 % of the largest force. For the condition numbers torques count at a lever of 0.1 m, and coils by the root "
        "of their weight.",
    ]


def modes_table(s: dict[str, Any]) -> list[str]:
    """Flexible modes of the mover."""
    rows = [
        f"{k + 1} | {hertz:.1f} | {described:g}"
        for k, (hertz, described) in enumerate(zip(s["frequencies_Hz"], MODES_HZ, strict=False))
    ]
    return table("flexible mode | Hz | description", rows)


def validation_tables(v: dict[str, Any], plate: list[float], published: list[float]) -> list[str]:
    """The free plate, and what the model says of itself."""
    rows = [
        f"{k + 1} | {found:.5f} | {wanted:g} | {found / wanted - 1.0:+.1e}"
        for k, (found, wanted) in enumerate(zip(plate, published, strict=True))
    ]
    checks = [
        f"response at {row['hertz']:.1f} Hz: equations of motion against residues | {row['all_modes']:.1e} "
        f"| {row['kept_modes']:.1e}"
        for row in v["responses"]
    ]
    checks.append(f"mean power of the coil forces against what the modal dampers take | {v['power_error']:.1e} | -")
    lines = [
        "Free square plate, nu = 0.3, lambda = omega a^2 sqrt(rho h / D), by Legendre-Ritz; the published values have "
        "the digits shown.",
        "",
        *table("mode | Ritz | published | relative difference", rows),
        "",
        *table("check | all modes | modes kept", checks),
        "",
        "Residues are input gain times output gain of every mode; where modes are left out, their static compliance "
        "stands for them. Largest differences over three positions, relative to the largest response.",
    ]
    if "fields" not in v:
        return [*lines, "", "This run has the first harmonic of the field only: nothing to compare it with."]
    fields = [
        f"{row['quantity']} | {row['exact']:.3g} | {row['first_harmonic']:.3g} | {100 * row['difference']:.1f} %"
        for row in v["fields"]
    ]
    return [
        *lines,
        "",
        "Exact field against its first harmonic, each commutated on itself: largest values over P, largest difference "
        "relative to the largest value. SI units, modes mass-normalised.",
        "",
        *table("quantity | exact | first harmonic | difference", fields),
    ]


def largest_outputs(errors: list[float]) -> float:
    """The three kinds of outputs in one figure."""
    return max(errors[3:])


def polynomial_table(parts: list[dict[str, Any]]) -> list[str]:
    """Errors against degree and controlled modes."""
    rows, notes = [], []
    for part in parts:
        every = zip(part["degrees"], part["nodes"], part["fit_s"], part["errors"], strict=True)
        for degree, nodes, seconds, errors in every:
            modal = small(errors[2]) if part["n_flex"] else "-"
            rows.append(
                f"{part['n_flex']} | {degree} | {nodes} | {seconds:.1f} | {small(errors[0])} | {small(errors[1])} "
                f"| {modal} | {small(largest_outputs(errors))}"
            )
        reached = [d for d, errors in zip(part["degrees"], part["errors"], strict=True) if max(errors) <= AIM]
        found = f"degree {min(reached)}" if reached else "no degree of the table"
        notes.append(f"* {part['n_flex']} controlled modes: {found} reaches {AIM:g} for every gain.")
    head = (
        "controlled modes | degree | positions | CPU s | translation inputs | rotation inputs | modal inputs | outputs"
    )
    return [
        *table(head, rows),
        "",
        f"Largest error of any gain of a flexible mode at {parts[0]['n_points']} random positions, relative to the "
        "largest gain of its kind: input gains to the modes that are left, by translation, rotation and modal inputs; "
        "output gains of all flexible modes. The processor time is that of sampling and fitting, in one thread.",
        "",
        *notes,
    ]


def windows_table(part: dict[str, Any]) -> list[str]:
    """Windows of the commutation."""
    rows = []
    for row in part["rows"]:
        short_in, short_out, long_in, long_out, order = row["window"]
        rows.append(
            f"{1e3 * short_in:.0f}-{1e3 * short_out:.0f} | {1e3 * long_in:.0f}-{1e3 * long_out:.0f} | {order:.0f} "
            f"| {small(max(row['errors']))} | {row['levitation_A']:.2f} | {row['acceleration_A']:.2f} "
            f"| {row['levitation_loss_W']:.1f} | {row['active_min']}-{row['active_max']}"
        )
    head = (
        "short axis mm | long axis mm | smooth derivatives | error | levitation A | acceleration A "
        "| levitation W | coils"
    )
    return [
        *table(head, rows),
        "",
        f"The first row is the benchmark. A coil has full weight up to the first distance and none beyond the second. "
        f"Error of the polynomial model of degree {part['degree']} with one controlled mode, largest of all kinds; "
        "largest currents over P at levitation and at the horizontal acceleration, the worst of four directions; mean "
        "copper loss of levitation; coils that take part.",
    ]


def effects_tables(part: dict[str, Any]) -> list[str]:
    """Deviations of the machine from its known model."""
    rows = []
    for row in part["rows"]:
        place = pair([1e3 * x for x in row["worst_position"]], ".0f") if row["input"] > CLEAN else "-"
        rows.append(
            f"{row['name']}{' *' if row['chosen'] else ''} | {small(row['input'])} | {place} | {small(row['output'])} "
            f"| {small(row['excitation'])} | {row['mode_hertz']:.1f} Hz, {100 * row['mode_damping']:.2f} %"
        )
    d = part["dynamics"]
    lines = [
        *table("effect | input gain | worst at mm | output gain | excitation of mode 1 | mode 1", rows),
        "",
        "Largest deviation of the decoupled rigid-body input and output gains from the identity over "
        f"{part['n_points']} positions: the largest singular value in mass-normalised coordinates. Excitation of the "
        "controlled mode by the rigid-body inputs, relative to the largest one of the conventional decoupling on the "
        "nominal machine. Sizes with * are choices of this study, the others those of the benchmark's description.",
    ]
    if part["left_out"]:
        lines += ["", "The first harmonic of the field cannot show: " + ", ".join(part["left_out"]) + "."]
    rows = [
        f"{f:g} | {round(gain, 3) + 0.0:.3f} | {phase:.1f}"
        for f, gain, phase in zip(d["hertz"], d["gain_dB"], d["phase_deg"], strict=True)
    ]
    return [
        *lines,
        "",
        f"Current loop of 3 kHz and delay of {d['delay_us']:.0f} us, which stand before every input; the sensors "
        f"add {d['noise_nm']:.1f} nm rms of noise and steps of {d['step_nm']:.2f} nm:",
        "",
        *table("Hz | gain dB | phase degrees", rows),
    ]


def full_actuation_table(part: dict[str, Any]) -> list[str]:
    """Coupling of the channels against the mode weight."""
    rows = []
    for row in part["rows"]:
        weight = row["mode_weight"]
        name = "over-actuated" if weight is None else f"fully actuated, {weight:g}"
        rows.append(
            f"{name} | {small(row['rigid'])} | {small(row['excitation'])} | {small(row['modal_to_rigid'])} "
            f"| {small(row['own_gain_min'])} | {small(row['own_gain_max'])}"
        )
    head = (
        "plant, mode weight | rigid-body coupling | excitation left | modal input on rigid body | own gain, least "
        "| own gain, most"
    )
    return [
        *table(head, rows),
        "",
        f"One controlled mode, {part['n_points']} positions, mass-normalised. Rigid-body coupling: largest singular "
        "value of the difference of the rigid-body block from the identity. Excitation left: force of the rigid-body "
        "inputs on the mode, relative to the largest one of the conventional decoupling. Own gain: force of the modal "
        "input on its own mode, 1 if it is decoupled. Zero stands for round-off.",
    ]
