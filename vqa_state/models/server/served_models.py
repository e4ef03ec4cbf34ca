"""Which models a server offers, as addresses that can be chosen."""

from vqa_state.errors import MissingPackageError
from vqa_state.models.address import ModelAddress, Source

__all__ = ["offered"]


def offered(url: str) -> tuple[str, ...]:
    """Ask a server for its models. Call it only when the user says so; no picture is sent.

    Args:
        url: http://host:port/v1, with or without "server:" before it.

    Raises:
        MissingPackageError: if the openai package is not installed.
        ModelError: if the URL cannot be used, or the server does not give its list.
    """
    url = url.strip().removeprefix("server:")
    try:
        from vqa_state.models.server.model import list_models

        names = list_models(url)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("vqa_state"):
            raise  # our own mistake, not a missing package
        raise MissingPackageError(f"server:{url}", error.name) from error
    return tuple(str(ModelAddress(Source.SERVER, url, name)) for name in names if name)
