"""The version of the package; ``setup.cfg`` reads this literal."""

__version__ = '0.2.0'
