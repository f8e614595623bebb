"""``teleop devices``: lists gamepads and 3-D mice of this machine that can move the stylus."""

from collections.abc import Callable, Iterator


def devices() -> None:
    """List gamepads and 3-D mice of this machine, for --set operator=gamepad or spacemouse."""
    from teleop_core.base.errors import SessionError

    searches: tuple[tuple[str, Callable[[], Iterator[str]]], ...] = (
        ("gamepad", _gamepads),
        ("spacemouse", _space_mice),
    )
    for operator, search in searches:
        try:
            names = list(search())
        except SessionError as error:
            names = [str(error)]
        for name in names or ["none found"]:
            print(f"{operator:12} {name}")


def _gamepads() -> Iterator[str]:
    from teleop_core.hand.devices.gamepad import Sdl

    for _, name, is_known in Sdl().names():
        yield (name if is_known else f"{name}: its layout is unknown; SDL_GAMECONTROLLERCONFIG can describe it")


def _space_mice() -> Iterator[str]:
    from teleop_core.hand.devices.spacemouse import space_mice

    for name, _ in space_mice():
        yield name
