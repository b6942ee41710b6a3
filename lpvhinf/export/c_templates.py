"""The C text that is the same for every controller: ``@`` stands for its name, ``$KEY$`` for what differs."""

HEADER = """\
/*
$SUMMARY$
 */
#ifndef @_H
#define @_H

#ifdef __cplusplus
extern "C" {
#endif

#define @_N_X $N_X$
#define @_N_U $N_U$
#define @_N_Y $N_Y$
#define @_N_P $N_P$
#define @_PERIOD $PERIOD$ /* s */

typedef $REAL$ @_real;

/* The memory of one controller; x is its state, the rest is room to work. */
typedef struct {
    @_real x[$N_STATE$];
$WORK$
} @_state;

/* To rest. Call it once before the first step. */
void @_reset(@_state *state);

/* One sample: y from u, which must not overlap. Returns 0; $RETURNED$. */
int @_step(@_state *state, $POSITION$const @_real *u, @_real *y);

#ifdef __cplusplus
}
#endif

#endif
"""

SOURCE = """\
#include "@.h"

$TABLES$

$FUNCTIONS$
void @_reset(@_state *state)
{
    int i;
    for (i = 0; i < (int)(sizeof state->x / sizeof state->x[0]); i++) state->x[i] = $ZERO$;
}

int @_step(@_state *state, $POSITION$const @_real *u, @_real *y)
{
$STEP$
}
"""

MULTIPLY = """\
/* out += matrix * vector, row by row */
static void multiply_add(const @_real *matrix, int rows, int cols, const @_real *vector, @_real *out)
{
    int i, j;
    for (i = 0; i < rows; i++) {
        @_real sum = out[i];
        for (j = 0; j < cols; j++) sum += matrix[i * cols + j] * vector[j];
        out[i] = sum;
    }
}
"""

BASIS = """\
/* products of Chebyshev polynomials of p scaled to [-1, 1]; 1 if p had to be moved to the border of the box */
static int evaluate_basis(const @_real *p, @_real *powers, @_real *basis)
{
    int axis, i, j, count = 1, moved = 0;
    basis[0] = $ONE$;
    for (axis = 0; axis < @_N_P; axis++) {
        @_real x, q = p[axis];
        if (!(q >= lower[axis])) { /* NaN too */
            q = lower[axis];
            moved = 1;
        }
        if (q > upper[axis]) {
            q = upper[axis];
            moved = 1;
        }
        x = ($TWO$ * q - lower[axis] - upper[axis]) / (upper[axis] - lower[axis]);
        powers[0] = $ONE$;
        if (degree[axis] > 0) powers[1] = x;
        for (i = 2; i <= degree[axis]; i++) powers[i] = $TWO$ * x * powers[i - 1] - powers[i - 2];
        /* backwards, so that nothing is overwritten before it is used */
        for (i = count - 1; i >= 0; i--)
            for (j = degree[axis]; j >= 0; j--) basis[i * (degree[axis] + 1) + j] = basis[i] * powers[j];
        count *= degree[axis] + 1;
    }
    return moved;
}
"""

EVALUATE = """\
/* a matrix at p: its constant part, and the entries that vary */
static void evaluate(const @_real *constant, int size, const int *at, const @_real *coefficients, int count,
                     const @_real *basis, @_real *out)
{
    int i, j;
    for (i = 0; i < size; i++) out[i] = constant[i];
    for (i = 0; i < count; i++) {
        @_real sum = out[at[i]];
        for (j = 1; j < N_BASIS; j++) sum += coefficients[i * (N_BASIS - 1) + j - 1] * basis[j];
        out[at[i]] = sum;
    }
}
"""

SOLVE = """\
/* matrix * result = vector by elimination with the largest pivot of each column; the result replaces the vector */
static int solve(@_real *matrix, int n, @_real *vector)
{
    int i, j, k;
    for (k = 0; k < n; k++) {
        int pivot = k;
        @_real largest = $ZERO$, swap;
        for (i = k; i < n; i++) {
            @_real size = matrix[i * n + k];
            if (size < $ZERO$) size = -size;
            if (size > largest) {
                largest = size;
                pivot = i;
            }
        }
        if (!(largest > $ZERO$)) return 0;
        if (pivot != k) {
            for (j = k; j < n; j++) {
                swap = matrix[k * n + j];
                matrix[k * n + j] = matrix[pivot * n + j];
                matrix[pivot * n + j] = swap;
            }
            swap = vector[k];
            vector[k] = vector[pivot];
            vector[pivot] = swap;
        }
        for (i = k + 1; i < n; i++) {
            @_real factor = matrix[i * n + k] / matrix[k * n + k];
            if (factor == $ZERO$) continue; /* controllers are sparse */
            for (j = k + 1; j < n; j++) matrix[i * n + j] -= factor * matrix[k * n + j];
            vector[i] -= factor * vector[k];
        }
    }
    for (i = n - 1; i >= 0; i--) {
        @_real sum = vector[i];
        for (j = i + 1; j < n; j++) sum -= matrix[i * n + j] * vector[j];
        vector[i] = sum / matrix[i * n + i];
    }
    return 1;
}
"""
