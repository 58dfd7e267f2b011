"""The address to listen on, checked before gRPC takes it: gRPC does not say what is wrong with one."""

import errno
import socket


class AddressError(Exception):
    """The server cannot listen there; the message says why and what to do."""


def check(address: str) -> None:
    """Raises AddressError unless a server could listen on host:port now."""
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isascii() and port.isdigit() and int(port) <= 65_535):
        raise AddressError(f"{address!r} is no address: give host:port, such as 127.0.0.1:50051")
    try:
        candidates = socket.getaddrinfo(
            host.strip("[]"), int(port), type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
    except OSError as error:
        raise AddressError(f"cannot resolve the host of {address}: give one of this machine's") from error
    errors = [_bind_error(family, sockaddr) for family, _, _, _, sockaddr in candidates]
    if errno.EADDRINUSE in errors:
        raise AddressError(f"{address} is taken by another program: stop it or choose another port")
    if errno.EACCES in errors:
        raise AddressError(f"{address} may not be listened on by this user: choose a port above 1023")
    if all(errors):
        raise AddressError(f"{address} is not an address of this machine: choose one that is")


def _bind_error(family: socket.AddressFamily, sockaddr: tuple[object, ...]) -> int:
    """The errno of binding, 0 where it works."""
    try:
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            if family == socket.AF_INET6:
                trial.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as gRPC does
            trial.bind(sockaddr)
    except OSError as error:
        return error.errno or errno.EINVAL
    return 0
