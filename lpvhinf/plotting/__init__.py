"""Figures of designs and results; nothing below this floor imports matplotlib."""

from lpvhinf.plotting.style import PALETTE as PALETTE
from lpvhinf.plotting.style import ROLES as ROLES
from lpvhinf.plotting.style import WIDTHS as WIDTHS
from lpvhinf.plotting.style import new_figure as new_figure
from lpvhinf.plotting.style import save_figure as save_figure
from lpvhinf.plotting.style import style as style
