"""Print the lower bounds of the dependencies in setup.cfg as pip constraints, one a line: ``pyomo==6.10.1``."""

import configparser
from pathlib import Path

SETTINGS = Path(__file__).parents[1] / 'setup.cfg'


def lowest_bounds():
    """Return one constraint for each requirement of ``install_requires``, written as ``name>=version``."""
    settings = configparser.ConfigParser()
    settings.read(SETTINGS)
    requirements = settings['options']['install_requires'].split()
    return [requirement.replace('>=', '==') for requirement in requirements]


if __name__ == '__main__':
    print(*lowest_bounds(), sep='\n')
