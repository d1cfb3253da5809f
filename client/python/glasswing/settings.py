"""The server's address and the client's certificates: the same settings as for the command line.

A setting is taken from the caller, its environment variable (GLASSWING_SERVER, GLASSWING_CA, GLASSWING_CERTIFICATE,
GLASSWING_KEY), the configuration file, or the default, in this order. The file is the one that GLASSWING_CONFIG names, or
~/.config/glasswing/config.toml if it exists:

    server = "rig.example.org:7440"
    ca = "rig-ca.pem"              # relative to the file's directory
    certificate = "me.pem"
    key = "me.key"
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import tomllib

from glasswing.errors import InvalidInput, NotFound

_DEFAULT_SERVER = "127.0.0.1:7440"
_KEYS = ("server", "ca", "certificate", "key", "color")  # color is for the command line only


@dataclasses.dataclass(frozen=True)
class Settings:
    """A connection's server and PEM files; without ``ca`` it is not encrypted."""

    server: str
    ca: pathlib.Path | None
    certificate: pathlib.Path | None
    key: pathlib.Path | None


def load_settings(
    server: str | None,
    ca: str | os.PathLike[str] | None,
    certificate: str | os.PathLike[str] | None,
    key: str | os.PathLike[str] | None,
) -> Settings:
    """The settings in force. InvalidInput names the wrong file. NotFound: the file that GLASSWING_CONFIG names is missing."""
    in_file = _read_file()

    def chosen(name: str, given: str | os.PathLike[str] | None) -> str:
        if given:
            return os.fspath(given)
        return os.environ.get(f"GLASSWING_{name.upper()}", "") or in_file.get(name, "")

    def chosen_file(name: str, given: str | os.PathLike[str] | None) -> pathlib.Path | None:
        path = chosen(name, given)
        return pathlib.Path(path) if path else None

    return Settings(
        chosen("server", server) or _DEFAULT_SERVER,
        chosen_file("ca", ca),
        chosen_file("certificate", certificate),
        chosen_file("key", key),
    )


def _read_file() -> dict[str, str]:
    asked = os.environ.get("GLASSWING_CONFIG")
    home = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    path = pathlib.Path(asked or pathlib.Path(home, "glasswing", "config.toml"))
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        if asked:
            raise NotFound(f"GLASSWING_CONFIG is {path}; there is no such file") from None
        return {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput(f"{path}: {error}") from None
    for name, value in found.items():
        if name not in _KEYS:
            raise InvalidInput(f"{path}: there is no key {name}; there are {', '.join(_KEYS)}")
        if not isinstance(value, str):
            raise InvalidInput(f'{path}: {name} is {value}; it must be text, as in {name} = "VALUE"')
        if name in ("ca", "certificate", "key") and value:
            found[name] = str(path.parent / value)
    return found
