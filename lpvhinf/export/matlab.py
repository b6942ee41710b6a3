"""The MATLAB function that loads an exported controller."""

from __future__ import annotations

from lpvhinf.export.controller import SampledController

TEMPLATE = """\
function K = load_@NAME@(file)
%LOAD_@NAME@ The controller @NAME@, sampled every @PERIOD@ s: @N_X@ states, @N_U@ inputs, @N_Y@ outputs.
%   K = load_@NAME@() reads @FILE@ beside this function; K = load_@NAME@(file) reads another file.
%   [A, B, C, D] = K.step(p) are the matrices of one step at the position p,
%       x(k+1) = A x(k) + B u(k),  y(k) = C x(k) + D u(k).
%   ss(A, B, C, D, K.period) makes it a system of the Control System Toolbox.
%   @SCHEDULING@
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), '@FILE@');
end
K = load(file);
data = K;
K.step = @(varargin) step(data, varargin{:});
end

function [A, B, C, D] = step(K, p)
if nargin < 2
    p = mean(K.box, 2);
end
A = value(K.A, K.box, p);
B = value(K.B, K.box, p);
C = value(K.C, K.box, p);
D = value(K.D, K.box, p);
if strcmp(K.form, 'trapezoidal')
    n = size(A, 1);
    left = eye(n) - K.period / 2 * A;
    D = D + K.period / 2 * C * (left \\ B);
    C = C / left;
    B = K.period * (left \\ B);
    A = 2 * inv(left) - eye(n);
end
end

function M = value(c, box, p)
% Chebyshev series in p scaled to [-1, 1]: c is rows x cols x k_1 x ... x k_np
weights = 1;
for i = 1:size(box, 1)
    if p(i) < box(i, 1) || p(i) > box(i, 2)
        error('p(%d) = %g is outside [%g, %g]', i, p(i), box(i, 1), box(i, 2));
    end
    x = (2 * p(i) - box(i, 1) - box(i, 2)) / (box(i, 2) - box(i, 1));
    weights = kron(cos((0:size(c, i + 2) - 1)' * acos(min(max(x, -1), 1))), weights);
end
M = zeros(size(c, 1), size(c, 2));
if ~isempty(c)
    M(:) = reshape(c, numel(M), []) * weights;
end
end
"""


def loader(controller: SampledController, file: str) -> str:
    """The text of load_NAME.m for a MAT file; it needs no toolbox."""
    K = controller
    bounds = ", ".join(f"[{low:g}, {high:g}]" for low, high in K.box)
    values = {
        "NAME": K.name,
        "FILE": file,
        "PERIOD": f"{K.period:g}",
        "N_X": str(K.n_x),
        "N_U": str(K.n_u),
        "N_Y": str(K.n_y),
        "SCHEDULING": f"p within {bounds}." if K.scheduled else "Nothing depends on p: leave it out.",
    }
    text = TEMPLATE
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text
