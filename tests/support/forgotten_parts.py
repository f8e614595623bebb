"""Parts of a test: gone from the registries when it is over."""

from collections.abc import Iterator

import pytest

from teleop_core.base.own_parts import forget_own_parts
from teleop_core.coupling.architectures import ARCHITECTURES
from teleop_core.coupling.filters import TREMOR_FILTERS
from teleop_core.coupling.network import NETWORKS
from teleop_core.coupling.passivity import PASSIVITIES
from teleop_core.graph.stage import STAGES
from teleop_core.hand.operators import OPERATORS
from teleop_core.shapes import SHAPES
from teleop_core.slave.bridges import BRIDGES
from teleop_core.slave.controllers import CONTROLLERS
from teleop_core.slave.plants import PLANTS

REGISTRIES = (
    ARCHITECTURES, BRIDGES, CONTROLLERS, NETWORKS, OPERATORS, PASSIVITIES, PLANTS,
    SHAPES, STAGES, TREMOR_FILTERS,
)  # fmt: skip


@pytest.fixture
def own_parts() -> Iterator[None]:
    """Let a test register parts, and take them away after it."""
    yield
    forget_own_parts()
    for registry in REGISTRIES:
        for name in registry.names():
            if registry.is_added(name):
                registry.remove(name)
