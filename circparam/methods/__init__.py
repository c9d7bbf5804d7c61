"""Methods: every way to flatten the charts of a cut mesh."""

from circparam.methods.base import Layout, Method, MethodOptions
from circparam.methods.pins import Pins
from circparam.methods.table import METHODS

__all__ = ["METHODS", "Layout", "Method", "MethodOptions", "Pins"]
