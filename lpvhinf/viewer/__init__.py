"""An interactive page of designs over all positions: one HTML file, no network, no server."""

from lpvhinf.viewer.page import Page as Page
from lpvhinf.viewer.page import view as view
