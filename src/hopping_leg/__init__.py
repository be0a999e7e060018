"""End-to-end reinforcement learning for torque-based, variable-height hopping of one leg.

Importing it makes ``HoppingLeg-v0`` known to Gymnasium; an installed package is imported by
``hopping_leg.pth`` at the start of Python, since Gymnasium has no plugin entry points.
"""

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

ENV_ID = "HoppingLeg-v0"
"""Name for ``gymnasium.make`` and ``gymnasium.make_vec``."""


def _register() -> None:
    import gymnasium

    gymnasium.register(
        ENV_ID,
        entry_point="hopping_leg.envs.gymnasium_envs:HoppingEnv",
        vector_entry_point="hopping_leg.envs.gymnasium_envs:HoppingVectorEnv",
    )


class _RegisterWhenImported:
    """Registers the environment once Gymnasium is imported: alone that takes 0.1 s."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                run(module)
                _register()

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


if "gymnasium" in sys.modules:
    _register()
else:
    sys.meta_path.insert(0, _RegisterWhenImported())
