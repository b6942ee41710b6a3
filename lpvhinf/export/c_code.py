"""A sampled controller as C: a header and a source of fixed sizes that need nothing, not even the C library.

The code is C89, C99 and C++. All memory is in the state that the caller holds, so that several controllers, or several
instances of one, run side by side; tables are constant. A position outside the box is moved to its border, and the
step says so: a machine must not extrapolate a polynomial.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.export.c_templates import BASIS, EVALUATE, HEADER, MULTIPLY, SOLVE, SOURCE
from lpvhinf.export.controller import SampledController
from lpvhinf.polynomial import ChebyshevMatrix

PRECISIONS: dict[str, Any] = {"double": np.float64, "single": np.float32}


def c_code(controller: SampledController, *, precision: str = "double") -> tuple[str, str]:
    """The text of NAME.h and of NAME.c.

    Parameters
    ----------
    controller : SampledController
    precision : "double" or "single"
        The type NAME_real of all numbers: double or float.

    Raises
    ------
    DomainError
        If the precision is unknown, or a number is too large for it.

    Examples
    --------
    >>> from lpvhinf.export import sampled
    >>> header, source = c_code(sampled(2.0, name="gain"))
    >>> [line for line in header.splitlines() if "gain_step" in line]
    ['int gain_step(gain_state *state, const gain_real *u, gain_real *y);']
    """
    if precision not in PRECISIONS:
        raise DomainError(f"precision is {precision!r}, wanted one of {', '.join(PRECISIONS)}.")
    K = controller
    parts = _Tables(K, precision)
    position = "const @_real *p, " if K.scheduled else ""
    work = [f"    @_real {name}[{size}];" for name, size in parts.work()]
    returned = "1 if p was outside the box and was moved to its border" if K.scheduled else "never anything else"
    if K.form == "trapezoidal":
        returned += ", 2 if the step is singular: then state and y are as before"
    header = _filled(
        HEADER,
        K.name,
        SUMMARY=_summary(K, precision),
        N_X=str(K.n_x),
        N_U=str(K.n_u),
        N_Y=str(K.n_y),
        N_P=str(K.n_p),
        PERIOD=repr(float(K.period)),
        REAL="double" if precision == "double" else "float",
        N_STATE=str(max(1, K.n_x)),
        WORK="\n".join(work),
        POSITION=position,
        RETURNED=returned,
    )
    step = "\n".join(f"    {line}".rstrip() for line in parts.step())
    functions = [MULTIPLY] if "multiply_add" in step else []
    if K.scheduled:
        functions += [BASIS, EVALUATE]
    if K.form == "trapezoidal":
        functions.append(SOLVE)
    source = _filled(
        SOURCE,
        K.name,
        TABLES="\n".join(parts.tables()),
        FUNCTIONS="\n".join(functions),
        POSITION=position,
        STEP=step,
        ZERO=parts.number(0.0),
        ONE=parts.number(1.0),
        TWO=parts.number(2.0),
    )
    return header, source


class _Tables:
    """The parts of the source that depend on the controller."""

    def __init__(self, controller: SampledController, precision: str) -> None:
        self.K, self.kind = controller, PRECISIONS[precision]
        half = 0.5 * controller.period if controller.form == "trapezoidal" else 1.0
        scaled = (half * np.eye(controller.n_x) @ controller.A, half * np.eye(controller.n_x) @ controller.B)
        self.matrices: dict[str, ChebyshevMatrix] = {
            name: matrix.trimmed()
            for name, matrix in zip("ABCD", (*scaled, controller.C, controller.D), strict=True)
            if np.any(matrix.coefficients) or (name == "A" and controller.form == "trapezoidal")
        }
        self.degree = [max(d) for d in zip(*(matrix.degree for matrix in controller.matrices), strict=True)]
        self.varying = [name for name, matrix in self.matrices.items() if not matrix.is_constant]

    def number(self, value: float) -> str:
        """A literal that is read back as the same number; shortest form."""
        with np.errstate(over="ignore"):
            cast = self.kind(value)
        if not np.isfinite(cast):
            raise DomainError(f"the number {value!r} is too large for single precision. Rescale, or use 'double'.")
        return f"{cast!s}f" if self.kind is np.float32 else repr(float(cast))

    def work(self) -> list[tuple[str, int]]:
        """Arrays in the state beside x, with their sizes."""
        K = self.K
        out = [(name, self.matrices[name].shape[0] * self.matrices[name].shape[1]) for name in self.varying]
        if self.varying:
            out.append(("basis", int(np.prod([d + 1 for d in self.degree]))))
            out.append(("powers", max(self.degree) + 1))
        if K.form == "trapezoidal":
            out += [("left", K.n_x**2), ("now", K.n_x)]
        elif K.n_x:
            out.append(("next", K.n_x))
        return out

    def tables(self) -> list[str]:
        lines = []
        if self.varying:
            lines += [
                f"#define N_BASIS {int(np.prod([d + 1 for d in self.degree]))}",
                f"static const int degree[{len(self.degree)}] = {{{', '.join(map(str, self.degree))}}};",
                self._array("lower", self.K.box[:, 0]),
                self._array("upper", self.K.box[:, 1]),
            ]
        for name, matrix in self.matrices.items():
            flat = matrix.padded(self.degree).reshape(-1, matrix.shape[0] * matrix.shape[1])
            lines.append(self._array(f"{name}_constant", flat[0]))
            if name in self.varying:
                at = np.flatnonzero(np.any(flat[1:] != 0.0, axis=0))
                lines.append(f"#define {name}_COUNT {len(at)}")
                lines.append(f"static const int {name}_at[{len(at)}] = {{{_wrapped(map(str, at))}}};")
                lines.append(self._array(f"{name}_coefficients", flat[1:, at].T))
        return lines

    def _array(self, name: str, values: Array) -> str:
        flat = np.ravel(values)
        return f"static const @_real {name}[{flat.size}] = {{{_wrapped(self.number(float(v)) for v in flat)}}};"

    def step(self) -> list[str]:
        K, lines = self.K, ["int status = 0;"]
        if K.n_x:
            lines.insert(0, "int i;")
        if self.varying:
            lines.append("status = evaluate_basis(p, state->powers, state->basis);")
        for name in self.varying:
            size = self.matrices[name].shape[0] * self.matrices[name].shape[1]
            lines.append(
                f"evaluate({name}_constant, {size}, {name}_at, {name}_coefficients, {name}_COUNT, state->basis, "
                f"state->{name});"
            )
        if K.form == "trapezoidal":
            lines += [
                f"for (i = 0; i < {K.n_x**2}; i++) state->left[i] = -{self._of('A')}[i];",
                f"for (i = 0; i < {K.n_x}; i++) {{",
                f"    state->left[{K.n_x + 1} * i] += {self.number(1.0)};",
                "    state->now[i] = state->x[i];",
                "}",
                *self._add("B", "u", "state->now"),
                f"if (!solve(state->left, {K.n_x}, state->now)) return 2;",
                *self._output("state->now"),
                f"for (i = 0; i < {K.n_x}; i++) state->x[i] = {self.number(2.0)} * state->now[i] - state->x[i];",
            ]
        else:
            lines += self._output("state->x")
            if K.n_x:
                lines.append(f"for (i = 0; i < {K.n_x}; i++) state->next[i] = {self.number(0.0)};")
                lines += self._add("A", "state->x", "state->next") + self._add("B", "u", "state->next")
                lines.append(f"for (i = 0; i < {K.n_x}; i++) state->x[i] = state->next[i];")
        used = {word for line in lines for word in re.findall(r"\w+", line)}
        unused = [name for name in ("state", "u", "y") if name not in used]
        return lines + [f"(void){name};" for name in unused] + ["return status;"]

    def _output(self, x: str) -> list[str]:
        if not self.K.n_y:
            return []
        zero = f"{{ int row; for (row = 0; row < {self.K.n_y}; row++) y[row] = {self.number(0.0)}; }}"
        return [zero, *self._add("C", x, "y"), *self._add("D", "u", "y")]

    def _add(self, name: str, vector: str, out: str) -> list[str]:
        if name not in self.matrices:  # zero
            return []
        rows, cols = self.matrices[name].shape
        return [f"multiply_add({self._of(name)}, {rows}, {cols}, {vector}, {out});"]

    def _of(self, name: str) -> str:
        return f"state->{name}" if name in self.varying else f"{name}_constant"


def _filled(template: str, name: str, **values: str) -> str:
    for key, value in values.items():
        template = template.replace(f"${key}$", value)
    return template.replace("@", name)


def _wrapped(values: Iterable[str]) -> str:
    """Numbers in lines of readable length."""
    lines, current = [], ""
    for value in values:
        if len(current) + len(value) > 110:
            lines.append(current)
            current = ""
        current += f"{value}, "
    return "\n    " + "\n    ".join([*lines, current.rstrip(", ")]) + "\n"


def _summary(K: SampledController, precision: str) -> str:
    lines = [
        f"The controller {K.name}: {K.n_x} states, {K.n_u} inputs, {K.n_y} outputs, one step every {K.period:g} s,",
        f"in {precision} precision, "
        + ("by the trapezoidal rule." if K.form == "trapezoidal" else "x+ = A x + B u, y = C x + D u."),
    ]
    if K.scheduled:
        bounds = ", ".join(f"[{low:g}, {high:g}]" for low, high in K.box)
        lines.append(f"Scheduled by the position p within {bounds}.")
    for label, names in (("u", K.inputs), ("y", K.outputs)):
        lines += [f"{label}[{i}]: {text}" for i, text in enumerate(names)]
    # a name must not end the comment
    return "\n".join(f" * {line.replace('*/', '* /').replace('@', '(at)')}" for line in lines)
