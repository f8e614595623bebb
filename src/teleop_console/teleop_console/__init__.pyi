from .controls import Control as Control, register_control as register_control

__version__: str
